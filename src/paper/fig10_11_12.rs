//! Figures 10, 11 and 12: compensation in focus after five photos, compensation out of focus after 8 and 12 photos, and its photos in
//! order.

use super::bench::{Bench, Set, Stage};
use super::contest::{Contest, MethodRun, TargetLight, at_equal_costs, clamped, frames_taken, percent};
use super::figure::{Check, Figure, Reproduced, Strip};
use crate::error::Result;
use crate::image::Resolution;
use crate::krylov::Method;
use crate::transport::Part;

const SIDE_IN_FOCUS: usize = 100;
/// The number of photos besides the white photo.
const PHOTOS_IN_FOCUS: usize = 5;
const MORE_IN_FOCUS: usize = 10;
/// The number of products with the true matrix for the optimum. No rig could take this many photos.
const OPTIMUM_IN_FOCUS: usize = 600;

pub(super) fn fig11(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Corner, bench.side(SIDE_IN_FOCUS))?;
    let contest = Contest::hold(bench, &stage, Method::Minres, MORE_IN_FOCUS, OPTIMUM_IN_FOCUS)?;
    let Contest { target_light, recipe, scaled, boxed, jacobi, .. } = &contest;
    let entries =
        [("MINRES, then clamped", recipe), ("Krylov inside the box", boxed), ("projected Jacobi", jacobi)];
    let mut checks = vec![
        Check::of("residual without a box, 5 photos of MINRES, %")
            .at_most(percent(recipe.answered_at(PHOTOS_IN_FOCUS)), 1.0),
        Check::of("the same scaled by the white photo, %")
            .stated(percent(scaled.answered_at(PHOTOS_IN_FOCUS))),
        Check::of("residual displayed, 5 photos inside the box, over the optimum")
            .at_most(boxed.displayed_at(PHOTOS_IN_FOCUS) / contest.bound, 1.02),
        Check::of("residual displayed, 5 photos inside the box, %")
            .stated(percent(boxed.displayed_at(PHOTOS_IN_FOCUS))),
        Check::of("residual displayed by the recipe that clamps, 5 photos, %")
            .stated(percent(recipe.displayed_at(PHOTOS_IN_FOCUS))),
        Check::of("residual displayed by projected Jacobi, 5 photos, %")
            .stated(percent(jacobi.displayed_at(PHOTOS_IN_FOCUS))),
        Check::of("optimum inside the box, % (proven from below)").stated(percent(contest.bound)),
        Check::of("uncompensated, %").stated(percent(contest.uncompensated)),
    ];
    checks.extend(frames_taken(&entries, PHOTOS_IN_FOCUS));
    let lines = [
        ("MINRES, not clamped", &*recipe.answered),
        ("MINRES, then clamped", &recipe.displayed),
        ("Krylov inside the box", &boxed.displayed),
        ("projected Jacobi", &jacobi.displayed),
    ];
    let operator = &mut bench.photos(&stage, Part::Full)?;
    let short = target_light.run(operator, (Method::KrylovBox, false), PHOTOS_IN_FOCUS)?;
    Ok(Reproduced {
        setting: format!("corner, {}, 5 photos beside the white one", stage.resolution),
        checks,
        panels: target_light.panels(&contest.plain, &short),
        plots: at_equal_costs(&lines, &entries, contest.uncompensated, contest.optimum),
        photos: 1 + PHOTOS_IN_FOCUS,
        ..Reproduced::of(Figure::Fig11, bench.rig())
    })
}

pub(super) const SIDE: usize = 128;
/// The number of photos besides the white photo.
pub(super) const PHOTOS: usize = 12;
/// A larger number of photos, which shows whether more photos would suffice.
const MORE: usize = 36;
/// The required ratio of the residual to the optimum.
const NEARLY: f64 = 1.05;
/// The number of products with the matrix and its transpose for the optimum, which converges slowly out of focus.
const OPTIMUM: usize = 2000;

