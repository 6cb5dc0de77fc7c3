//! PGM and PPM files (`P2`, `P3`, `P5`, `P6`) and PFM files (`Pf`, `PF`).

use super::meaning::Stored;
use crate::image::Resolution;
use crate::image::codec::Metadata;

pub(super) fn is(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'1'..=b'7' | b'f' | b'F', b' ' | b'\t'..=b'\r' | b'#', ..])
}

pub(super) fn read(bytes: &[u8], max_samples: usize) -> Result<Stored, String> {
    let kind = bytes.get(1).copied().unwrap_or_default();
    let channels = match kind {
        b'2' | b'5' | b'f' => 1,
        b'3' | b'6' | b'F' => 3,
        other => return Err(format!("it is of the kind P{}, a bitmap or a PAM file", char::from(other))),
    };
    let mut rest = &bytes[2..];
    let mut side = || word(&mut rest)?.parse().map_err(|_| "its header states no size");
    let (width, height): (usize, usize) = (side()?, side()?);
    let count = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(channels));
    let count =
        count.filter(|count| (1..=max_samples).contains(count)).ok_or("it has no pixels, or too many")?;
    let scale: f32 = word(&mut rest)?.parse().map_err(|_| "its header states no scale")?;
    let whole = |size: usize| rest.get(..count * size).ok_or("the file is truncated");
    let mut metadata = Metadata::default();
    let linear = matches!(kind, b'f' | b'F');
    let samples: Vec<f32> = if linear {
        if scale.abs() != 1.0 {
            return Err(format!("its scale is {}, whose meaning programs disagree on", scale.abs()));
        }
        // Rows are stored from below, which is orientation 4.
        metadata.orientation = Some(4);
        let float = |&bytes: &[u8; 4]| {
            if scale < 0.0 { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) }
        };
        whole(4)?.as_chunks().0.iter().map(float).collect()
    } else {
        if !(1.0..=65535.0).contains(&scale) || scale.fract() != 0.0 {
            return Err("its maximum is not between 1 and 65535".into());
        }
        let levels: Vec<u16> = match kind {
            b'2' | b'3' => {
                let level =
                    |_| word(&mut rest)?.parse::<u16>().map_err(|_| "a sample is no number from 0 to 65535");
                (0..count).map(level).collect::<Result<Vec<_>, _>>()?
            }
            _ if scale < 256.0 => whole(1)?.iter().map(|&level| u16::from(level)).collect(),
            _ => whole(2)?.as_chunks().0.iter().map(|&level| u16::from_be_bytes(level)).collect(),
        };
        if levels.iter().any(|&level| f32::from(level) > scale) {
            return Err(format!("a sample is greater than {scale}, the maximum that the header states"));
        }
        levels.into_iter().map(|level| f32::from(level) / scale).collect()
    };
    Ok(Stored {
        resolution: Resolution::new(width, height),
        channels,
        samples,
        levels: (!linear).then_some(scale),
        metadata,
    })
}

/// The next word, without comments, and with the one white space that ends it.
fn word<'a>(rest: &mut &'a [u8]) -> Result<&'a str, &'static str> {
    loop {
        *rest = rest.trim_ascii_start();
        if !rest.starts_with(b"#") {
            break;
        }
        let end = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
        *rest = &rest[end..];
    }
    let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
    let found = std::str::from_utf8(&rest[..end]).ok().filter(|found| !found.is_empty());
    *rest = rest.get(end + 1..).unwrap_or_default();
    found.ok_or("the file is truncated")
}
