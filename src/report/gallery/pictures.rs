//! Planes of values as pictures with their legends.

use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::paper::{Content, Panel, Shot, Strip};
use crate::report::colormap::{paint_sequential, paint_signed, robust_range};
use crate::report::html::{Figure, Frame, Legend};
use crate::report::palette::paint_labels;
use crate::report::raster::Raster;
use crate::report::spectrum::narrowed;
use crate::report::tone::{develop, exposure};

/// A panel as the page shows it.
pub(super) fn figure(panel: &Panel) -> Result<Figure> {
    let resolution = panel.resolution;
    let (raster, legend) = match &panel.content {
        Content::Labels(labels) => (paint_labels(resolution, labels), Legend::of_labels(labels)),
        Content::Signed(values) => {
            let range = robust_range(values, None);
            (paint_signed(resolution, values, None, range)?, Legend::signed(range))
        }
        Content::Amounts(values) => {
            let high = robust_range(values, None);
            (paint_sequential(resolution, values, None, (0.0, high))?, Legend::sequential(0.0, high))
        }
        Content::Light { values, white } => {
            let image = narrowed(resolution, values)?;
            let scale = white.map_or_else(|| exposure(&image), |white| (1.0 / white) as f32);
            (develop(&image, scale), Legend::light(1.0 / f64::from(scale)))
        }
    };
    Ok(Figure { png: raster.encode_png()?, caption: panel.caption.clone(), legend })
}

/// The photos of a strip, numbered from 1: each pattern above its photo.
pub(super) fn frames(strip: &Strip) -> Result<Vec<Frame>> {
    let frame = |(index, shot): (usize, &Shot)| {
        let pngs =
            [&shot.pattern, &shot.photo].map(|values| thumbnail(strip.resolution, values)?.encode_png());
        let [pattern, photo] = pngs;
        Ok(Frame { pngs: vec![pattern?, photo?], caption: (index + 1).to_string() })
    };
    strip.shots.iter().enumerate().map(frame).collect()
}

/// Light as the eye sees it; where there are negative values, the signed scale.
fn thumbnail(resolution: Resolution, values: &[f64]) -> Result<Raster> {
    if values.iter().any(|&value| value < 0.0) {
        return paint_signed(resolution, values, None, robust_range(values, None));
    }
    let image: Image = narrowed(resolution, values)?;
    Ok(develop(&image, exposure(&image)))
}
