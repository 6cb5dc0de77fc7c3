//! Light, errors and amounts as figures of a page: the picture with its colour bar and unit.

use super::colormap::{paint_sequential, paint_signed, robust_range};
use super::html::{Figure, Legend};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::tone::develop;

/// Light in `unit`, developed by `scale`; in colour, the bar is that of its grays.
pub(super) fn light(image: &Image, scale: f32, unit: &str, caption: impl Into<String>) -> Result<Figure> {
    Ok(Figure {
        png: develop(image, scale).encode_png()?,
        caption: caption.into(),
        legend: Legend::light(1.0 / f64::from(scale)).with_unit(unit),
    })
}

/// A pattern: what is projected, from 0 to 1 of what the projector can.
pub(super) fn pattern(image: &Image, caption: impl Into<String>) -> Result<Figure> {
    light(image, 1.0, "of the projector's white", caption)
}

/// Values of either sign within ±`range`.
pub(super) fn signed(
    size: Resolution,
    values: &[f64],
    range: f64,
    unit: &str,
    caption: impl Into<String>,
) -> Result<Figure> {
    Ok(Figure {
        png: paint_signed(size, values, None, range)?.encode_png()?,
        caption: caption.into(),
        legend: Legend::signed(range).with_unit(unit),
    })
}

/// Amounts from 0 on.
pub(super) fn amounts(
    size: Resolution,
    values: &[f64],
    unit: &str,
    caption: impl Into<String>,
) -> Result<Figure> {
    let high = robust_range(values, None);
    Ok(Figure {
        png: paint_sequential(size, values, None, (0.0, high))?.encode_png()?,
        caption: caption.into(),
        legend: Legend::sequential(0.0, high).with_unit(unit),
    })
}
