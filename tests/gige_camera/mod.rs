//! A simulated GigE Vision camera on the loopback interface. It has the real protocol (control with privilege and heartbeat, a stream
//! whose packets can be lost and sent again), a small GenICam description, and a simulated scene in front of its sensor.
//!
//! | part | file |
//! |---|---|
//! | registers and the privilege to write them | `registers` |
//! | commands on the control channel | `control` |
//! | exposures and packets of frames | `stream` |
//! | counts as bytes of a pixel format | `pixels` |
#![allow(dead_code, reason = "each test binary uses its own part of this")]

mod control;
mod pixels;
mod registers;
mod stream;

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use krylux::rig::{Frame, VirtualRig};
use krylux::sparse::Csr;

use registers::Registers;

/// The port of the control channel.
const PORT: u16 = 3956;

/// An address that only this process uses: the same tests may run at the same time from another folder.
pub fn own_address(last: u8) -> Ipv4Addr {
    let [_, _, high, low] = std::process::id().to_be_bytes();
    // Other tests use addresses that begin with 127.0.
    Ipv4Addr::new(127, 16 + high % 224, low, last)
}

/// The scene in front of the camera.
#[derive(Clone)]
pub struct Scene {
    /// The imperfections of the devices; the pixels and bits of its camera are those of the sensor.
    pub rig: VirtualRig,
    pub matrix: Csr,
}

/// A camera that answers at an address, until it is stopped or dropped.
pub struct GigeCamera {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

/// The state that the threads share.
struct Shared {
    registers: Mutex<Registers>,
    stream: UdpSocket,
    stop: AtomicBool,
    /// The probability that a packet is lost, in millionths, and the random generator.
    loss: AtomicU64,
    /// The packet of each frame that always gets lost; none is the largest number.
    hole: AtomicU32,
    chance: Mutex<Pcg64>,
    /// The number of coming frames that will have been exposed at the previous trigger.
    stale: AtomicU32,
    lost: AtomicU64,
    looks: AtomicU64,
    frames: AtomicU64,
    /// Nanoseconds from the end of an exposure to its counts.
    computing: AtomicU64,
    /// When the camera was switched on, which is the origin of its clock.
    began: Instant,
}

impl GigeCamera {
    /// Switches the camera on. `look` returns the frame on screen, and is called again and again during an exposure; `None` is black.
    pub fn start(
        address: Ipv4Addr,
        scene: Scene,
        look: impl FnMut() -> Option<Frame> + Send + 'static,
    ) -> Self {
        let control = UdpSocket::bind(SocketAddr::from((address, PORT))).expect("one camera at each address");
        control.set_read_timeout(Some(Duration::from_millis(20))).expect("a time to stop");
        let sensor = scene.rig.camera_info();
        let shared = Arc::new(Shared {
            registers: Mutex::new(Registers::new(address, sensor.resolution, sensor.bits)),
            stream: UdpSocket::bind(SocketAddr::from((address, 0))).expect("a port is free"),
            stop: AtomicBool::new(false),
            loss: AtomicU64::new(0),
            hole: AtomicU32::new(u32::MAX),
            chance: Mutex::new(Pcg64::seed_from_u64(7)),
            stale: AtomicU32::new(0),
            lost: AtomicU64::new(0),
            looks: AtomicU64::new(0),
            frames: AtomicU64::new(0),
            computing: AtomicU64::new(0),
            began: Instant::now(),
        });
        let (triggers, triggered) = channel();
        let both = [Arc::clone(&shared), Arc::clone(&shared)];
        let [of_control, of_stream] = both;
        let threads = vec![
            std::thread::spawn(move || control::serve(&of_control, &control, &triggers)),
            std::thread::spawn(move || stream::serve(&of_stream, &triggered, &scene, look)),
        ];
        Self { shared, threads }
    }

    /// From now on, the camera says this of itself, `url` bytes from where it says ([`Registers::describe`]).
    pub fn describe(&self, xml: &str, url: Option<&str>) {
        self.shared.registers.lock().expect("nobody fails").describe(xml, url);
    }

    /// From now on, loses each packet with this probability, including those that are sent again.
    pub fn lose(&self, chance: f64) {
        self.shared.loss.store((1e6 * chance) as u64, Ordering::Relaxed);
    }

    /// From now on, loses the packet with this number of each frame, also when it is sent again.
    pub fn always_lose(&self, packet: u32) {
        self.shared.hole.store(packet, Ordering::Relaxed);
    }

    /// The number of packets lost so far.
    pub fn lost(&self) -> u64 {
        self.shared.lost.load(Ordering::Relaxed)
    }

    /// The number of looks at the pattern so far: at the beginning and the end of each exposure, and some in between.
    pub fn looks(&self) -> u64 {
        self.shared.looks.load(Ordering::Relaxed)
    }

    /// Seconds from the end of exposures to their counts, for all frames together: the time of the simulation, which a real camera does
    /// not take.
    pub fn computing(&self) -> f64 {
        1e-9 * self.shared.computing.load(Ordering::Relaxed) as f64
    }

    /// The number of frames exposed so far.
    pub fn frames(&self) -> u64 {
        self.shared.frames.load(Ordering::Relaxed)
    }

    /// Answers the next triggers with frames of the previous trigger, as a camera does whose queue was not empty.
    pub fn be_late(&self, frames: u32) {
        self.shared.stale.store(frames, Ordering::Relaxed);
    }
}

impl GigeCamera {
    /// Switches the camera off without notice, as a power failure does.
    pub fn stop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let ended = thread.join();
            // A panic in the camera fails the test.
            if ended.is_err() && !std::thread::panicking() {
                panic!("the camera failed");
            }
        }
    }
}

impl Drop for GigeCamera {
    fn drop(&mut self) {
        self.stop();
    }
}

impl Shared {
    fn registers(&self) -> MutexGuard<'_, Registers> {
        self.registers.lock().expect("no thread fails while it holds them")
    }

    fn stops(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// The time of the camera's clock in nanoseconds.
    fn ticks(&self) -> u64 {
        self.began.elapsed().as_nanos() as u64
    }

    /// Sends a packet of the stream, or loses it.
    fn send(&self, packet: &[u8], to: SocketAddr) {
        let loss = self.loss.load(Ordering::Relaxed);
        let chance =
            || self.chance.lock().expect("no thread fails while it decides").random_range(0..1_000_000);
        let number = u32::from_be_bytes([0, packet[5], packet[6], packet[7]]);
        if number == self.hole.load(Ordering::Relaxed) || (loss > 0 && chance() < loss) {
            self.lost.fetch_add(1, Ordering::Relaxed);
            return;
        }
        // A receiver that has ended is not an error of the camera.
        let _ = self.stream.send_to(packet, to);
    }
}
