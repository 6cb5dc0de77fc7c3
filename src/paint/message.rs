//! The binary messages between page and server, and the mailbox of requests that wait for the session. All numbers are little-endian.
//! Planes are 32-bit floats, one plane after the other.
//!
//! Each message begins with eight bytes: its kind, its flags, the index of its light in [`Canvas::lights`](super::Canvas::lights), and a
//! number. Rare and small messages (greetings, questions, errors) are JSON text.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use serde::Deserialize;

use super::question::PageQuestion;
use crate::analysis::planes::Planes;

/// The number of bytes before the content of a message.
pub const HEADER: usize = 8;

#[derive(Clone, Debug, PartialEq)]
pub enum PageRequest {
    /// New values of single pixels of the pattern, one for each channel.
    Change(Vec<(u32, Vec<f32>)>),
    Replace(Planes),
    /// The end of a stroke, which requests the exact photo of the pattern.
    Finish,
    Light(usize),
    /// A request for the column or the row of this pixel. The kind is [`MessageKind::Column`] or [`MessageKind::Row`].
    Look(MessageKind, u32),
    Ask(NumberedQuestion),
}

/// A question with its number. The page expects an answer with the same number.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct NumberedQuestion {
    pub number: u32,
    #[serde(flatten)]
    pub question: PageQuestion,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum MessageKind {
    /// A photo. Its number is the number of the author's last request that the photo includes. If the flag is set, the photo is exact.
    Photo = 1,
    /// The pattern of the photo, for the pages that did not paint it.
    Pattern = 2,
    /// The light of a projector pixel. The number is the projector pixel.
    Column = 3,
    /// The projector pixels that light a camera pixel. The number is the camera pixel.
    Row = 4,
    /// The answer to a question with the same number: the length of a JSON text, the text, and planes.
    Answer = 5,
}

/// Reads a binary message. `channels` and `pixels` are those of the pattern. Also returns the number that the page gave the message. `Err`
/// describes what is wrong with the message.
pub fn read(bytes: &[u8], channels: usize, pixels: usize) -> Result<(u32, PageRequest), String> {
    let (Some(header), Some(content)) = (bytes.get(..HEADER), bytes.get(HEADER..)) else {
        return Err(format!("a message of {} bytes, shorter than its header", bytes.len()));
    };
    let light = usize::from(u16::from_le_bytes([header[2], header[3]]));
    let number = u32::from_le_bytes([header[4], header[5], header[6], header[7]]);
    let request = match header[0] {
        1 => PageRequest::Change(changes(content, channels, pixels)?),
        2 => PageRequest::Replace(planes(content, channels, pixels)?),
        3 => PageRequest::Finish,
        4 => PageRequest::Light(light),
        5 => PageRequest::Look(MessageKind::Column, number),
        6 => PageRequest::Look(MessageKind::Row, number),
        kind => return Err(format!("a message of unknown kind {kind}")),
    };
    Ok((number, request))
}

fn changes(content: &[u8], channels: usize, pixels: usize) -> Result<Vec<(u32, Vec<f32>)>, String> {
    let size = 4 * (1 + channels);
    if !content.len().is_multiple_of(size) {
        return Err(format!("changes of {} bytes, which is no multiple of {size}", content.len()));
    }
    let change = |entry: &[u8]| {
        let words: Vec<[u8; 4]> = entry.as_chunks::<4>().0.to_vec();
        let pixel = u32::from_le_bytes(words[0]);
        let values: Vec<f32> = words[1..].iter().map(|&word| f32::from_le_bytes(word)).collect();
        match (pixel as usize) < pixels && values.iter().all(|value| value.is_finite()) {
            true => Ok((pixel, values)),
            false => Err(format!("a change of pixel {pixel} to {values:?}, of a pattern of {pixels} pixels")),
        }
    };
    content.chunks_exact(size).map(change).collect()
}

fn planes(content: &[u8], channels: usize, pixels: usize) -> Result<Planes, String> {
    if content.len() != 4 * channels * pixels {
        return Err(format!("a pattern of {} bytes in place of {}", content.len(), 4 * channels * pixels));
    }
    let values: Vec<f64> =
        content.as_chunks::<4>().0.iter().map(|&word| f64::from(f32::from_le_bytes(word))).collect();
    if values.iter().any(|value| !value.is_finite()) {
        return Err("a pattern with values that are no finite numbers".into());
    }
    Ok(values.chunks_exact(pixels).map(<[f64]>::to_vec).collect())
}

pub fn write(kind: MessageKind, is_exact: bool, light: usize, number: u32, planes: &Planes) -> Vec<u8> {
    let mut bytes = header(kind, is_exact, light, number);
    put(&mut bytes, planes);
    bytes
}

