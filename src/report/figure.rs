//! The figures of a page for light, errors, amounts and groups. Each is a picture with a legend and its values.

use super::colormap::{paint_sequential, paint_signed, robust_range};
use super::html::{Figure, Kind, Legend, Values};
use super::palette::paint_labels;
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::raster::{Raster, develop};

/// A photo in `unit`, developed with exposure `scale`. The colour bar of a colour photo shows the gray values.
pub(crate) fn light(image: &Image, scale: f32, unit: &str, caption: impl Into<String>) -> Figure {
    let white = 1.0 / f64::from(scale);
    let painted = (develop(image, scale), Legend::light(white).with_unit(unit));
    figure(painted, Values::of_light(image, white, unit), caption)
}

/// A pattern. Its values are fractions of the projector's white.
pub(crate) fn pattern(image: &Image, caption: impl Into<String>) -> Figure {
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
    let painted = (paint_signed(size, values, None, range)?, Legend::signed(range).with_unit(unit));
    Ok(figure(painted, Values::of_numbers(size, Kind::Number, values, unit), caption))
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
    let legend = Legend::sequential(0.0, high).with_unit(unit);
    let painted = (paint_sequential(size, values, None, (0.0, high))?, legend);
    Ok(figure(painted, Values::of_numbers(size, Kind::Number, values, unit), caption))
}

/// The number of each pixel's group.
pub(crate) fn labels(size: Resolution, labels: &[u8], caption: impl Into<String>) -> Figure {
    let painted = (paint_labels(size, labels), Legend::of_labels(labels));
    figure(painted, Values::of_labels(size, labels), caption)
}

/// A picture with a legend and its values.
pub(crate) fn figure(
    (picture, legend): (Raster, Legend),
    values: Values,
    caption: impl Into<String>,
) -> Figure {
    Figure { picture, caption: caption.into(), legend, values: Some(values), ..Figure::default() }
}

/// Allows the reader to switch between the named figures in place.
pub(crate) fn flip(figures: &mut [Figure], names: &[&str]) {
    for figure in figures.iter_mut().filter(|figure| names.contains(&figure.name.as_str())) {
        let others = names.iter().filter(|name| **name != figure.name);
        figure.flips = others.map(|name| (*name).to_owned()).collect();
    }
}

/// The mean over the channels, for each pixel.
pub(crate) fn mean(planes: &[Vec<f64>]) -> Vec<f64> {
    let pixels = planes.first().map_or(0, Vec::len);
    (0..pixels)
        .map(|pixel| planes.iter().map(|plane| plane[pixel]).sum::<f64>() / planes.len() as f64)
        .collect()
}

/// The mean of `a − b` over the channels, for each pixel.
pub(crate) fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<f64> {
    let less = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - b).collect();
    mean(&a.iter().zip(b).map(less).collect::<Vec<_>>())
}
