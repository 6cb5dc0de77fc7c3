//! Tests with a simulated USB3 Vision camera, which replaces the USB transfer. It has the camera's registers, and sends a frame for each
//! trigger. The layouts follow GenCP (1.2, tables 4 to 12 and 15) and `viva_u3v::registers`.

#![allow(clippy::panic, reason = "a failed test panics")]

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use viva_genicam::u3v::registers::{abrm, capability, sbrm, sirm, u3vcp_capability};
use viva_genicam::u3v::{U3vDevice, U3vDeviceInfo, U3vError, UsbTransfer};
use viva_genicam::{Camera as Described, U3vRegisterIo, open_u3v_device};

use crate::error::Result;
use crate::image::Resolution;
use crate::rig::genicam::Triggered;
use crate::rig::usb3::{OnUsb, Port, choose};
use crate::rig::{Abilities, Camera, Colour, GenicamSpec, PixelFormat, WallClock};

const XML: &[u8] = include_bytes!("simulated.xml");

const SBRM: u64 = 0x800;
const SIRM: u64 = 0x900;
const MANIFEST: u64 = 0x1000;
const WIDTH: u64 = 0x4000;
const HEIGHT: u64 = 0x4004;
const FORMAT: u64 = 0x4008;
const EXPOSURE: u64 = 0x4010;
const TRIGGER: u64 = 0x4038;
const LATCH: u64 = 0x403C;
const LATCHED: u64 = 0x4040;
const XML_AT: u64 = 0x1_0000;

const CONTROL_OUT: u8 = 0x01;
const CONTROL_IN: u8 = 0x81;
const STREAM_IN: u8 = 0x82;

struct SimulatedCamera {
    began: Instant,
    state: Mutex<State>,
}

struct State {
    memory: Vec<u8>,
    answers: VecDeque<Vec<u8>>,
    /// Leaders, payloads and trailers that have not been read yet.
    stream: VecDeque<Vec<u8>>,
    /// The packets to send late. `None`: no packet is late.
    held: Option<Vec<Vec<u8>>>,
    frames: u64,
}

fn count(site: usize) -> u16 {
    (site * 37 % 4096) as u16
}

impl State {
    fn put(&mut self, at: u64, bytes: &[u8]) {
        self.memory[at as usize..][..bytes.len()].copy_from_slice(bytes);
    }

    fn word(&self, at: u64) -> u32 {
        let bytes = self.memory[at as usize..].first_chunk().expect("it lies within");
        u32::from_le_bytes(*bytes)
    }

    /// The bytes of a frame in the current format: Mono12p with two counts in three bytes, or the upper 8 bits of each count.
    fn pixels(&self) -> Vec<u8> {
        let counts = (0..(self.word(WIDTH) * self.word(HEIGHT)) as usize).map(count);
        if self.word(FORMAT) == 0x0108_0009 {
            return counts.map(|count| (count >> 4) as u8).collect();
        }
        let counts: Vec<u16> = counts.collect();
        counts
            .as_chunks::<2>()
            .0
            .iter()
            .flat_map(|[a, b]| [*a as u8, (a >> 8 | (b & 0xF) << 4) as u8, (b >> 4) as u8])
            .collect()
    }

    fn follow(&mut self, at: u64, ticks: u64) {
        let payload = self.pixels();
        self.put(SIRM + sirm::REQUIRED_PAYLOAD_SIZE, &(payload.len() as u64).to_le_bytes());
        match at {
            LATCH => self.put(LATCHED, &ticks.to_le_bytes()),
            TRIGGER if self.word(SIRM + sirm::CONTROL) == 1 => {
                let id = self.frames.to_le_bytes();
                let mut leader = [&b"U3VL\0\0\x32\0"[..], &id, &[0, 0, 1, 0], &ticks.to_le_bytes()].concat();
                for word in [self.word(FORMAT), self.word(WIDTH), self.word(HEIGHT), 0, 0] {
                    leader.extend(word.to_le_bytes());
                }
                leader.extend([0, 0]);
                let size = (payload.len() as u64).to_le_bytes();
                let trailer = [&b"U3VT\0\0\x1C\0"[..], &id, &[0; 4], &size].concat();
                match &mut self.held {
                    Some(held) => held.extend([leader, payload, trailer]),
                    None => self.stream.extend([leader, payload, trailer]),
                }
                self.frames += 1;
            }
            _ => {}
        }
    }
}

