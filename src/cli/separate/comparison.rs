//! Every method at several photo counts, against the exact bounces.

use anyhow::Result;

use super::super::console::Console;
use super::super::light::Light;
use super::Args;
use super::photos::measured;
use super::planes::sum;
use crate::analysis::low_rank::{LowRankCapture, capture};
use crate::analysis::separate::{SeparateBy, Separation, from_capture};
use crate::image::Resolution;
use crate::krylov::Start;
use crate::report::separation::{ComparisonRow, Planes, relative_error};
use crate::transport::Part;

/// Every method at several photo counts.
pub(super) fn compare(
    args: &Args,
    light: &mut Light<'_>,
    resolution: Resolution,
    exact: &[Planes; 2],
    console: &Console,
) -> Result<Vec<ComparisonRow>> {
    const COUNTS: [usize; 6] = [4, 8, 16, 32, 64, 128];
    let seed = args.trace.seed();
    let boards =
        [(1, 2), (2, 4), (3, 6), (4, 8)].map(|(square, shifts)| SeparateBy::Checkerboards { square, shifts });
    let waves = [3, 6, 12].map(|phases| SeparateBy::Sinusoids { period: args.period, phases });
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
    for by in boards.into_iter().chain(waves).chain(random) {
        row(by, &measured(light, resolution, by, seed, None, console)?);
    }
    // One capture answers for all counts: its first photos are those of a shorter one.
    let white = sum(&exact[0], &exact[1]);
    let captured = light.with_channels(Part::Full, console, |channels| {
        let most = COUNTS[COUNTS.len() - 1];
        let start = Some(Start::Rademacher { seed });
        let options = LowRankCapture { photos: most, start, ..LowRankCapture::default() };
        let one = |operator| capture(operator, &[], &options);
        channels.iter_mut().map(|operator| one(operator)).collect::<crate::Result<Vec<_>>>()
    })?;
    for photos in COUNTS {
        let models = captured.iter().zip(&white);
        let found = models.map(|(model, white)| from_capture(&model.truncated(photos), white));
        row(SeparateBy::Capture { photos }, &found.collect::<crate::Result<Vec<_>>>()?);
    }
    Ok(rows)
}
