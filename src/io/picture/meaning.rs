//! The meaning of the samples of a picture: their curve, their primaries, their orientation and the shape of their pixels.

use super::curve::Curve;
use super::icc;
use crate::error::Result;
use crate::image::codec::Metadata;
use crate::image::{Image, Resolution};

/// x and y of red, green, blue and white of Rec. 709, which sRGB shares.
pub(in crate::io) const REC709: [f32; 8] = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329];

/// Files state these numbers with three digits or more. The nearest other primaries in use (EBU, SMPTE C) differ by 0.01.
const TOLERANCE: f32 = 0.005;

/// The largest ratio of the sides of a pixel that counts as 1. Resolutions are often rounded to a whole number of pixels per inch.
const SQUARE: f32 = 1.02;

/// A picture as its file stores it.
pub(super) struct Stored {
    pub resolution: Resolution,
    /// 1 (gray), 2 (gray and alpha), 3 (RGB) or 4 (RGBA).
    pub channels: usize,
    /// Interleaved. Those of integers are scaled to \[0,1\].
    pub samples: Vec<f32>,
    /// The highest level of integers, for example 255. `None` for floating-point numbers, which are linear.
    pub levels: Option<f32>,
    pub metadata: Metadata,
}

impl Stored {
    /// The picture that is shown, in linear values.
    ///
    /// # Errors
    /// The statement of the file that cannot be honoured.
    pub(super) fn shown(self) -> std::result::Result<Image, String> {
        let colors = if self.channels >= 3 { 3 } else { 1 };
        let mut samples = self.samples;
        if self.channels != colors {
            let pixels = || samples.chunks_exact(self.channels);
            if pixels().any(|pixel| pixel[colors] != 1.0) {
                return Err("some pixels are transparent, which has no meaning in a pattern".into());
            }
            samples = pixels().flat_map(|pixel| &pixel[..colors]).copied().collect();
        }
        require_square(self.metadata.pixel_aspect)?;
        let linear = self.levels.is_none();
        let curve = curve(&self.metadata, linear, colors == 3)?;
        if !linear {
            samples.iter_mut().for_each(|sample| *sample = curve.at(*sample));
        } else if !curve.is_linear() {
            return Err("it has floating-point values and a colour profile that is not linear".into());
        }
        Image::new(self.resolution, colors, samples)
            .and_then(|image| upright(image, orientation(&self.metadata)))
            .map_err(|error| error.to_string())
    }
}

/// The curve of a picture, from the first of its statements in the order of the PNG specification (third edition, section 4.3). Without a
/// statement, linear formats are linear, and others are sRGB.
fn curve(metadata: &Metadata, linear: bool, color: bool) -> std::result::Result<Curve, String> {
    if let Some((primaries, transfer, full_range)) = metadata.cicp {
        return cicp(primaries, transfer, full_range, color);
    }
    if let Some(profile) = &metadata.icc {
        return icc::curve(profile, color);
    }
    if metadata.srgb {
        return Ok(Curve::Srgb);
    }
    if let Some(primaries) = metadata.primaries.filter(|_| color) {
        require_rec709(&primaries)?;
    }
    if metadata.exif.as_deref().is_some_and(|exif| Exif(exif).is_adobe_rgb()) {
        return Err("its Exif data say that its colours are Adobe RGB".into());
    }
    Ok(match metadata.gamma {
        Some(gamma) => Curve::power(1.0 / gamma),
        None if linear => Curve::LINEAR,
        None => Curve::Srgb,
    })
}

/// The curve that code points of ITU-T H.273 name.
fn cicp(primaries: u8, transfer: u8, full_range: bool, color: bool) -> std::result::Result<Curve, String> {
    if !full_range {
        return Err("its cICP chunk states the narrow range of video".into());
    }
    if color && primaries != 1 {
        return Err(format!(
            "its cICP chunk states the primaries {primaries} of H.273, which are not those of sRGB (1)"
        ));
    }
    match transfer {
        1 | 6 | 14 | 15 => Ok(Curve::BT709),
        4 => Ok(Curve::power(2.2)),
        5 => Ok(Curve::power(2.8)),
        8 => Ok(Curve::LINEAR),
        13 => Ok(Curve::Srgb),
        16 => Err("its cICP chunk states the curve PQ".into()),
        18 => Err("its cICP chunk states the curve HLG".into()),
        other => Err(format!("its cICP chunk states the transfer characteristics {other} of H.273")),
    }
}

