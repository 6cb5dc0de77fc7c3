//! A comparison of all methods of separation at several numbers of photos with the exact bounces.

use super::{SeparateBy, Separation, from_capture, separate};
use crate::analysis::low_rank::{LowRankCapture, capture};
use crate::analysis::planes::{Planes, relative_error, sum};
use crate::error::Result;
use crate::finding::Ratio;
use crate::image::Resolution;
use crate::krylov::Start;
use crate::operator::Operator;

/// The result of a method and its settings against the exact first bounce.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ComparisonRow {
    /// The method's name.
    pub method: &'static str,
    /// The settings in words.
    pub setting: String,
    /// Number of photos.
    pub photos: usize,
    /// The relative error `‖direct − exact‖ / ‖exact‖`; nothing without direct light.
    pub error: Ratio,
    /// The relative error of the global light; nothing without global light.
    pub global_error: Ratio,
}

/// Compares all methods. `full` are operators of all of the light (`n × n`), one per channel; `exact` is the light of one bounce,
/// and of two and more, under white; `period` is that of the sinusoids in pixels.
pub fn compare_separations<O: Operator>(
    full: &mut [O],
    resolution: Resolution,
    exact: &[Planes; 2],
    period: f64,
    seed: u64,
) -> Result<Vec<ComparisonRow>> {
    const COUNTS: [usize; 6] = [4, 8, 16, 32, 64, 128];
    let boards =
        [(1, 2), (2, 4), (3, 6), (4, 8)].map(|(square, shifts)| SeparateBy::Checkerboards { square, shifts });
    let waves = [3, 6, 12].map(|phases| SeparateBy::Sinusoids { period, phases });
    let codes = [4, 8, 16, 32, 64].map(|photos| SeparateBy::Codes { photos });
    let random = COUNTS.map(|photos| SeparateBy::Random { photos });
    let mut rows = Vec::new();
    let mut row = |by: SeparateBy, found: &[Separation]| {
        let of = |part: fn(&Separation) -> &Vec<f64>| -> Planes {
            found.iter().map(|f| part(f).clone()).collect()
        };
        rows.push(ComparisonRow {
            method: by.name(),
            setting: by.in_words(),
            photos: by.photos(),
            error: relative_error(&of(|found| &found.direct), &exact[0]),
            global_error: relative_error(&of(|found| &found.global), &exact[1]),
        });
    };
    for by in boards.into_iter().chain(waves).chain(codes).chain(random) {
        let one = |operator: &mut O| separate(operator, resolution, by, seed);
        row(by, &full.iter_mut().map(one).collect::<Result<Vec<_>>>()?);
    }
    // One capture serves all counts: its first photos are those of a shorter capture.
    let white = sum(&exact[0], &exact[1]);
    let most = COUNTS[COUNTS.len() - 1];
    let start = Some(Start::Rademacher { seed });
    let options = LowRankCapture { photos: most, start, ..LowRankCapture::default() };
    let one = |operator: &mut O| capture(operator, &[], &options);
    let captured = full.iter_mut().map(one).collect::<Result<Vec<_>>>()?;
    for photos in COUNTS {
        let models = captured.iter().zip(&white);
        let found = models.map(|(model, white)| from_capture(&model.truncated(photos), white));
        row(SeparateBy::Capture { photos }, &found.collect::<Result<Vec<_>>>()?);
    }
    Ok(rows)
}
