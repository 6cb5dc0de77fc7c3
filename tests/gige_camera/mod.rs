//! A GigE Vision camera on the loopback interface: the real protocol (control with privilege and heartbeat, stream with packets
//! that can be lost and sent again), a small GenICam description, and a simulated scene before its sensor.
//!
//! | part | file |
//! |---|---|
//! | registers, and who may write them | `registers` |
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

/// An address of this process's own: the same tests may run at the same time from another folder.
pub fn own_address(last: u8) -> Ipv4Addr {
    let [_, _, high, low] = std::process::id().to_be_bytes();
    // Addresses that begin with 127.0 are those of other tests.
    Ipv4Addr::new(127, 16 + high % 224, low, last)
}

/// What stands before the camera.
#[derive(Clone)]
pub struct Scene {
    /// The devices' imperfections; its camera's pixels and bits are the sensor's.
    pub rig: VirtualRig,
    pub matrix: Csr,
}

/// A camera that answers at an address, until it is stopped or dropped.
pub struct GigeCamera {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

/// What the threads share.
struct Shared {
    registers: Mutex<Registers>,
    stream: UdpSocket,
    stop: AtomicBool,
    /// Chance that a packet is lost, in millionths, and what decides.
    loss: AtomicU64,
    chance: Mutex<Pcg64>,
    /// Frames to come that were exposed at the trigger before.
    stale: AtomicU32,
    lost: AtomicU64,
    looks: AtomicU64,
    frames: AtomicU64,
    /// Nanoseconds from the end of an exposure to its counts.
    computing: AtomicU64,
    /// Since it was switched on: its clock.
    began: Instant,
}

impl GigeCamera {
    /// Switches it on. What the projector shows is told by `look`, again and again while a frame is exposed; nothing: black.
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

    /// Loses each packet with this chance from now on, those sent again included.
    pub fn lose(&self, chance: f64) {
        self.shared.loss.store((1e6 * chance) as u64, Ordering::Relaxed);
    }

    /// Packets lost so far.
    pub fn lost(&self) -> u64 {
        self.shared.lost.load(Ordering::Relaxed)
    }

    /// Looks at the pattern so far: one at the beginning of an exposure, one at its end, and some between.
    pub fn looks(&self) -> u64 {
        self.shared.looks.load(Ordering::Relaxed)
    }

    /// Seconds from the end of an exposure to its counts, of all frames: looking and computing, which a real camera need not do.
    pub fn computing(&self) -> f64 {
        1e-9 * self.shared.computing.load(Ordering::Relaxed) as f64
    }

    /// Frames exposed so far.
    pub fn frames(&self) -> u64 {
        self.shared.frames.load(Ordering::Relaxed)
    }

    /// Answers the next triggers with what was exposed at the trigger before, as a camera does whose queue was not empty.
    pub fn be_late(&self, frames: u32) {
        self.shared.stale.store(frames, Ordering::Relaxed);
    }
}

impl GigeCamera {
    /// Switches it off, as if its power failed: nobody is told.
    pub fn stop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let ended = thread.join();
            // A panic of its own is the test's.
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

    /// Nanoseconds of its clock.
    fn ticks(&self) -> u64 {
        self.began.elapsed().as_nanos() as u64
    }

    /// Sends a packet of the stream, or loses it.
    fn send(&self, packet: &[u8], to: SocketAddr) {
        let loss = self.loss.load(Ordering::Relaxed);
        let chance =
            || self.chance.lock().expect("no thread fails while it decides").random_range(0..1_000_000);
        if loss > 0 && chance() < loss {
            self.lost.fetch_add(1, Ordering::Relaxed);
            return;
        }
        // A receiver that is gone is no fault of the camera.
        let _ = self.stream.send_to(packet, to);
    }
}