/// Refuses primaries other than those of Rec. 709: x and y of red, green, blue and white.
pub(in crate::io) fn require_rec709(primaries: &[f32; 8]) -> std::result::Result<(), String> {
    if primaries.iter().zip(REC709).all(|(stated, of)| (stated - of).abs() < TOLERANCE) {
        return Ok(());
    }
    let [red, green, blue, white] =
        [0, 2, 4, 6].map(|at| format!("({:.3}, {:.3})", primaries[at], primaries[at + 1]));
    Err(format!(
        "its primaries are red {red}, green {green}, blue {blue} and white {white}, which are not those of Rec. 709"
    ))
}

/// Refuses pixels whose width and height differ.
pub(in crate::io) fn require_square(pixel_aspect: Option<f32>) -> std::result::Result<(), String> {
    match pixel_aspect {
        Some(aspect) if aspect.is_normal() && !(1.0 / SQUARE..=SQUARE).contains(&aspect) => {
            Err(format!("its pixels are not square: width and height have the ratio {aspect:.3}"))
        }
        _ => Ok(()),
    }
}

/// The orientation from 1 to 8, as Exif counts them. Other values are 1, as in viewers.
pub(super) fn orientation(metadata: &Metadata) -> u16 {
    let of_exif = || Exif(metadata.exif.as_deref()?).orientation();
    metadata.orientation.or_else(of_exif).filter(|orientation| (1..=8).contains(orientation)).unwrap_or(1)
}

/// The size of the picture that is shown.
pub(super) fn turned(size: Resolution, orientation: u16) -> Resolution {
    if orientation >= 5 { Resolution::new(size.height, size.width) } else { size }
}

fn upright(image: Image, orientation: u16) -> Result<Image> {
    if orientation == 1 {
        return Ok(image);
    }
    let Resolution { width, height } = image.resolution();
    let shown = turned(image.resolution(), orientation);
    let (from_right, from_below) =
        (matches!(orientation, 2 | 3 | 7 | 8), matches!(orientation, 3 | 4 | 6 | 7));
    let pixels = (0..shown.height).flat_map(|y| (0..shown.width).map(move |x| (x, y))).flat_map(|(x, y)| {
        let (column, row) = if orientation >= 5 { (y, x) } else { (x, y) };
        let column = if from_right { width - 1 - column } else { column };
        let row = if from_below { height - 1 - row } else { row };
        let at = image.channels() * (row * width + column);
        &image.samples()[at..at + image.channels()]
    });
    Image::new(shown, image.channels(), pixels.copied().collect())
}

/// Exif data, which have the structure of a TIFF file.
struct Exif<'a>(&'a [u8]);

impl Exif<'_> {
    fn orientation(&self) -> Option<u16> {
        let entry = self.entry(self.number(4)?, 0x0112)?;
        self.short(entry + 8)
    }

    /// Whether the interoperability index is the one of Adobe RGB (DCF 2.0, section 3.2.6).
    fn is_adobe_rgb(&self) -> bool {
        let below = |directory, tag| self.number(self.entry(directory, tag)? + 8);
        let index = || {
            let directory = below(below(self.number(4)?, 0x8769)?, 0xa005)?;
            let at = self.entry(directory, 1)? + 8;
            self.0.get(at..at + 3)
        };
        index() == Some(b"R03")
    }

    /// The place of the entry of a tag in a directory.
    fn entry(&self, directory: usize, tag: u16) -> Option<usize> {
        let count = self.short(directory)?;
        (0..usize::from(count))
            .map(|entry| directory + 2 + 12 * entry)
            .find(|&at| self.short(at) == Some(tag))
    }

    fn short(&self, at: usize) -> Option<u16> {
        let bytes = self.0.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if self.0.starts_with(b"II") { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    }

    fn number(&self, at: usize) -> Option<usize> {
        let bytes = self.0.get(at..at.checked_add(4)?)?.try_into().ok()?;
        let number =
            if self.0.starts_with(b"II") { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) };
        usize::try_from(number).ok()
    }
}
