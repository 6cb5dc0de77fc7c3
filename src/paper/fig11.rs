//! Figure 11: compensation in focus. Which pattern makes a corner look like a given picture, after five photos?

use super::bench::Bench;
use super::check::Check;
use super::compensated::{at_equal_costs, panels, percent};
use super::contest::{Contest, enter, frames_taken, line};
use super::figure::{Figure, Reproduced};
use super::stage::Set;
use super::target::picture;
use crate::error::Result;
use crate::krylov::Method;
use crate::transport::Part;

pub(super) const SIDE: usize = 100;
/// Photos besides the white one.
pub(super) const PHOTOS: usize = 5;
/// Photos of the longer curves.
const MORE: usize = 10;
/// Products with the true matrix for the optimum; no rig takes them as photos.
const OPTIMUM: usize = 600;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Corner, side)?;
    let contest = Contest::hold(bench, &stage, &picture(side), Method::Minres, MORE, OPTIMUM)?;
    let Contest { target_light, recipe, scaled, boxed, jacobi, .. } = &contest;
    let entries =
        [("MINRES, then clamped", recipe), ("Krylov inside the box", boxed), ("projected Jacobi", jacobi)];
    let mut checks = vec![
        Check::at_most(
            "residual without a box, 5 photos of MINRES, %",
            percent(recipe.answered_at(PHOTOS)),
            1.0,
        ),
        Check::stated("the same scaled by the white photo, %", percent(scaled.answered_at(PHOTOS))),
        Check::at_most(
            "residual displayed, 5 photos inside the box, over the optimum",
            boxed.displayed_at(PHOTOS) / contest.bound,
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
        Check::stated("optimum inside the box, % (proven from below)", percent(contest.bound)),
        Check::stated("uncompensated, %", percent(contest.uncompensated)),
    ];
    checks.extend(frames_taken(&entries, PHOTOS));
    let lines = vec![
        line("MINRES, not clamped", &recipe.answered),
        line("MINRES, then clamped", &recipe.displayed),
        line("Krylov inside the box", &boxed.displayed),
        line("projected Jacobi", &jacobi.displayed),
    ];
    let operator = &mut bench.photos(&stage, Part::Full)?;
    let short = enter(&stage, operator, target_light, (Method::KrylovBox, false), PHOTOS)?;
    Ok(Reproduced {
        setting: format!("corner, {}, 5 photos beside the white one", stage.resolution),
        checks,
        panels: panels(&stage, target_light, &contest.plain, &short),
        plots: at_equal_costs(lines, &entries, contest.uncompensated, contest.optimum),
        photos: 1 + PHOTOS,
        ..Reproduced::of(Figure::Fig11, bench.rig())
    })
}
