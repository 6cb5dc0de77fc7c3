//! The figures of a page for light, errors and amounts: a picture with its colour bar and unit.

use super::colormap::{paint_sequential, paint_signed, robust_range};
use super::html::{Figure, Kind, Legend, Values};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::raster::develop;

/// A photo in `unit`, developed with exposure `scale`; the colour bar of a colour photo shows its grays.
pub(crate) fn light(image: &Image, scale: f32, unit: &str, caption: impl Into<String>) -> Result<Figure> {
    Ok(Figure {
        png: develop(image, scale).encode_png()?,
        caption: caption.into(),
        legend: Legend::light(1.0 / f64::from(scale)).with_unit(unit),
        values: Some(Values::of_light(image, 1.0 / f64::from(scale), unit)),
        ..Figure::default()
    })
}

/// A pattern; its values are fractions of the projector's white.
pub(crate) fn pattern(image: &Image, caption: impl Into<String>) -> Result<Figure> {
    light(image, 1.0, "of the projector's white", caption)
}

/// Signed values, shown on the range ±`range`.
pub(crate) fn signed(
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
        values: Some(Values::of_numbers(size, Kind::Number, values, unit)),
        ..Figure::default()
    })
}

/// Nonnegative amounts, shown from 0.
pub(crate) fn amounts(
    size: Resolution,
    values: &[f64],
    unit: &str,
    caption: impl Into<String>,
) -> Result<Figure> {
    sequential(size, values, robust_range(values, None), unit, caption)
}

/// Nonnegative amounts, shown from 0 to `high`.
pub(crate) fn sequential(
    size: Resolution,
    values: &[f64],
    high: f64,
    unit: &str,
    caption: impl Into<String>,
) -> Result<Figure> {
    Ok(Figure {
        png: paint_sequential(size, values, None, (0.0, high))?.encode_png()?,
        caption: caption.into(),
        legend: Legend::sequential(0.0, high).with_unit(unit),
        values: Some(Values::of_numbers(size, Kind::Number, values, unit)),
        ..Figure::default()
    })
}

/// Allows each of the named figures to be flipped with the others.
pub(crate) fn flip(figures: &mut [Figure], names: &[&str]) {
    for figure in figures.iter_mut().filter(|figure| names.contains(&figure.name.as_str())) {
        let others = names.iter().filter(|name| **name != figure.name);
        figure.flips = others.map(|name| (*name).to_owned()).collect();
    }
}