impl SimulatedCamera {
    fn new() -> Arc<Self> {
        let state = State {
            memory: vec![0; XML_AT as usize + XML.len()],
            answers: VecDeque::new(),
            stream: VecDeque::new(),
            held: None,
            frames: 0,
        };
        let simulated = Arc::new(Self { began: Instant::now(), state: Mutex::new(state) });
        let mut state = simulated.state();
        let (word, wide) =
            (|value: u32| value.to_le_bytes().to_vec(), |value: u64| value.to_le_bytes().to_vec());
        for (at, bytes) in [
            (abrm::GENCP_VERSION, word(0x0001_0002)),
            (abrm::SERIAL_NUMBER, b"A1".to_vec()),
            (abrm::DEVICE_CAPABILITY, wide(capability::SBRM)),
            (abrm::MAX_DEVICE_RESPONSE_TIME, word(100)),
            (abrm::MANIFEST_TABLE_ADDRESS, wide(MANIFEST)),
            (abrm::SBRM_ADDRESS, wide(SBRM)),
            (SBRM + sbrm::U3VCP_CAPABILITY, wide(u3vcp_capability::SIRM_AVAILABLE)),
            (SBRM + sbrm::MAX_CMD_TRANSFER, word(1024)),
            (SBRM + sbrm::MAX_ACK_TRANSFER, word(1024)),
            (SBRM + sbrm::NUM_STREAM_CHANNELS, word(1)),
            (SBRM + sbrm::SIRM_ADDRESS, wide(SIRM)),
            (SBRM + sbrm::CURRENT_SPEED, word(8)),
            (SIRM + sirm::REQUIRED_LEADER_SIZE, word(52)),
            (SIRM + sirm::REQUIRED_TRAILER_SIZE, word(32)),
            (MANIFEST, wide(1)),
            (MANIFEST + 16, wide(XML_AT)),
            (MANIFEST + 24, wide(XML.len() as u64)),
            (XML_AT, XML.to_vec()),
            (WIDTH, word(64)),
            (HEIGHT, word(48)),
            (FORMAT, word(0x010C_0047)),
            (EXPOSURE, 10_000_f64.to_le_bytes().to_vec()),
        ] {
            state.put(at, &bytes);
        }
        drop(state);
        simulated
    }

    fn without_time() -> Arc<Self> {
        let simulated = Self::new();
        let xml = std::str::from_utf8(XML).expect("XML is text").replace("TimestampLatch", "SomethingLatch");
        simulated.state().put(XML_AT, xml.as_bytes());
        simulated
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().expect("no thread panics while it holds the state")
    }

    fn is_streaming(&self) -> bool {
        self.state().word(SIRM + sirm::CONTROL) == 1
    }
}

impl UsbTransfer for SimulatedCamera {
    fn bulk_write(&self, endpoint: u8, data: &[u8], _: Duration) -> std::result::Result<usize, U3vError> {
        assert_eq!((endpoint, &data[..4]), (CONTROL_OUT, &b"U3VC"[..]));
        let half = |at: usize| u16::from_le_bytes([data[at], data[at + 1]]);
        let (command, number, body) = (half(6), half(10), &data[12..]);
        let at = u64::from_le_bytes(*body.first_chunk().expect("both commands begin with an address"));
        let mut state = self.state();
        let answer = match command {
            0x0800 => state.memory[at as usize..][..usize::from(half(22))].to_vec(),
            0x0802 => {
                state.put(at, &body[8..]);
                state.follow(at, self.began.elapsed().as_nanos() as u64);
                Vec::new()
            }
            other => panic!("command {other:#x} is not simulated"),
        };
        let head = [0_u16, command + 1, answer.len() as u16, number].map(u16::to_le_bytes);
        state.answers.push_back([&b"U3VC"[..], &head.concat(), &answer].concat());
        Ok(data.len())
    }