pub fn write_answer(number: u32, text: &str, planes: &Planes) -> Vec<u8> {
    let mut bytes = header(MessageKind::Answer, true, 0, number);
    // The text is padded, so that the floats begin at a multiple of four bytes.
    let padded = text.len().next_multiple_of(4);
    bytes.extend((padded as u32).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.resize(HEADER + 4 + padded, b' ');
    put(&mut bytes, planes);
    bytes
}

fn header(kind: MessageKind, is_exact: bool, light: usize, number: u32) -> Vec<u8> {
    let mut bytes = vec![kind as u8, u8::from(is_exact)];
    bytes.extend((light as u16).to_le_bytes());
    bytes.extend(number.to_le_bytes());
    bytes
}

fn put(bytes: &mut Vec<u8>, planes: &Planes) {
    bytes.extend(planes.iter().flatten().flat_map(|&value| (value as f32).to_le_bytes()));
}

/// The maximum number of waiting questions per page. A page asks one question after the other.
const MOST_QUESTIONS: usize = 4;

pub type Client = u64;

#[derive(Debug, Default)]
pub struct Pending {
    /// The page that made the last change of the pattern, with the number of its request.
    pub author: Option<(Client, u32)>,
    /// A complete new pattern. The changes are applied after it.
    pub replace: Option<Planes>,
    pub changes: BTreeMap<u32, Vec<f32>>,
    pub is_finished: bool,
    pub light: Option<usize>,
    /// The last pixel whose column or row each page requested.
    pub looks: BTreeMap<(Client, MessageKind), u32>,
    /// The questions in the order in which they arrived.
    pub questions: VecDeque<(Client, NumberedQuestion)>,
    /// New pages, which need the current pattern and photo.
    pub newcomers: Vec<Client>,
    pub is_over: bool,
}

impl Pending {
    fn is_empty(&self) -> bool {
        self.author.is_none()
            && self.light.is_none()
            && self.looks.is_empty()
            && self.questions.is_empty()
            && self.newcomers.is_empty()
            && !self.is_over
    }
}

/// The waiting requests, and a signal to the session when a request arrives.
#[derive(Debug, Default)]
pub struct Mailbox {
    pending: Mutex<Pending>,
    arrived: Condvar,
}

impl Mailbox {
    /// Adds a request. `Err` means that the page has too many open questions.
    pub fn put(&self, client: Client, number: u32, request: PageRequest) -> Result<(), String> {
        let mut pending = self.lock();
        match request {
            PageRequest::Change(changes) => {
                pending.changes.extend(changes);
                pending.author = Some((client, number));
            }
            PageRequest::Replace(planes) => {
                pending.changes.clear();
                pending.replace = Some(planes);
                pending.author = Some((client, number));
            }
            PageRequest::Finish => {
                pending.is_finished = true;
                pending.author = Some((client, number));
            }
            PageRequest::Light(light) => pending.light = Some(light),
            PageRequest::Look(kind, pixel) => _ = pending.looks.insert((client, kind), pixel),
            PageRequest::Ask(asked) => {
                let open = pending.questions.iter().filter(|(of, _)| *of == client).count();
                if open >= MOST_QUESTIONS {
                    return Err(format!("{open} questions are open already"));
                }
                pending.questions.push_back((client, asked));
            }
        }
        self.arrived.notify_one();
        Ok(())
    }

    pub fn welcome(&self, client: Client) {
        self.lock().newcomers.push(client);
        self.arrived.notify_one();
    }

    /// Removes all requests of a page that has left.
    pub fn forget(&self, client: Client) {
        let mut pending = self.lock();
        pending.looks.retain(|(of, _), _| *of != client);
        pending.questions.retain(|(of, _)| *of != client);
        pending.newcomers.retain(|of| *of != client);
    }

    pub fn end(&self) {
        self.lock().is_over = true;
        self.arrived.notify_one();
    }

    /// Waits for requests, then removes and returns them, with at most one question, so that strokes are handled between questions.
    pub fn take(&self) -> Pending {
        let mut pending = self.lock();
        while pending.is_empty() {
            pending = self.arrived.wait(pending).unwrap_or_else(PoisonError::into_inner);
        }
        let first = pending.questions.len().min(1);
        let waiting = pending.questions.split_off(first);
        let taken = std::mem::take(&mut *pending);
        pending.questions = waiting;
        taken
    }

    fn lock(&self) -> MutexGuard<'_, Pending> {
        // The data is valid even if a thread panicked, since every change is complete.
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_read_and_broken_messages_are_refused_by_what_is_wrong() {
        let mut bytes = vec![1, 0, 0, 0, 7, 0, 0, 0];
        bytes.extend(3_u32.to_le_bytes());
        bytes.extend(0.5_f32.to_le_bytes());
        assert_eq!(read(&bytes, 1, 4), Ok((7, PageRequest::Change(vec![(3, vec![0.5])]))));
        let fault = |bytes: &[u8], pixels| read(bytes, 1, pixels).err().unwrap_or_default();
        assert!(fault(&bytes, 3).contains("pixel 3"));
        assert!(fault(&bytes[..12], 4).contains("multiple of 8"));
        assert!(fault(&bytes[..5], 4).contains("shorter"));
        assert!(fault(&[9, 0, 0, 0, 0, 0, 0, 0], 4).contains("kind 9"));
        bytes.truncate(12);
        bytes.extend(f32::NAN.to_le_bytes());
        assert!(fault(&bytes, 4).contains("NaN"));
        assert!(fault(&[2, 0, 0, 0, 0, 0, 0, 0, 1], 4).contains("16"));
    }

    #[test]
    fn planes_of_answers_begin_at_multiples_of_four() {
        let bytes = write_answer(5, "{}", &vec![vec![1.0, -2.0]]);
        assert_eq!(bytes.len(), HEADER + 4 + 4 + 8);
        assert_eq!(bytes[16..20], 1.0_f32.to_le_bytes());
    }
}
