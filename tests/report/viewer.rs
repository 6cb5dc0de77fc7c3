//! Images in the viewer tev: what arrives there, and what happens where nobody listens or nobody reads.

#![allow(clippy::panic, reason = "a failed test panics")]

use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use krylux::image::Resolution;
use krylux::report::viewer::{Plane, Viewer, packet};

const SIZE: Resolution = Resolution { width: 3, height: 2 };

/// A packet as tev reads it.
#[derive(Debug, PartialEq)]
enum Packet {
    Close { name: String },
    Create { name: String, size: [i32; 2], channels: Vec<String> },
    Update { name: String, channels: Vec<String>, area: [i32; 4], layout: Vec<[i64; 2]>, values: Vec<f32> },
}

struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (field, rest) = self.0.split_first_chunk::<N>().expect("the packet is long enough");
        self.0 = rest;
        *field
    }

    fn int(&mut self) -> i32 {
        i32::from_le_bytes(self.take())
    }

    fn long(&mut self) -> i64 {
        i64::from_le_bytes(self.take())
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|&byte| byte == 0).expect("texts end");
        let text = String::from_utf8(self.0[..end].to_vec()).expect("names are UTF-8");
        self.0 = &self.0[end + 1..];
        text
    }
}

fn decode(packet: &[u8]) -> Packet {
    let mut fields = Fields(packet);
    assert_eq!(u32::from_le_bytes(fields.take()) as usize, packet.len(), "the length counts itself");
    let [kind] = fields.take();
    let decoded = match kind {
        2 => Packet::Close { name: fields.text() },
        4 => {
            assert_eq!(fields.take(), [0], "the focus stays where it is");
            let (name, size) = (fields.text(), [fields.int(), fields.int()]);
            let channels = (0..fields.int()).map(|_| fields.text()).collect();
            Packet::Create { name, size, channels }
        }
        6 => {
            assert_eq!(fields.take(), [0], "the focus stays where it is");
            let name = fields.text();
            let channels: Vec<String> = (0..fields.int()).map(|_| fields.text()).collect();
            let area = [fields.int(), fields.int(), fields.int(), fields.int()];
            let offsets: Vec<i64> = channels.iter().map(|_| fields.long()).collect();
            let layout = offsets.into_iter().map(|offset| [offset, fields.long()]).collect();
            let mut values = Vec::new();
            while !fields.0.is_empty() {
                values.push(f32::from_le_bytes(fields.take()));
            }
            Packet::Update { name, channels, area, layout, values }
        }
        other => panic!("no packet of type {other} is known"),
    };
    assert!(fields.0.is_empty(), "nothing is left over");
    decoded
}

fn read_packet(stream: &mut TcpStream) -> Option<Packet> {
    let mut length = [0; 4];
    stream.read_exact(&mut length).ok()?;
    let mut packet = length.to_vec();
    packet.resize(u32::from_le_bytes(length) as usize, 0);
    stream.read_exact(&mut packet[4..]).expect("packets are whole");
    Some(decode(&packet))
}

fn read_all(mut stream: TcpStream) -> Vec<Packet> {
    std::iter::from_fn(|| read_packet(&mut stream)).collect()
}

fn listener() -> (TcpListener, String) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("some port is free");
    let address = listener.local_addr().expect("it is bound").to_string();
    (listener, address)
}

fn plane(name: &str, channel: usize, values: &[f32]) -> Plane {
    Plane { name: name.into(), size: SIZE, channels: &["R", "G", "B"], channel, values: values.to_vec() }
}

