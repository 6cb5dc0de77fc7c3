//! Figures 10, 11 and 12: compensation of a corner after five photos, compensation of a back wall that is out of focus after eight, and the
//! first photos of that run.
//!
//! Figure 12 is the experiment of section 8.3: camera and projector out of focus, MINRES, and negative values set to zero. The paper states
//! neither the width of the blur nor whether the target was mapped to [α, 1] (section 6.3). Both decide whether the method helps, so the
//! figure shows where it does and where it stops. MINRES divides by the small eigenvalues of a wide blur, its solution leaves [0, 1] at about
//! a quarter of the pixels, and clamping them adds more than the method gained.

use super::bench::{Bench, Set};
use super::check::Check;
use super::contest::{Contest, MethodRun, TargetLight, percent};
use super::figure::{Figure, Plot, Points, Reproduced, Strip, counted, good_from};
use super::vectors::{add, largest_outside};
use crate::error::Result;
use crate::krylov::{Method, Start};
use crate::operator::Product;
use crate::transport::Part;

const SIDE_IN_FOCUS: usize = 100;
/// The number of photos besides the white photo.
const PHOTOS_IN_FOCUS: usize = 5;
const MORE_IN_FOCUS: usize = 10;
/// The number of products with the true matrix for the optimum. No rig could take this many photos.
const OPTIMUM: usize = 400;

pub(super) fn fig11(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Corner, bench.side(SIDE_IN_FOCUS))?;
    let contest = Contest::hold(bench, &stage, 0.0, MORE_IN_FOCUS, OPTIMUM)?;
    let Contest { target_light, minres, boxed, jacobi, .. } = &contest;
    let mut checks = vec![
        Check::of("residual without a box, 5 photos of MINRES, %")
            .at_most(percent(minres.answered_at(PHOTOS_IN_FOCUS)), 1.0)
            .refutes("2 photos", percent(minres.answered_at(2))),
    ];
    checks.extend(contest.against_uncompensated("corner", PHOTOS_IN_FOCUS, [0.4, 0.095])?);
    checks.extend([
        Check::of("ours: residual displayed, 5 photos with values kept in [0, 1], over the optimum")
            .at_most(boxed.displayed_at(PHOTOS_IN_FOCUS) / contest.bound, 1.02)
            .refutes("MINRES and clamping", minres.displayed_at(PHOTOS_IN_FOCUS) / contest.bound),
        Check::of("ours: residual displayed, 5 photos with values kept in [0, 1], %")
            .stated(percent(boxed.displayed_at(PHOTOS_IN_FOCUS))),
        Check::of("residual displayed by MINRES and clamping, 5 photos, %")
            .stated(percent(minres.displayed_at(PHOTOS_IN_FOCUS))),
        Check::of("residual displayed by projected Jacobi, 5 photos, %")
            .stated(percent(jacobi.displayed_at(PHOTOS_IN_FOCUS))),
        Check::of("optimum with values kept in [0, 1], % (proven from below)").stated(percent(contest.bound)),
        Check::of("uncompensated, %").stated(percent(contest.uncompensated)),
    ]);
    checks.extend(contest.frames_taken(PHOTOS_IN_FOCUS));
    Ok(Reproduced {
        setting: format!("corner, {}, 5 photos beside the white one", stage.resolution),
        checks,
        panels: target_light.panels(&contest.plain, &minres.shown_at(PHOTOS_IN_FOCUS)),
        plots: contest.plots(),
        photos: 1 + PHOTOS_IN_FOCUS,
        ..Reproduced::of(Figure::Fig11, bench.rig())
    })
}

const SIDE: usize = 100;
/// The number of photos after which the paper's run has converged (section 8.3), besides the white photo, and the number of our run.
const CONVERGED: usize = 8;
const PHOTOS: usize = 12;
/// The lower end α of the target's range. The paper gives no value.
const LIFT: f64 = 0.2;
/// The radii of the lens in tenths of a millimetre. The first one is the figure's.
const RADII: [u32; 3] = [130, 190, 260];

