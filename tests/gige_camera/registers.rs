//! The camera's registers: those that GigE Vision defines, and the features of `camera.xml`.

use std::collections::VecDeque;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};

use krylux::image::Resolution;

use super::pixels;

const XML: &str = include_str!("camera.xml");
const XML_AT: usize = 0x1_0000;
const END: usize = 0x2_1000;

pub const HEARTBEAT: u32 = 0x0938;
pub const TIMESTAMP_CONTROL: u32 = 0x0944;
pub const PRIVILEGE: u32 = 0x0A00;
pub const PACKET_SIZE: u32 = 0x0D04;
pub const WIDTH: u32 = 0x2_0000;
pub const HEIGHT: u32 = 0x2_0004;
pub const OFFSET_X: u32 = 0x2_0008;
pub const OFFSET_Y: u32 = 0x2_000C;
pub const PIXEL_FORMAT: u32 = 0x2_0010;
pub const EXPOSURE: u32 = 0x2_0020;
pub const GAIN: u32 = 0x2_0028;
pub const START: u32 = 0x2_0040;
pub const STOP: u32 = 0x2_0044;
pub const TRIGGER: u32 = 0x2_0048;
const PAYLOAD: u32 = 0x2_004C;
const MOST_WIDTH: u32 = 0x2_0050;
const MOST_HEIGHT: u32 = 0x2_0054;
pub const GAMMA: u32 = 0x2_0058;

/// The packets of the last frames, which may be requested again.
pub struct Sent {
    pub block: u16,
    pub packets: Vec<Vec<u8>>,
}

pub struct Registers {
    memory: Vec<u8>,
    /// The program that controls the camera, and when it was last heard.
    pub owner: Option<(SocketAddr, Instant)>,
    pub acquiring: bool,
    pub exposing: bool,
    pub block: u16,
    pub sent: VecDeque<Sent>,
}

impl Registers {
    pub fn new(address: Ipv4Addr, sensor: Resolution, bits: u32) -> Self {
        let memory = vec![0; END];
        let mut registers =
            Self { memory, owner: None, acquiring: false, exposing: false, block: 0, sent: VecDeque::new() };
        for (at, value) in [
            (0x0000, 0x0001_0002),
            (0x0004, 0x8000_0001),
            (0x0008, 0x0000_6B72),
            (0x000C, 0x796C_7578),
            (0x0010, 0x0000_0007),
            (0x0014, 0x0000_0006),
            (0x0024, u32::from(address)),
            (0x0034, 0xFF00_0000),
            (0x0904, 1),
            // The capabilities: writing memory, and sending packets again.
            (0x0934, 0x0000_0006),
            (HEARTBEAT, 3000),
            (0x093C, 0),
            (0x0940, 1_000_000_000),
            (PACKET_SIZE, 1500),
            (WIDTH, sensor.width as u32),
            (HEIGHT, sensor.height as u32),
            (MOST_WIDTH, sensor.width as u32),
            (MOST_HEIGHT, sensor.height as u32),
            (PIXEL_FORMAT, pixels::gray(bits)),
            // Many cameras have this setting when they are switched on.
            (GAMMA, 1),
        ] {
            registers.set(at, value);
        }
        for (at, text) in [(0x0048, "krylux"), (0x0068, "Loopback"), (0x0088, "1"), (0x00D8, "1")] {
            registers.put(at, text.as_bytes());
        }
        let xml = XML.replace("PIXEL_FORMATS", pixels::entries().trim_end());
        let url = format!("Local:camera.xml;{XML_AT:x};{:x}", xml.len());
        registers.put(0x0200, url.as_bytes());
        registers.put(XML_AT, xml.as_bytes());
        registers.put(EXPOSURE as usize, &10_000_f64.to_be_bytes());
        registers.update();
        registers
    }

    /// Replaces the description by another one, behind the registers. `url` says where it is; `None`: the truth.
    pub fn describe(&mut self, xml: &str, url: Option<&str>) {
        self.memory.truncate(END);
        self.memory.extend(xml.as_bytes());
        let truth = format!("Local:camera.xml;{END:x};{:x}", xml.len());
        let mut text = [0; 512];
        let url = url.unwrap_or(&truth).as_bytes();
        text[..url.len()].copy_from_slice(url);
        self.put(0x0200, &text);
    }

    fn put(&mut self, at: usize, bytes: &[u8]) {
        self.memory[at..at + bytes.len()].copy_from_slice(bytes);
    }

    pub fn set(&mut self, at: u32, value: u32) {
        self.put(at as usize, &value.to_be_bytes());
    }

    pub fn get(&self, at: u32) -> u32 {
        let at = at as usize;
        u32::from_be_bytes(self.memory[at..at + 4].try_into().expect("four bytes"))
    }

    pub fn float(&self, at: u32) -> f64 {
        let at = at as usize;
        f64::from_be_bytes(self.memory[at..at + 8].try_into().expect("eight bytes"))
    }

    pub fn set_wide(&mut self, at: u32, value: u64) {
        self.put(at as usize, &value.to_be_bytes());
    }

    /// Reads memory. `None`: the address is outside of it.
    pub fn read(&self, at: u32, length: usize) -> Option<&[u8]> {
        self.memory.get(at as usize..at as usize + length)
    }

    /// Writes memory; returns whether the address is inside of it.
    pub fn write(&mut self, at: u32, bytes: &[u8]) -> bool {
        let fits = at as usize + bytes.len() <= END;
        if fits {
            self.put(at as usize, bytes);
            self.update();
        }
        fits
    }

    /// Updates the registers that depend on others.
    fn update(&mut self) {
        let pixels = self.get(WIDTH) * self.get(HEIGHT);
        self.set(PAYLOAD, pixels::bytes(self.get(PIXEL_FORMAT), pixels));
        // Exposures are whole microseconds.
        let exposure = self.float(EXPOSURE).round();
        self.put(EXPOSURE as usize, &exposure.to_be_bytes());
    }

    /// The address that the stream is sent to.
    pub fn destination(&self) -> SocketAddr {
        let port = self.get(0x0D00) as u16;
        SocketAddr::from((Ipv4Addr::from(self.get(0x0D18)), port))
    }

    /// Releases the camera if its owner was not heard during the heartbeat's timeout.
    pub fn expire(&mut self) {
        let patience = Duration::from_millis(self.get(HEARTBEAT).into());
        if self.owner.is_some_and(|(_, heard)| heard.elapsed() > patience) {
            self.owner = None;
            self.acquiring = false;
            self.set(PRIVILEGE, 0);
        }
    }
}
