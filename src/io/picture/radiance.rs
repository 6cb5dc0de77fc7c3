//! Radiance pictures (`.hdr`, `.pic`): RGB with a common exponent.

use super::meaning::{REC709, Stored};
use crate::image::Resolution;
use crate::image::codec::Metadata;

/// The primaries of files that state none. All programs that show pictures take them for those of Rec. 709.
const DEFAULT: [f32; 8] = [0.64, 0.33, 0.29, 0.6, 0.15, 0.06, 1.0 / 3.0, 1.0 / 3.0];

pub(super) fn is(bytes: &[u8]) -> bool {
    bytes.starts_with(b"#?")
}

pub(super) fn read(bytes: &[u8], max_samples: usize) -> Result<Stored, String> {
    let mut rest = bytes;
    let (divisors, mut metadata) = header(&mut rest)?;
    let (resolution, orientation) = resolution(&line(&mut rest)?)?;
    metadata.orientation = Some(orientation);
    let count = resolution.width.checked_mul(resolution.height).and_then(|pixels| pixels.checked_mul(3));
    count.filter(|count| (1..=max_samples).contains(count)).ok_or("it has no pixels, or too many")?;
    let mut samples = Vec::new();
    for _ in 0..resolution.height {
        let row = scanline(&mut rest, resolution.width).ok_or("its pixels are malformed or truncated")?;
        for [red, green, blue, exponent] in row {
            let unit = if exponent == 0 { 0.0 } else { 2.0_f64.powi(i32::from(exponent) - 136) };
            let light = [red, green, blue].map(|mantissa| f64::from(mantissa) * unit);
            samples.extend((0..3).map(|channel| (light[channel] / divisors[channel]) as f32));
        }
    }
    Ok(Stored { resolution, channels: 3, samples, levels: None, metadata })
}

/// The factor by which each channel was multiplied, and the other statements of the lines up to the empty one.
fn header(rest: &mut &[u8]) -> Result<([f64; 3], Metadata), String> {
    let mut divisors = [1.0; 3];
    let mut metadata = Metadata::default();
    loop {
        let text = line(rest)?;
        if text.is_empty() {
            return Ok((divisors, metadata));
        }
        // Lines that begin with white space tell of earlier pictures.
        let Some((name, value)) = text.split_once('=').filter(|_| !text.starts_with([' ', '\t', '#'])) else {
            continue;
        };
        let fault = || format!("its header has the line {}, which cannot be used", quoted(&text));
        let numbers = |count: usize| {
            let numbers: Option<Vec<f64>> =
                value.split_whitespace().map(|number| number.parse().ok()).collect();
            numbers.filter(|numbers| numbers.len() == count).ok_or_else(fault)
        };
        match name {
            "EXPOSURE" | "COLORCORR" => {
                let factors = numbers(if name == "EXPOSURE" { 1 } else { 3 })?;
                divisors =
                    std::array::from_fn(|channel| divisors[channel] * factors[channel % factors.len()]);
                if divisors.iter().any(|factor| !factor.is_normal() || *factor < 0.0) {
                    return Err(fault());
                }
            }
            // The ratio of height to width.
            "PIXASPECT" => {
                metadata.pixel_aspect = Some(metadata.pixel_aspect.unwrap_or(1.0) / numbers(1)?[0] as f32);
            }
            "PRIMARIES" => {
                let stated = numbers(8)?;
                let stated: [f32; 8] = std::array::from_fn(|at| stated[at] as f32);
                let default = stated.iter().zip(DEFAULT).all(|(stated, of)| (stated - of).abs() < 0.001);
                metadata.primaries = Some(if default { REC709 } else { stated });
            }
            "FORMAT" if value.trim() != "32-bit_rle_rgbe" => return Err(fault()),
            "GAMMA" if numbers(1)?[0] != 1.0 => return Err(fault()),
            _ => {}
        }
    }
}

/// The size of the stored scan lines, and their orientation, of a line such as `-Y 480 +X 640`.
fn resolution(text: &str) -> Result<(Resolution, u16), String> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let parsed = || {
        let [slow, rows, fast, columns] = *words.as_slice() else { return None };
        let order = ["-Y +X", "-Y -X", "+Y -X", "+Y +X", "+X -Y", "-X -Y", "-X +Y", "+X +Y"];
        let orientation =
            1 + order.iter().position(|signs| signs.split_once(' ') == Some((slow, fast)))? as u16;
        Some((Resolution::new(columns.parse().ok()?, rows.parse().ok()?), orientation))
    };
    parsed().ok_or_else(|| format!("it states the size {}, which cannot be used", quoted(text)))
}

/// One scan line: pixels one by one, runs of whole pixels, or runs of each component apart.
fn scanline(rest: &mut &[u8], width: usize) -> Option<Vec<[u8; 4]>> {
    let start: &[u8; 4] = rest.first_chunk()?;
    let apart = (8..0x8000).contains(&width) && start[..2] == [2, 2] && start[2] < 128;
    let mut row: Vec<[u8; 4]> = Vec::new();
    if apart {
        if usize::from(start[2]) << 8 | usize::from(start[3]) != width {
            return None;
        }
        *rest = &rest[4..];
        row.resize(width, [0; 4]);
        for component in 0..4 {
            let mut at = 0;
            while at < width {
                let (&code, after) = rest.split_first()?;
                let run = code > 128;
                let length = usize::from(if run { code - 128 } else { code });
                let bytes = after.get(..if run { 1 } else { length })?;
                *rest = &after[bytes.len()..];
                let pixels = row.get_mut(at..at + length).filter(|_| length > 0)?;
                for (place, pixel) in pixels.iter_mut().enumerate() {
                    pixel[component] = bytes[if run { 0 } else { place }];
                }
                at += length;
            }
        }
        return Some(row);
    }
    let mut shift = 0;
    while row.len() < width {
        let pixel: [u8; 4] = *rest.first_chunk()?;
        *rest = &rest[4..];
        if pixel[..3] == [1; 3] {
            let length = usize::from(pixel[3]).checked_shl(shift)?;
            shift += 8;
            let last = *row.last()?;
            row.resize(row.len().checked_add(length).filter(|&length| length <= width)?, last);
        } else {
            shift = 0;
            row.push(pixel);
        }
    }
    Some(row)
}

/// Text of a file for a message: its start, with control characters escaped.
fn quoted(text: &str) -> String {
    format!("{:?}", text.chars().take(60).collect::<String>())
}

fn line(rest: &mut &[u8]) -> Result<String, String> {
    let end = rest.iter().position(|&byte| byte == b'\n').ok_or("its header is truncated")?;
    let text = String::from_utf8_lossy(&rest[..end]);
    *rest = &rest[end + 1..];
    Ok(text.trim_end_matches('\r').into())
}
