//! What is written about a GigE Vision camera, and how it counts.

use std::net::Ipv4Addr;

use serde::Deserialize;

use crate::image::Resolution;
use crate::rig::CameraInfo;

/// A GigE Vision camera of gray pixels.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GigeSpec {
    /// What it is.
    pub kind: CameraKind,
    /// Its address.
    pub address: Ipv4Addr,
    /// Width and height of the part of its sensor that is read.
    pub size: [usize; 2],
    /// Where that part begins, to the right and down.
    #[serde(default)]
    pub offset: [usize; 2],
    /// How it hands out counts.
    #[serde(default)]
    pub pixel_format: PixelFormat,
    /// Its gain, in the camera's own unit (mostly decibels); none: as it is set.
    #[serde(default)]
    pub gain: Option<f64>,
    /// The shortest and the longest exposure that are used, in seconds.
    #[serde(default = "exposures")]
    pub exposures: [f64; 2],
    /// Seconds beyond the exposure after which a frame that does not come is given up.
    #[serde(default = "timeout")]
    pub timeout: f64,
    /// Bytes of a packet at most; none: as many as get through.
    #[serde(default)]
    pub packet_size: Option<u32>,
}

/// Kinds of cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraKind {
    /// One that speaks GigE Vision.
    Gige,
}

/// How counts are packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PixelFormat {
    /// 8 bits.
    Mono8,
    /// 10 bits in 16.
    Mono10,
    /// 12 bits in 16.
    #[default]
    Mono12,
    /// 14 bits in 16.
    Mono14,
    /// 16 bits.
    Mono16,
}

impl PixelFormat {
    /// As cameras call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mono8 => "Mono8",
            Self::Mono10 => "Mono10",
            Self::Mono12 => "Mono12",
            Self::Mono14 => "Mono14",
            Self::Mono16 => "Mono16",
        }
    }

    /// Bits of a count.
    pub fn bits(self) -> u32 {
        match self {
            Self::Mono8 => 8,
            Self::Mono10 => 10,
            Self::Mono12 => 12,
            Self::Mono14 => 14,
            Self::Mono16 => 16,
        }
    }

    /// Bytes of a pixel.
    pub fn bytes(self) -> usize {
        if self == Self::Mono8 { 1 } else { 2 }
    }

    /// Counts of these bytes; an odd one at the end is left over.
    pub fn counts(self, bytes: &[u8]) -> Vec<u16> {
        match self {
            Self::Mono8 => bytes.iter().map(|&byte| byte.into()).collect(),
            _ => bytes.as_chunks::<2>().0.iter().map(|&pair| u16::from_le_bytes(pair)).collect(),
        }
    }
}

fn exposures() -> [f64; 2] {
    [1e-4, 1.0]
}

fn timeout() -> f64 {
    1.0
}

impl GigeSpec {
    /// The camera at an address, with 12 bits and so many pixels.
    pub fn new(address: Ipv4Addr, width: usize, height: usize) -> Self {
        Self {
            kind: CameraKind::Gige,
            address,
            size: [width, height],
            offset: [0, 0],
            pixel_format: PixelFormat::default(),
            gain: None,
            exposures: exposures(),
            timeout: timeout(),
            packet_size: None,
        }
    }

    /// The camera, as it presents itself.
    pub fn info(&self) -> CameraInfo {
        CameraInfo {
            name: format!("gige {}", self.address),
            resolution: Resolution::new(self.size[0], self.size[1]),
            channels: 1,
            bits: self.pixel_format.bits(),
            exposures: self.exposures,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_little_endian_and_fill_their_bits() {
        assert_eq!(PixelFormat::Mono8.counts(&[0, 255, 7]), [0, 255, 7]);
        assert_eq!(PixelFormat::Mono12.counts(&[0xff, 0x0f, 1, 0]), [4095, 1]);
        assert_eq!(PixelFormat::Mono16.counts(&[0xff, 0xff, 3]), [65535]);
    }
}
