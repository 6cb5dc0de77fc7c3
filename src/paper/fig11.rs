//! Figure 11: what to project into a corner so that it looks like a picture, at five photos.

use super::bench::{Bench, Set, Stage};
use super::check::Check;
use super::contest::{self, Entry, Wish, clamped, enter, line};
use super::figure::{Content, Curves, Figure, Panel, Reproduced};
use super::target::picture;
use crate::error::Result;
use crate::krylov::Method;
use crate::transport::Part;

pub(super) const SIDE: usize = 100;
/// Photos beside the white one.
pub(super) const PHOTOS: usize = 5;
/// For the curves.
const MORE: usize = 10;
/// Products with the matrix for the optimum, which no rig has to take.
const OPTIMUM: usize = 600;

pub(super) fn reproduce(bench: &mut Bench<'_>) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Corner, side)?;
    let target = picture(side);
    let (wish, entries) = bench.with_rig(&stage, Part::Full, |operator| {
        let wish = Wish::new(&stage, operator, &target)?;
        let mut enter = |method| enter(&stage, operator, &wish, method, MORE);
        let entries = [
            enter((Method::Minres, false))?,
            enter((Method::Minres, true))?,
            enter((Method::KrylovBox, false))?,
            enter((Method::Jacobi, false))?,
        ];
        Ok((wish, entries))
    })?;
    let [recipe, scaled, boxed, jacobi] = &entries;
    let (bound, optimum) = contest::optimum(&stage, &wish, OPTIMUM)?;
    let plain = clamped(&target.iter().map(|value| 0.5 * value).collect::<Vec<_>>());
    let uncompensated = wish.residual(&stage, &plain);
    let checks = vec![
        Check::at_most(
            "residual without a box, 5 photos of MINRES, %",
            percent(recipe.answered_at(PHOTOS)),
            1.0,
        ),
        Check::stated("the same scaled by the white photo, %", percent(scaled.answered_at(PHOTOS))),
        Check::at_most(
            "residual displayed, 5 photos inside the box, over the optimum",
            boxed.displayed_at(PHOTOS) / bound,
            1.02,
        ),
        Check::stated("residual displayed, 5 photos inside the box, %", percent(boxed.displayed_at(PHOTOS))),
        Check::stated(
            "residual displayed by the recipe that clamps, 5 photos, %",
            percent(recipe.displayed_at(PHOTOS)),
        ),
        Check::stated(
            "residual displayed by projected Jacobi, 5 photos, %",
            percent(jacobi.displayed_at(PHOTOS)),
        ),
        Check::stated("optimum inside the box, % (proven from below)", percent(bound)),
        Check::stated("uncompensated, %", percent(uncompensated)),
    ];
    let lines = vec![
        line("MINRES, not clamped", &recipe.answered),
        line("MINRES, then clamped", &recipe.displayed),
        line("Krylov inside the box", &boxed.displayed),
        line("projected Jacobi", &jacobi.displayed),
    ];
    let short = bench.with_rig(&stage, Part::Full, |operator| {
        enter(&stage, operator, &wish, (Method::KrylovBox, false), PHOTOS)
    })?;
    Ok(Reproduced {
        figure: Figure::Fig11,
        rig: bench.rig(),
        setting: format!("corner, {}, 5 photos beside the white one", stage.resolution),
        checks,
        panels: panels(&stage, &wish, &plain, &short),
        plots: vec![Curves {
            caption: "Relative residual by the light itself, at equal photos (the white one not counted)."
                .into(),
            x_label: "photos".into(),
            y_label: "relative residual".into(),
            logarithmic: true,
            lines,
            marks: vec![(uncompensated, "uncompensated".into()), (optimum, "best inside the box".into())],
        }],
        strips: Vec::new(),
        photos: 1 + PHOTOS,
        seconds: 0.0,
    })
}

pub(super) fn percent(share: f64) -> f64 {
    100.0 * share
}

/// Wish, photos with and without compensation, what is projected, and errors; photos are shown alike.
pub(super) fn panels(stage: &Stage, wish: &Wish, plain: &[f64], best: &Entry) -> Vec<Panel> {
    let panel = |name: &str, caption: String, content: Content| Panel {
        name: name.into(),
        caption,
        resolution: stage.resolution,
        content,
    };
    let light = |values: Vec<f64>| Content::Light { values, white: Some(wish.peak) };
    let pattern = clamped(&best.pattern);
    let [seen, before] = [stage.photo(&pattern), stage.photo(plain)];
    let error = |photo: &[f64]| -> Vec<f64> { photo.iter().zip(&wish.light).map(|(y, b)| y - b).collect() };
    let residual = |pattern: &[f64]| format!("residual {:.2} %", percent(wish.residual(stage, pattern)));
    vec![
        panel("wish", "What is wished, W/(m² sr)".into(), light(wish.light.clone())),
        panel("before", format!("Projected as it is: {}", residual(plain)), light(before.clone())),
        panel("after", format!("Compensated: {}", residual(&pattern)), light(seen.clone())),
        panel(
            "pattern",
            "What is projected, 0 to 1".into(),
            Content::Light { values: pattern, white: Some(1.0) },
        ),
        panel(
            "error-before",
            "Projected as it is less wished, W/(m² sr)".into(),
            Content::Signed(error(&before)),
        ),
        panel("error-after", "Compensated less wished, W/(m² sr)".into(), Content::Signed(error(&seen))),
    ]
}
