//! Data that cameras send: acknowledgements on the control channel (GVCP), packets of the stream (GVSP), and their descriptions in XML.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use viva_genicam::Camera;
use viva_genicam::genapi::{GenApiError, NodeMap, RegisterIo};
use viva_genicam::gencp::decode_ack;
use viva_genicam::gige::{GvspContent, parse_chunks, parse_header, parse_packet_ref};

use crate::{LONGEST, Reader};

/// The file in which the child process finds its description.
const DESCRIPTION: &str = "KRYLUX_TEST_DESCRIPTION";

/// An acknowledgement: status, command, length, number and content.
fn acknowledged(status: u16, command: u16, content: &[u8]) -> Vec<u8> {
    let words = [status, command, content.len() as u16, 7].map(u16::to_be_bytes);
    [&words.concat(), content].concat()
}

pub fn gvcp() -> Reader {
    Reader {
        name: "gvcp",
        file: "datagram",
        seeds: |_| {
            vec![
                acknowledged(0, 0x0003, &[9; 248]),
                acknowledged(0, 0x0081, &[0, 0, 0, 1]),
                acknowledged(0, 0x0083, &[0, 0, 0, 1]),
                acknowledged(0, 0x0085, &[&[0, 0, 2, 0][..], &[65; 512]].concat()),
                acknowledged(0, 0x0087, &[0, 0, 0, 4]),
                acknowledged(0, 0x0089, &[0, 0, 1, 0]),
                acknowledged(0x8006, 0x0083, &[]),
            ]
        },
        read: |folder| {
            let bytes = datagram(folder);
            if let Ok(ack) = decode_ack(&bytes) {
                assert_eq!(ack.payload.len(), bytes.len() - 8, "the content ends where the datagram does");
            }
        },
    }
}

/// A packet of the stream: head and content. With `wide` numbers of 64 and 32 bits.
fn packet(wide: bool, format: u8, number: u32, content: &[u8]) -> Vec<u8> {
    let number = number.to_be_bytes();
    if wide {
        let head = [&[0, 0, 0, 0, 0x80 | format, 0, 0, 0][..], &5_u64.to_be_bytes(), &number];
        return [&head.concat(), content].concat();
    }
    [&[0, 0, 0, 5, format], &number[1..], content].concat()
}

/// Leader, payload with chunks, and trailer of a frame.
fn frame(wide: bool) -> [Vec<u8>; 3] {
    let mut leader = [&[0, 0, 0, 1][..], &123_456_u64.to_be_bytes()].concat();
    for word in [0x0108_0001_u32, 8, 4, 0, 0, 0] {
        leader.extend(word.to_be_bytes());
    }
    let chunks = [
        &[1; 32][..],
        &7_u32.to_be_bytes(),
        &32_u32.to_be_bytes(),
        &[2; 4],
        &8_u32.to_be_bytes(),
        &4_u32.to_be_bytes(),
    ];
    let trailer = [&[0, 0, 0, 1][..], &4_u32.to_be_bytes()].concat();
    [packet(wide, 1, 0, &leader), packet(wide, 3, 1, &chunks.concat()), packet(wide, 2, 2, &trailer)]
}

pub fn gvsp() -> Reader {
    Reader {
        name: "gvsp",
        file: "datagram",
        seeds: |_| [false, true].into_iter().flat_map(frame).collect(),
        read: |folder| {
            let bytes = datagram(folder);
            let _ = parse_header(&bytes);
            if let Ok(packet) = parse_packet_ref(&bytes)
                && let GvspContent::Payload(content) = packet.content
            {
                assert_eq!(content.len() + packet.header.header_len, bytes.len(), "nothing is lost");
                let _ = parse_chunks(content);
            }
        },
    }
}

fn datagram(folder: &Path) -> Vec<u8> {
    std::fs::read(folder.join("datagram")).expect("it was just written")
}

/// A camera whose registers hold the lower bytes of their addresses.
struct Registers;

impl RegisterIo for Registers {
    fn read(&self, address: u64, length: usize) -> Result<Vec<u8>, GenApiError> {
        // No transport reads more at a time; the content of what it reads is the camera's choice.
        if length > 1 << 16 {
            return Err(GenApiError::Io("too long".into()));
        }
        Ok((0..length).map(|at| (address as u8).wrapping_add(at as u8)).collect())
    }

    fn write(&self, _: u64, _: &[u8]) -> Result<(), GenApiError> {
        Ok(())
    }
}

/// A description is read as krylux reads it, in a process of its own with bounded memory, whose stack a hostile description may
/// overflow. It may not panic, and it ends in time.
pub fn camera_xml() -> Reader {
    Reader {
        name: "camera_xml",
        file: "camera.xml",
        seeds: |_| {
            let xml = |path: &str| {
                let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
                std::fs::read(path).expect("the description of a simulated camera is shipped")
            };
            vec![xml("tests/gige_camera/camera.xml"), xml("src/rig/usb3/simulated.xml")]
        },
        read: |folder| {
            let mut child = Command::new("sh")
                .args(["-c", "ulimit -v 1048576; ulimit -c 0; exec \"$0\" \"$@\""])
                .arg(std::env::current_exe().expect("the test runs"))
                .args(["cameras::child_that_reads_a_description", "--exact", "--ignored", "--nocapture"])
                .env(DESCRIPTION, folder.join("camera.xml"))
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .expect("there is a shell");
            let began = Instant::now();
            let ended = loop {
                if let Some(status) = child.try_wait().expect("it was started") {
                    break Some(status);
                }
                if began.elapsed() > LONGEST {
                    break None;
                }
                std::thread::sleep(Duration::from_millis(1));
            };
            let Some(status) = ended else {
                child.kill().expect("it lives");
                child.wait().expect("it ends");
                panic!("a description is read for more than {LONGEST:?}");
            };
            // Without a code, a signal has ended it: an overflow of the stack, or of the memory that it may have.
            assert!(matches!(status.code(), Some(0) | None), "the reader of descriptions fails: {status}");
        },
    }
}

#[test]
#[ignore = "the other half of `camera_xml`, run by it in a process with bounded memory"]
fn child_that_reads_a_description() {
    let path = std::env::var_os(DESCRIPTION).expect("its parent says where");
    let bytes = std::fs::read(path).expect("it was just written");
    let text = String::from_utf8_lossy(&bytes);
    let Ok(model) = viva_genapi_xml::parse(&text) else { return };
    let Ok(nodes) = NodeMap::try_from_xml(model) else { return };
    let names: Vec<String> = nodes.node_names().map(str::to_owned).collect();
    let camera = Camera::new(Registers, nodes);
    for name in names.iter().map(String::as_str).chain(["WidthMax", "PixelFormat", "ExposureTime", "Gain"]) {
        let _ = camera.feature_state(name);
        let _ = camera.get_integer(name);
        let _ = camera.get_float(name);
    }
}