pub(super) fn fig12(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Room(RADII[0]), side)?;
    let contest = Contest::hold(bench, &stage, LIFT, PHOTOS, OPTIMUM)?;
    let Contest { target_light, minres, boxed, .. } = &contest;
    let mut checks = Vec::from(contest.against_uncompensated("room", CONVERGED, [0.75, 0.1])?);
    let shown = minres.shown_at(CONVERGED);
    let (stated, curves) = where_it_breaks(bench)?;
    let settled = |residuals: &[f64]| {
        let last = residuals.last().copied().unwrap_or(f64::NAN);
        good_from(&counted(residuals), |residual| (residual / last - 1.0).abs() <= 0.05)
    };
    let falling: Vec<f64> = (0..PHOTOS).map(|photo| 0.9_f64.powi(photo as i32)).collect();
    let least = |run: &MethodRun| {
        let first = counted(&run.displayed).into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
        first.map_or(f64::NAN, |(photos, _)| photos)
    };
    checks.extend([
        Check::of("room: photos from which on the residual displayed is within 5 % of that after 12")
            .at_most(settled(&minres.displayed), CONVERGED as f64)
            .refutes("a residual that falls by a tenth with each photo", settled(&falling)),
        Check::of("room: photos at which the residual displayed is least").stated(least(minres)),
        Check::of("room: share of the bars' lost contrast on the back wall that the photo regains, 8 photos")
            .at_least(target_light.regained(&shown), 0.25)
            .refutes("the target divided by the white photo", target_light.regained(&target_light.divided())),
    ]);
    let sheets = bench.stage(Set::SheetsOutOfFocus, side)?;
    let on_sheets = Contest::hold(bench, &sheets, LIFT, PHOTOS, OPTIMUM)?;
    checks.extend(on_sheets.against_uncompensated(
        "two sheets (not used to find the setting)",
        CONVERGED,
        [0.2, 0.12],
    )?);
    let over_optimum = |run: &MethodRun| run.displayed_at(PHOTOS) / contest.bound;
    checks.extend([
        Check::of("ours, room: residual displayed, 12 photos with values kept in [0, 1], over the optimum")
            .at_most(over_optimum(boxed), 1.05)
            .refutes("MINRES and clamping", over_optimum(minres)),
        Check::of("ours, two sheets: residual displayed, 12 photos with values kept in [0, 1], %")
            .stated(percent(on_sheets.boxed.displayed_at(PHOTOS))),
        Check::of("two sheets: residual displayed by MINRES and clamping, 12 photos, %")
            .stated(percent(on_sheets.minres.displayed_at(PHOTOS))),
        Check::of("room: optimum with values kept in [0, 1], % (proven from below)")
            .stated(percent(contest.bound)),
        Check::of("room: uncompensated, %").stated(percent(contest.uncompensated)),
    ]);
    checks.extend(stated);
    checks.extend(contest.frames_taken(PHOTOS));
    let mut plots = contest.plots();
    plots.push(curves);
    Ok(Reproduced {
        setting: format!(
            "a white room, {}, by a lens of 13 mm radius for camera and projector, focused 1.4 m ahead: the back wall is blurred by discs of {:.2} \
             pixels radius, which is mild; the target is mapped to [{LIFT}, 1]; {PHOTOS} photos beside the white one",
            stage.resolution,
            Set::blur_of_back_wall(RADII[0], side),
        ),
        checks,
        panels: target_light.panels(&contest.plain, &shown),
        plots,
        photos: 2 * (1 + PHOTOS),
        ..Reproduced::of(Figure::Fig12, bench.rig())
    })
}

/// MINRES and clamping for wider blurs, and for a target that is not mapped.
fn where_it_breaks(bench: &mut Bench) -> Result<(Vec<Check>, Plot)> {
    let side = bench.side(SIDE);
    let mut checks = Vec::new();
    let mut lines: Vec<(String, Points)> = Vec::new();
    for (tenths, lift) in RADII.map(|tenths| (tenths, LIFT)).into_iter().chain([(RADII[0], 0.0)]) {
        let stage = bench.stage(Set::Room(tenths), side)?;
        let name = match lift {
            0.0 => "room, target not mapped".into(),
            _ => format!("room, blur of {:.2} pixels", Set::blur_of_back_wall(tenths, side)),
        };
        let operator = &mut bench.photos(&stage, Part::Full)?;
        let light = TargetLight::new(&stage, operator, lift)?;
        let minres = light.run(operator, (Method::Minres, false), PHOTOS)?;
        let uncompensated = light.residual(&light.plain());
        let over = |residual: f64| residual / uncompensated;
        let answer = minres.answers.get(CONVERGED - 1).map_or(&[][..], Vec::as_slice);
        checks.extend([
            Check::of(format!("{name}: residual displayed, 8 photos, over that uncompensated"))
                .stated(over(minres.displayed_at(CONVERGED))),
            Check::of(format!("{name}: residual before clamping, 8 photos, over that uncompensated"))
                .stated(over(minres.answered_at(CONVERGED))),
            Check::of(format!("{name}: pixels that clamping changes, %"))
                .stated(percent(TargetLight::clamped_share(answer))),
        ]);
        lines.push((
            name,
            counted(&minres.displayed.iter().map(|&residual| over(residual)).collect::<Vec<_>>()),
        ));
    }
    let caption = "Where MINRES and clamping help: the residual displayed over that uncompensated. Above 1 the pattern is worse than the target \
                   itself.";
    let plot = Plot::logarithmic(caption, ["photos", "residual, relative to uncompensated"], lines)
        .marked(1.0, "uncompensated");
    Ok((checks, plot))
}

