//! The sensor and the stream: each trigger causes an exposure, whose frame is sent in packets.

use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use krylux::rig::{Devices, Frame};
use krylux::transport::ExplicitMatrix;

use super::registers::{
    EXPOSURE, GAIN, GAMMA, HEIGHT, OFFSET_X, OFFSET_Y, PACKET_SIZE, PIXEL_FORMAT, Registers, Sent, WIDTH,
};
use super::{Scene, Shared, pixels};

/// The number of frames whose packets can be requested again.
const KEPT: usize = 4;

/// The time between two looks at the pattern during an exposure.
const LOOK: Duration = Duration::from_millis(5);

/// The patterns on screen during an exposure, with the number of looks in which each was seen.
type Seen = Vec<(Frame, usize)>;

pub fn serve(
    shared: &Shared,
    triggers: &Receiver<()>,
    scene: &Scene,
    mut look: impl FnMut() -> Option<Frame>,
) {
    let size = scene.rig.scene.size();
    let light = ExplicitMatrix::new(scene.matrix.clone(), size).expect("the matrix fits the scene");
    let mut devices = scene.rig.open(Box::new(light), None).expect("the scene can be seen");
    let black = Frame::filled(size, scene.rig.projector.channels, 0);
    // The pattern that was seen last, and when.
    let mut before: (Seen, u64) = (vec![(black.clone(), 1)], 0);
    while !shared.stops() {
        match triggers.recv_timeout(Duration::from_millis(20)) {
            Ok(()) => {}
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => return,
        }
        let (exposure, gain) = {
            let registers = shared.registers();
            (registers.float(EXPOSURE) / 1e6, 10_f64.powf(registers.float(GAIN) / 20.0))
        };
        let is_late =
            shared.stale.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1));
        let (ticks, open) = (shared.ticks(), Duration::from_secs_f64(exposure));
        let began = Instant::now();
        let seen = watch(open, || {
            let frame = look().unwrap_or_else(|| black.clone());
            shared.looks.fetch_add(1, Ordering::Relaxed);
            frame
        });
        let (seen, ticks) = if is_late.is_ok() { (before.0, before.1 + 1) } else { (seen, ticks) };
        let counts = see(&mut devices, &seen, exposure * gain);
        let late = began.elapsed().saturating_sub(open);
        shared.computing.fetch_add(late.as_nanos() as u64, Ordering::Relaxed);
        let mut registers = shared.registers();
        registers.exposing = false;
        shared.frames.fetch_add(1, Ordering::Relaxed);
        before = (seen, ticks);
        if !registers.acquiring {
            continue;
        }
        // The number 0 is reserved.
        registers.block = registers.block.checked_add(1).unwrap_or(1);
        let to = registers.destination();
        let sent = packets(&registers, &counts, scene, ticks);
        for packet in &sent.packets {
            shared.send(packet, to);
        }
        registers.sent.push_back(sent);
        if registers.sent.len() > KEPT {
            registers.sent.pop_front();
        }
    }
}

/// Looks at the pattern during an exposure, including its beginning and its end.
fn watch(open: Duration, mut look: impl FnMut() -> Frame) -> Seen {
    let began = Instant::now();
    let mut seen: Seen = vec![(look(), 1)];
    loop {
        let left = open.saturating_sub(began.elapsed());
        std::thread::sleep(left.min(LOOK));
        let frame = look();
        match seen.iter_mut().find(|(known, _)| *known == frame) {
            Some((_, times)) => *times += 1,
            None => seen.push((frame, 1)),
        }
        if left <= LOOK {
            return seen;
        }
    }
}

/// The counts of the whole sensor, as the mean over the patterns weighted by how often each was seen. The virtual rig that computes
/// them has simulated time, in which only the exposure passes.
fn see(devices: &mut Devices, seen: &Seen, exposure: f64) -> Vec<u16> {
    devices.camera.configure(exposure).expect("the sensor does what the registers do");
    let mut photo = |frame: &Frame| {
        devices.projector.restore(frame).expect("it fits the screen");
        devices.camera.capture().expect("it is never gone").expect("no frame is dropped").counts
    };
    if let [(only, _)] = &seen[..] {
        return photo(only);
    }
    let looks: usize = seen.iter().map(|(_, times)| times).sum();
    let mut sums = Vec::new();
    for (frame, times) in seen {
        let counts = photo(frame);
        sums.resize(counts.len(), 0.0);
        let share = *times as f64 / looks as f64;
        sums.iter_mut().zip(counts).for_each(|(sum, count)| *sum += share * f64::from(count));
    }
    sums.into_iter().map(|sum: f64| sum.round() as u16).collect()
}

/// The leader, the data and the trailer of a frame.
fn packets(registers: &Registers, counts: &[u16], scene: &Scene, ticks: u64) -> Sent {
    let format = registers.get(PIXEL_FORMAT);
    let sensor = scene.rig.camera_info();
    let [width, height, left, top] =
        [WIDTH, HEIGHT, OFFSET_X, OFFSET_Y].map(|register| registers.get(register) as usize);
    let (size, bits) = (sensor.resolution, sensor.bits);
    let most = f64::from((1_u32 << bits) - 1);
    // A receiver that does not switch gamma off gets nonlinear counts.
    let bend = |count: u16| match registers.get(GAMMA) {
        0 => count,
        _ => ((f64::from(count) / most).powf(1.0 / 2.2) * most) as u16,
    };
    let rows = (top..(top + height).min(size.height)).map(|y| y * size.width);
    let region: Vec<u16> = rows
        .flat_map(|row| &counts[row + left..row + (left + width).min(size.width)])
        .map(|&count| bend(count))
        .collect();
    let bytes = pixels::pack(format, bits, &region);
    let mut leader = vec![0, 0, 0, 1];
    leader.extend(ticks.to_be_bytes());
    for word in [format, width as u32, height as u32, left as u32, top as u32, 0] {
        leader.extend(word.to_be_bytes());
    }
    let mut trailer = vec![0, 0, 0, 1];
    trailer.extend((height as u32).to_be_bytes());
    // The headers of the network and of the stream are part of the packet size.
    let stride = (registers.get(PACKET_SIZE) & 0xFFFF) as usize - 36;
    let mut packets = vec![packet(registers.block, 1, 0, &leader)];
    for part in bytes.chunks(stride) {
        packets.push(packet(registers.block, 3, packets.len() as u32, part));
    }
    packets.push(packet(registers.block, 2, packets.len() as u32, &trailer));
    Sent { block: registers.block, packets }
}

fn packet(block: u16, format: u8, number: u32, content: &[u8]) -> Vec<u8> {
    let mut packet = vec![0, 0];
    packet.extend(block.to_be_bytes());
    packet.push(format);
    packet.extend(&number.to_be_bytes()[1..]);
    packet.extend(content);
    packet
}