    fn bulk_read(
        &self,
        endpoint: u8,
        buffer: &mut [u8],
        timeout: Duration,
    ) -> std::result::Result<usize, U3vError> {
        let began = Instant::now();
        loop {
            let mut state = self.state();
            let queue = match endpoint {
                CONTROL_IN => &mut state.answers,
                STREAM_IN => &mut state.stream,
                other => panic!("there is no endpoint {other:#x}"),
            };
            if let Some(mut bytes) = queue.pop_front() {
                // Bytes that do not fit the buffer remain for the next transfer.
                let rest = bytes.split_off(bytes.len().min(buffer.len()));
                if !rest.is_empty() {
                    queue.push_front(rest);
                }
                buffer[..bytes.len()].copy_from_slice(&bytes);
                return Ok(bytes.len());
            }
            drop(state);
            if began.elapsed() >= timeout {
                return Err(U3vError::Timeout);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Port for Arc<SimulatedCamera> {
    type Wire = SimulatedCamera;

    fn place(&self) -> String {
        "on a simulated bus".into()
    }

    fn open(&self) -> Result<Described<U3vRegisterIo<SimulatedCamera>>> {
        let device = U3vDevice::open(Arc::clone(self), CONTROL_IN, CONTROL_OUT, Some(STREAM_IN), None);
        Ok(open_u3v_device(device.expect("its registers are whole")).expect("its description is whole").0)
    }
}

fn spec(pixel_format: PixelFormat) -> GenicamSpec {
    GenicamSpec { pixel_format, colour: Colour::Luma, timeout: 60.0, ..GenicamSpec::usb3(64, 48) }
}

fn open(
    simulated: &Arc<SimulatedCamera>,
    spec: &GenicamSpec,
    clock: WallClock,
) -> Result<Triggered<OnUsb<Arc<SimulatedCamera>>>> {
    Triggered::start(OnUsb(Arc::clone(simulated)), spec, clock, 41)
}

#[test]
fn frames_come_by_triggers_with_their_counts_numbers_and_times() {
    let (simulated, clock) = (SimulatedCamera::new(), WallClock::starting_at(100.0));
    let mut gray = spec(PixelFormat::Mono12p);
    gray.colour = Colour::default();
    let mut camera = open(&simulated, &gray, clock).expect("it can do that");
    assert_eq!(camera.configure(0.02).expect("within range"), 0.02);
    let expected: Vec<u16> = (0..64 * 48).map(count).collect();
    for number in 42..46 {
        let before = clock.seconds();
        let found = camera.capture().expect("it is there").expect("it comes");
        assert_eq!((found.resolution, found.channels, found.id), (Resolution::new(64, 48), 1, number));
        assert_eq!(found.counts, expected);
        assert_eq!(found.exposure, 0.02);
        assert!(found.started >= before && found.started <= clock.seconds(), "{}", found.started);
    }
    // A reopened camera restarts its numbers, but the rig's numbers continue.
    camera.restart().expect("it is there");
    assert!(camera.capture().expect("it is there").expect("it comes").id > 45);
    assert!(simulated.is_streaming());
    drop(camera);
    assert!(!simulated.is_streaming(), "the camera is released");
}

#[test]
fn a_colour_cameras_cells_become_pixels() {
    let simulated = SimulatedCamera::new();
    let spec = GenicamSpec { size: [8, 4], ..spec(PixelFormat::BayerRG8) };
    let mut camera = open(&simulated, &spec, WallClock::starting_at(0.0)).expect("it can do that");
    let found = camera.capture().expect("it is there").expect("it comes");
    let site = |x: usize, y: usize| count(y * 8 + x) >> 4;
    let cell = |x: usize, y: usize| site(x, y) + site(x + 1, y) + site(x, y + 1) + site(x + 1, y + 1);
    let expected: Vec<u16> = (0..8).map(|pixel| cell(pixel % 4 * 2, pixel / 4 * 2)).collect();
    assert_eq!(found.counts, expected);
}

#[test]
fn abilities_are_read_and_errors_name_limits() {
    let simulated = SimulatedCamera::new();
    let abilities = Abilities::of(&simulated.open().expect("it is there"));
    // The camera describes neither the size of its sensor nor a gain.
    assert_eq!(abilities.to_string(), "Mono12p, BayerRG8; exposures 0.00002 to 2 s");
    let refused = |spec: &GenicamSpec| match open(&simulated, spec, WallClock::starting_at(0.0)) {
        Ok(_) => panic!("it is refused"),
        Err(error) => error.to_string(),
    };
    let message = refused(&spec(PixelFormat::BayerGB12));
    assert!(
        message.contains("on a simulated bus has no pixel format BayerGB12")
            && message.contains("Mono12p, BayerRG8")
    );
    let message = refused(&GenicamSpec { size: [66, 48], ..spec(PixelFormat::BayerRG8) });
    assert!(message.contains("Width of the camera on a simulated bus is 2 to 64 in steps of 2"), "{message}");
}

#[test]
fn a_late_frame_is_not_taken_for_the_next_one_where_the_camera_does_not_tell_its_time() {
    let (simulated, clock) = (SimulatedCamera::without_time(), WallClock::starting_at(0.0));
    let spec = GenicamSpec { timeout: 2.0, ..spec(PixelFormat::Mono12p) };
    let mut camera = open(&simulated, &spec, clock).expect("it can do that");
    assert_eq!(camera.capture().expect("it is there").expect("it comes").id, 42);
    simulated.state().held = Some(Vec::new());
    assert_eq!(camera.capture().expect("it is there"), None, "frame 43 does not come in time");
    let mut state = simulated.state();
    let late = state.held.take().expect("it was held back");
    state.stream.extend(late);
    drop(state);
    // A busy machine may take some time to receive the late frame.
    std::thread::sleep(Duration::from_millis(500));
    let before = clock.seconds();
    let found = camera.capture().expect("it is there").expect("it comes");
    assert_eq!(found.id, 44, "43 is the frame of the trigger before");
    assert!(found.started >= before, "{} is before {before}", found.started);
}

fn device(serial: &str) -> U3vDeviceInfo {
    U3vDeviceInfo {
        bus: "1".into(),
        address: 4,
        vendor_id: 1,
        product_id: 2,
        serial: Some(serial.into()),
        manufacturer: None,
        model: None,
        speed: None,
    }
}

#[test]
fn a_camera_is_chosen_by_its_serial_number_or_because_it_is_the_only_one() {
    let both = || vec![device("A1"), device("B2")];
    let of = |devices, serial| choose(devices, serial).map(|device| device.serial);
    let refused = |devices, serial| of(devices, serial).expect_err("it is refused").to_string();
    assert_eq!(of(both(), Some("B2")).expect("it is there"), Some("B2".into()));
    assert_eq!(of(vec![device("A1")], None).expect("the only one"), Some("A1".into()));
    assert!(refused(both(), None).contains("give serial in [camera]: A1, B2"));
    assert!(refused(both(), Some("C3")).contains("no USB3 Vision camera has the serial number C3"));
    assert!(refused(both(), Some("C3")).contains("there are A1, B2"));
    assert!(refused(Vec::new(), None).contains("no USB3 Vision camera is plugged in"));
}