/// The number of photos that figure 10 shows.
const FIRST: usize = 5;

pub(super) fn fig10(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Room(RADII[0]), bench.side(SIDE))?;
    let operator = &mut bench.photos(&stage, Part::Full)?;
    let light = TargetLight::new(&stage, operator, LIFT)?;
    let minres = light.run(operator, (Method::Minres, false), PHOTOS)?;
    let first = &minres.shots[..FIRST.min(minres.shots.len())];
    let random = Start::default().block(stage.pixels(), FIRST);
    let random: Vec<Product> =
        random.into_iter().zip(first).map(|(from, shot)| Product { from, ..shot.clone() }).collect();
    let wanted = light.wanted();
    let best = light.residual(&best_of(first, &wanted));
    Ok(Reproduced {
        setting: format!("the room of figure 12, {}, the run of MINRES", stage.resolution),
        checks: vec![
            Check::of("largest part of a pattern outside the span of the target and of the photos before")
                .at_most(outside(&wanted, first), 1e-6)
                .refutes("random patterns", outside(&wanted, &random)),
            Check::of(format!(
                "residual of MINRES after {FIRST} photos, over that of the best combination of their patterns"
            ))
            .at_most(minres.answered_at(FIRST) / best, 1.05)
            .refutes("3 photos of MINRES", minres.answered_at(3) / best),
            Check::of(format!("residual of MINRES after {FIRST} photos, before clamping, %"))
                .stated(percent(minres.answered_at(FIRST))),
        ],
        strips: vec![Strip {
            caption: "MINRES: above what is projected, below its photo; blue is negative. The first is the target, and each is made from the photos \
                      before it."
                .into(),
            resolution: stage.resolution,
            photos: first.to_vec(),
        }],
        photos: 1 + PHOTOS,
        ..Reproduced::of(Figure::Fig10, bench.rig())
    })
}

/// The largest part of a pattern outside the span of `start` and of the patterns and photos before it.
fn outside(start: &[f64], shots: &[Product]) -> f64 {
    largest_outside(vec![start.to_vec()], shots.iter().map(|shot| [shot.from.clone(), shot.to.clone()]))
}

/// The combination of the patterns whose photos, as they were taken, combine best to `wanted`.
fn best_of(shots: &[Product], wanted: &[f64]) -> Vec<f64> {
    let rows = faer::Mat::from_fn(wanted.len(), shots.len(), |row, column| shots[column].to[row]);
    let wanted = faer::Mat::from_fn(wanted.len(), 1, |row, _| wanted[row]);
    let found = faer::linalg::solvers::SolveLstsq::solve_lstsq(&rows.qr(), &wanted);
    let mut pattern = vec![0.0; wanted.nrows()];
    shots.iter().enumerate().for_each(|(column, shot)| add(&mut pattern, found[(column, 0)], &shot.from));
    pattern
}

#[cfg(test)]
mod tests {
    use super::super::vectors::dot;
    use super::*;

    #[test]
    fn patterns_from_photos_are_inside_and_others_are_not() {
        let axis = |at: usize| -> Vec<f64> { (0..4).map(|pixel| f64::from(u8::from(pixel == at))).collect() };
        let shot = |from: Vec<f64>, to: Vec<f64>| Product { from, to };
        let run = [shot(axis(0), axis(1)), shot(axis(1), axis(2)), shot(axis(2), axis(3))];
        assert!(outside(&axis(0), &run) < 1e-14, "rounding");
        assert!((outside(&axis(3), &run) - 1.0).abs() < 1e-14, "the first pattern is not the target");
        // The photos are the second and third axis, so the best combination for (1, 2, 3, 4) takes 2 and 3 of the patterns.
        let best = best_of(&run[..2], &[1.0, 2.0, 3.0, 4.0]);
        assert!(best.iter().zip([2.0, 3.0, 0.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{best:?}");
        assert_eq!(dot(&best, &axis(3)), 0.0);
    }
}
