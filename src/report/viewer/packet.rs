//! TCP packets of the image viewer tev: a little-endian `u32` length of the whole packet, a type, and fields. A zero byte ends a string.

use crate::image::Resolution;

const CLOSE_IMAGE: u8 = 2;
const CREATE_IMAGE: u8 = 4;
/// The third version of `UpdateImage`: several channels, each with an offset and a stride.
const UPDATE_IMAGE: u8 = 6;

/// Creates a black image and replaces any image with this name.
pub fn create_image(name: &str, size: Resolution, channels: &[&str]) -> Vec<u8> {
    let mut packet = Packet::new(CREATE_IMAGE);
    packet.flag(false).text(name).int(size.width).int(size.height).int(channels.len());
    channels.iter().for_each(|channel| {
        packet.text(channel);
    });
    packet.finished()
}

/// Sends all pixels of one channel, row by row from the top left.
pub fn update_image(name: &str, size: Resolution, channel: &str, values: &[f32]) -> Vec<u8> {
    let mut packet = Packet::new(UPDATE_IMAGE);
    packet.flag(false).text(name).int(1).text(channel);
    packet.int(0).int(0).int(size.width).int(size.height);
    // Offset 0 and stride 1: consecutive values.
    packet.long(0).long(1);
    values.iter().for_each(|value| packet.0.extend(value.to_le_bytes()));
    packet.finished()
}

/// The packet that closes the image of this name.
pub fn close_image(name: &str) -> Vec<u8> {
    let mut packet = Packet::new(CLOSE_IMAGE);
    packet.text(name);
    packet.finished()
}

struct Packet(Vec<u8>);

impl Packet {
    fn new(kind: u8) -> Self {
        Self(vec![0, 0, 0, 0, kind])
    }

    fn flag(&mut self, value: bool) -> &mut Self {
        self.0.push(u8::from(value));
        self
    }

    /// Zero bytes inside the string would end it early, so they are removed.
    fn text(&mut self, text: &str) -> &mut Self {
        self.0.extend(text.bytes().filter(|&byte| byte != 0));
        self.0.push(0);
        self
    }

    fn int(&mut self, value: usize) -> &mut Self {
        self.0.extend(i32::try_from(value).unwrap_or(i32::MAX).to_le_bytes());
        self
    }

    fn long(&mut self, value: i64) -> &mut Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    fn finished(mut self) -> Vec<u8> {
        let length = u32::try_from(self.0.len()).unwrap_or(u32::MAX);
        self.0[..4].copy_from_slice(&length.to_le_bytes());
        self.0
    }
}
