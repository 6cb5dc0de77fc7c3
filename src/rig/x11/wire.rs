//! The messages between the projector and its helper process. Each is a JSON header and raw bytes, preceded by both lengths as
//! little-endian 32-bit numbers.

use std::io::{self, Read, Write};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::spec::X11Spec;
use crate::image::Resolution;

/// The longest header or payload that is accepted: a frame of 16384² pixels in colour.
const LONGEST: usize = 3 << 28;

/// A message to the helper.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Request {
    /// Open the window.
    Open(X11Spec),
    /// Show the levels that follow as payload, one byte each.
    Show { resolution: Resolution, channels: usize },
    /// Say whether the last frame has been on screen without interruption.
    Confirm,
}

/// A message from the helper: one for each request.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Reply {
    Opened { monitor: String, resolution: Resolution },
    Shown(ShowTimes),
    Confirmed,
    Fault { fault: String, help: String },
}

/// Seconds that each step of showing a frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShowTimes {
    /// Converting levels to pixels, and sending them to the server.
    pub draw: f64,
    /// Waiting for the server's confirmation.
    pub present: f64,
    /// Waiting for the refreshes after that, as far as it took longer than reading back.
    pub settle: f64,
    /// Reading the frame back, which happens while refreshes pass.
    pub verify: f64,
}

/// Writes one message.
pub(super) fn send(to: &mut impl Write, header: &impl Serialize, payload: &[u8]) -> io::Result<()> {
    let header = serde_json::to_vec(header)?;
    // In one piece, so that the reader is woken once.
    let mut message = Vec::with_capacity(8 + header.len() + payload.len());
    message.extend((header.len() as u32).to_le_bytes());
    message.extend((payload.len() as u32).to_le_bytes());
    message.extend(header);
    message.extend(payload);
    to.write_all(&message)?;
    to.flush()
}

/// Reads one message. `None`: the pipe ended.
pub(super) fn receive<T: DeserializeOwned>(from: &mut impl Read) -> io::Result<Option<(T, Vec<u8>)>> {
    let mut lengths = [0; 8];
    match from.read_exact(&mut lengths) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
        read => read?,
    }
    let [header, payload] = [0, 4].map(|at| {
        // Four bytes of an array of eight.
        u32::from_le_bytes([lengths[at], lengths[at + 1], lengths[at + 2], lengths[at + 3]]) as usize
    });
    if header > LONGEST || payload > LONGEST {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "a message too long"));
    }
    let mut read = |length: usize| {
        let mut bytes = vec![0; length];
        from.read_exact(&mut bytes).map(|()| bytes)
    };
    let header = serde_json::from_slice(&read(header)?)?;
    Ok(Some((header, read(payload)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_as_they_were_sent_and_a_torn_one_is_an_error() {
        let mut bytes = Vec::new();
        send(&mut bytes, &Request::Confirm, &[]).expect("memory takes all");
        let header = Request::Show { resolution: Resolution::new(2, 1), channels: 1 };
        send(&mut bytes, &header, &[7, 9]).expect("memory takes all");
        let mut from = bytes.as_slice();
        let first: Option<(Request, Vec<u8>)> = receive(&mut from).expect("it is whole");
        assert!(matches!(first, Some((Request::Confirm, payload)) if payload.is_empty()));
        let second: Option<(Request, Vec<u8>)> = receive(&mut from).expect("it is whole");
        assert!(matches!(second, Some((Request::Show { channels: 1, .. }, payload)) if payload == [7, 9]));
        assert!(receive::<Request>(&mut from).expect("the end is no error").is_none());
        assert!(receive::<Request>(&mut &bytes[..bytes.len() - 1][..]).is_ok());
        let torn = &mut &bytes[..12];
        assert!(receive::<Request>(torn).is_err());
        assert!(receive::<Request>(&mut &[255; 16][..]).is_err(), "no length is believed beyond reason");
    }
}
