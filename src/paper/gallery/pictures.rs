//! Panels painted as pictures with legends.

use crate::error::Result;
use crate::io::raster::{develop, exposure};
use crate::paper::{Content, Panel};
use crate::report::colormap::{paint_sequential, paint_signed, robust_range};
use crate::report::contact_sheet::ContactSheet;
use crate::report::html::{Figure, Kind, Legend, Sheet, Values};
use crate::report::palette::paint_labels;
use crate::report::spectrum::narrowed;

/// A panel as a figure of the page.
pub(super) fn figure(panel: &Panel) -> Result<Figure> {
    let resolution = panel.resolution;
    let number = |values: &[f64]| Values::of_numbers(resolution, Kind::Number, values, "");
    let (raster, legend, values) = match &panel.content {
        Content::Labels(labels) => (
            paint_labels(resolution, labels),
            Legend::of_labels(labels),
            Values::of_labels(resolution, labels),
        ),
        Content::Signed(values) => {
            let range = robust_range(values, None);
            (paint_signed(resolution, values, None, range)?, Legend::signed(range), number(values))
        }
        Content::Amounts(values) => {
            let high = robust_range(values, None);
            (
                paint_sequential(resolution, values, None, (0.0, high))?,
                Legend::sequential(0.0, high),
                number(values),
            )
        }
        Content::Light { values, white } => {
            let image = narrowed(resolution, values)?;
            let scale = white.map_or_else(|| exposure(&image), |white| (1.0 / white) as f32);
            let white = 1.0 / f64::from(scale);
            (develop(&image, scale), Legend::light(white), Values::of_light(&image, white, ""))
        }
    };
    Ok(Figure {
        png: raster.encode_png()?,
        caption: panel.caption.clone(),
        legend,
        values: Some(values),
        name: panel.name.clone(),
        ..Figure::default()
    })
}

/// The contact sheet of a figure's photos, numbered from 1, each below its pattern.
pub(super) fn sheet(strip: &crate::paper::Strip) -> Result<Sheet> {
    let mut photos = ContactSheet::new([strip.resolution; 2], 1);
    strip.photos.iter().try_for_each(|photo| photos.push(0, &photo.from, &photo.to, false))?;
    photos.sheet()
}