#[test]
fn an_image_is_made_once_and_then_updated_channel_by_channel() {
    let (listener, address) = listener();
    let viewer = Viewer::new(&address, |error| panic!("it listens: {error}"));
    let (mut stream, _) = listener.accept().expect("it calls");
    let values = [0.5, -1.0, 2.0, 3.0, 4.0, 1e-9];
    viewer.show(plane("carton photo", 1, &values));
    let update = |channel: &str, values: &[f32]| Packet::Update {
        name: "carton photo".into(),
        channels: vec![channel.into()],
        area: [0, 0, 3, 2],
        layout: vec![[0, 1]],
        values: values.to_vec(),
    };
    let channels = ["R", "G", "B"].map(String::from).to_vec();
    let name = || "carton photo".to_owned();
    let mut next = || read_packet(&mut stream).expect("it talks");
    assert_eq!(next(), Packet::Close { name: name() });
    assert_eq!(next(), Packet::Create { name: name(), size: [3, 2], channels });
    assert_eq!(next(), update("G", &values));
    viewer.show(plane("carton photo", 2, &[0.0; 6]));
    assert_eq!(next(), update("B", &[0.0; 6]));
    drop(viewer);
    assert_eq!(read_packet(&mut stream), None);
}

#[test]
fn what_a_run_shows_last_arrives_before_it_ends() {
    let (listener, address) = listener();
    let reader = std::thread::spawn(move || read_all(listener.accept().expect("it calls").0));
    let viewer = Viewer::new(&address, |error| panic!("it listens: {error}"));
    for photo in 0..200_u16 {
        viewer.show(plane("photo", 0, &[f32::from(photo); 6]));
    }
    drop(viewer);
    let packets = reader.join().expect("it reads");
    // How many came before it depends on who was faster.
    let Some(Packet::Update { values, .. }) = packets.last() else { panic!("{packets:?}") };
    assert_eq!(values, &[199.0; 6]);
}

#[test]
fn a_viewer_that_does_not_read_keeps_nobody_waiting_and_gets_the_newest() {
    let (listener, address) = listener();
    let viewer = Viewer::new(&address, |error| panic!("it listens: {error}"));
    let (mut stream, _) = listener.accept().expect("it calls");
    // 4 MiB an image: the system's buffers hold no more than a few of 24.
    let size = Resolution::new(1024, 1024);
    let start = Instant::now();
    for photo in 1..=24_u16 {
        let values = vec![f32::from(photo); size.pixels()];
        viewer.show(Plane { name: "photo".into(), size, channels: &["Y"], channel: 0, values });
        // Time to send it, if only somebody read.
        std::thread::sleep(Duration::from_millis(5));
    }
    // Had each waited until it was sent, this would have ended in the viewer's patience of five seconds.
    assert!(start.elapsed() < Duration::from_secs(4), "{:?}", start.elapsed());
    let reader = std::thread::spawn(move || {
        let mut seen = Vec::new();
        while let Some(packet) = read_packet(&mut stream) {
            if let Packet::Update { values, .. } = packet {
                seen.push(values[0]);
            }
        }
        seen
    });
    // The rest is sent, now that somebody reads.
    std::thread::sleep(Duration::from_secs(2));
    drop(viewer);
    let seen = reader.join().expect("it reads");
    assert!(seen.len() < 24, "nothing was left out: the viewer was waited for");
    assert!(seen.is_sorted(), "{seen:?}");
    assert_eq!(seen.last(), Some(&24.0), "the newest is there in the end: {seen:?}");
}

#[test]
fn nobody_listening_is_a_warning_once() {
    let (listener, address) = listener();
    drop(listener);
    let (sender, warnings) = channel();
    let viewer = Viewer::new(&address, move |error| {
        // Nobody asks any more when the test is over.
        let _ = sender.send(error.to_string());
    });
    for photo in 0..10_u16 {
        viewer.show(plane("photo", 0, &[f32::from(photo); 6]));
    }
    drop(viewer);
    assert_eq!(warnings.iter().count(), 1);
}

#[test]
fn a_name_cannot_end_early() {
    let packet = packet::create_image("a\0b", SIZE, &["Y"]);
    assert_eq!(
        decode(&packet),
        Packet::Create { name: "ab".into(), size: [3, 2], channels: vec!["Y".into()] }
    );
    assert_eq!(decode(&packet::close_image("a")), Packet::Close { name: "a".into() });
}