pub(super) fn fig12(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Defocused, bench.side(SIDE))?;
    let contest = Contest::hold(bench, &stage, Method::Gmres, PHOTOS, OPTIMUM)?;
    let Contest { target_light, recipe, scaled, boxed, jacobi, .. } = &contest;
    let worst = |clamped: &MethodRun| {
        (1..=PHOTOS)
            .map(|k| boxed.displayed_at(k) / clamped.displayed_at(k))
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let pattern = clamped(&boxed.pattern);
    let sharper = edges(&pattern, stage.resolution) / edges(&contest.plain, stage.resolution);
    let mut within = Check::of("residual displayed, 12 photos inside the box, over the optimum")
        .at_most(boxed.displayed_at(PHOTOS) / contest.bound, NEARLY);
    if !within.is_met() {
        within = within.because(transpose_is_missing(bench, &stage, contest.bound)?);
    }
    let mut checks = vec![
        within,
        Check::of("the same over what clamping displays, the worst of 1 to 12 photos").at_most(worst(recipe), 1.0),
        Check::of("the same over clamping what is scaled by the white photo (both begin alike), the worst of 1 to 12").stated(worst(scaled)),
        Check::of("strength of edges in what is projected, over the picture's").at_least(sharper, 1.2),
    ];
    for photos in [8, PHOTOS] {
        checks.push(
            Check::of(format!("residual displayed, {photos} photos inside the box, %"))
                .stated(percent(boxed.displayed_at(photos))),
        );
        checks.push(
            Check::of(format!("residual displayed by GMRES and clamping, {photos} photos, %"))
                .stated(percent(recipe.displayed_at(photos))),
        );
    }
    checks.extend([
        Check::of("optimum inside the box, % (proven from below)").stated(percent(contest.bound)),
        Check::of("uncompensated, %").stated(percent(contest.uncompensated)),
    ]);
    checks.push(Check::of("with the camera out of focus, too: residual displayed, 12 photos inside the box, over the optimum").at_most(both_lenses(bench)?, NEARLY));
    let entries = [
        ("GMRES, then clamped", recipe),
        ("GMRES scaled by the white photo, then clamped", scaled),
        ("Krylov inside the box", boxed),
        ("projected Jacobi", jacobi),
    ];
    checks.extend(frames_taken(&entries, PHOTOS));
    let lines = [
        ("GMRES, not clamped", &*recipe.answered),
        ("GMRES, then clamped", &recipe.displayed),
        ("GMRES scaled by the white photo, then clamped", &scaled.displayed),
        ("Krylov inside the box", &boxed.displayed),
        ("projected Jacobi", &jacobi.displayed),
    ];
    Ok(Reproduced {
        setting: format!(
            "corner by a projector lens of 70 mm focused at 2.4 m, {}, 12 photos beside the white one",
            stage.resolution
        ),
        checks,
        panels: target_light.panels(&contest.plain, boxed),
        plots: at_equal_costs(&lines, &entries, contest.uncompensated, contest.optimum),
        photos: 2 * (1 + PHOTOS),
        ..Reproduced::of(Figure::Fig12, bench.rig())
    })
}

/// The reason why twelve photos may not be enough. It is found by runs on the matrix itself: with the same number of products, with more
/// products, and with the same number that includes products with the transpose.
fn transpose_is_missing(bench: &mut Bench, stage: &Stage, bound: f64) -> Result<String> {
    let operator = &mut bench.truth(stage, Part::Full)?;
    let light = TargetLight::new(stage, operator)?;
    let boxed = light.run(operator, (Method::KrylovBox, false), MORE)?;
    let from = (1..=MORE).find(|&photos| boxed.displayed_at(photos) <= NEARLY * bound);
    let (_, with_transpose) = light.optimum(operator, 2 * MORE)?;
    Ok(format!(
        "No photo is one of the transpose, which the gradient of the residual needs; a mixture of blurs that is fitted to the photos stands for \
         it. On the matrix itself, without any device, the method displays {:.3} times the optimum after {PHOTOS} photos, and {} within 5 %. \
         Accelerated gradients with the true transpose display {:.3} times it after {MORE} products of either kind.",
        boxed.displayed_at(PHOTOS) / bound,
        from.map_or(format!("{MORE} photos are not enough to come"), |photos| format!(
            "{photos} photos come"
        )),
        with_transpose / bound,
    ))
}

/// The ratio of the box-constrained method's final residual to the lower bound, with equal lenses for camera and projector.
fn both_lenses(bench: &mut Bench) -> Result<f64> {
    let stage = bench.stage(Set::BothDefocused, bench.side(SIDE))?;
    let operator = &mut bench.photos(&stage, Part::Full)?;
    let target_light = TargetLight::new(&stage, operator)?;
    let boxed = target_light.run(operator, (Method::KrylovBox, false), PHOTOS)?;
    let (bound, _) = target_light.optimum(&mut bench.truth(&stage, Part::Full)?, OPTIMUM)?;
    Ok(boxed.displayed_at(PHOTOS) / bound)
}

/// The root mean square of the differences between neighbouring pixels, relative to the mean value.
fn edges(image: &[f64], Resolution { width, height }: Resolution) -> f64 {
    let mean = image.iter().sum::<f64>() / image.len() as f64;
    let pixels = (1..height).flat_map(|y| (1..width).map(move |x| y * width + x));
    let (mut squares, mut count) = (0.0, 0_usize);
    for at in pixels {
        squares += (image[at] - image[at - 1]).powi(2) + (image[at] - image[at - width]).powi(2);
        count += 1;
    }
    (squares / count.max(1) as f64).sqrt() / mean
}

/// The number of photos in the paper's shorter run, which must suffice.
const FEWER: usize = 8;
/// A residual counts as good if it exceeds the residual after all photos by at most this fraction.
const ENOUGH: f64 = 0.05;

pub(super) fn fig10(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Defocused, bench.side(SIDE))?;
    let mut strips = Vec::new();
    let mut checks = Vec::new();
    for (name, method, caption) in [
        (
            "the method inside the box",
            Method::KrylovBox,
            "Inside the box: candidates between 0 and 1, and residuals of both signs where a gradient is wanted.",
        ),
        (
            "GMRES",
            Method::Gmres,
            "GMRES: above what is projected, below its photo; blue is negative. Each is made from the photos before it.",
        ),
    ] {
        let operator = &mut bench.photos(&stage, Part::Full)?;
        let entry = TargetLight::new(&stage, operator)?.run(operator, (method, false), PHOTOS)?;
        if method == Method::KrylovBox {
            checks.push(
                Check::of(format!(
                    "photos until {name} displays what is within 5 % of the residual after {PHOTOS}"
                ))
                .at_most(enough(&entry) as f64, FEWER as f64),
            );
        }
        checks.push(
            Check::of(format!("residual displayed by {name} after {PHOTOS} photos, %"))
                .stated(percent(entry.displayed_at(PHOTOS))),
        );
        strips.push(Strip { caption: caption.into(), resolution: stage.resolution, photos: entry.shots });
    }
    Ok(Reproduced {
        setting: format!("corner out of focus, {}, the runs of figure 12", stage.resolution),
        checks,
        strips,
        photos: 2 * (1 + PHOTOS),
        ..Reproduced::of(Figure::Fig10, bench.rig())
    })
}

/// The number of photos after which the residual of the clamped pattern is nearly as good as after all photos.
fn enough(entry: &MethodRun) -> usize {
    let wanted = (1.0 + ENOUGH) * entry.displayed_at(PHOTOS);
    let worse =
        |&photos: &usize| entry.displayed_at(photos).partial_cmp(&wanted).is_none_or(|order| order.is_gt());
    (1..=PHOTOS).rev().find(worse).map_or(1, |last| last + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_grow_with_their_height_and_not_with_brightness() {
        let resolution = Resolution::new(4, 4);
        let step = |low: f64, high: f64| -> Vec<f64> {
            (0..16).map(|pixel| if pixel % 4 < 2 { low } else { high }).collect()
        };
        let soft = edges(&step(1.0, 1.2), resolution);
        assert!(edges(&step(1.0, 2.0), resolution) > 3.0 * soft);
        assert!((edges(&step(10.0, 12.0), resolution) - soft).abs() < 1e-12, "rounding");
        assert_eq!(edges(&[3.0; 16], resolution), 0.0);
    }

    #[test]
    fn photos_are_enough_after_the_last_that_were_not() {
        let of = |residuals: Vec<f64>| enough(&MethodRun { displayed: residuals, ..MethodRun::default() });
        assert_eq!(of(vec![0.5, 0.1, 0.3, 0.104, 0.1]), 4);
        assert_eq!(of(vec![0.1; 12]), 1);
        assert_eq!(of(vec![0.2, f64::NAN, 0.1]), 3);
    }
}
