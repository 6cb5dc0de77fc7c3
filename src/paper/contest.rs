//! Compares compensation methods after equal numbers of photos: MINRES with clamping as in section 8.3 of the paper, box-constrained methods,
//! and the optimum. The target and the pictures are made here, too. The paper sets negative values of the pattern to zero; here values above
//! 1 are clamped as well, because no projector shows them.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::bench::{Bench, Stage};
use super::check::Check;
use super::figure::{Content, Panel, Plot, Points, counted};
use super::vectors::{minus, product};
use crate::analysis::compensate::Mixture;
use crate::analysis::similarity::similarity;
use crate::error::Result;
use crate::image::Image;
use crate::krylov::{Constraint, Diagonal, Method, SolveOptions, dot, norm, solve_adjoint};
use crate::observer::{Estimate, OnStep, Step};
use crate::operator::{Adjoint, Observed, Operator, Product, Recorded, Symmetry};
use crate::transport::Part;

/// The target of a compensation on a stage, in W/(m² sr), and the photo under white that determines its scale.
pub(super) struct TargetLight<'a> {
    stage: &'a Stage,
    /// The picture that the target shows, in [lift, 1].
    picture: Vec<f64>,
    pub(super) light: Vec<f64>,
    pub(super) peak: f64,
    white: Vec<f64>,
    /// The rig's reading for 1 W/(m² sr), from the white photo.
    unit: f64,
}

impl<'a> TargetLight<'a> {
    /// Maps the picture from [0, 1] to [`lift`, 1] (section 6.3 of the paper), and scales it by half the median of the white photo. Only its
    /// brightest parts are then infeasible.
    pub(super) fn new(stage: &'a Stage, operator: &mut dyn Adjoint, lift: f64) -> Result<Self> {
        let lifted = |value: f64| lift + (1.0 - lift) * value;
        let picture: Vec<f64> = picture(stage.resolution.width).into_iter().map(lifted).collect();
        let white = product(operator, &vec![1.0; picture.len()])?;
        let mut truth = stage.white();
        let unit = stage.reading(&white);
        truth.sort_by(f64::total_cmp);
        let peak = 0.5 * truth.get(truth.len() / 2).copied().unwrap_or(0.0);
        let light = picture.iter().map(|value| peak * value).collect();
        Ok(Self { stage, picture, light, peak, white, unit })
    }

    /// The relative residual `‖b − A x‖ / ‖b‖` with the true matrix, independent of the rig.
    pub(super) fn residual(&self, pattern: &[f64]) -> f64 {
        norm(&minus(&self.light, &self.stage.photo(pattern))) / norm(&self.light)
    }

    /// The structural similarity of the true photo of a pattern and the target; NaN for pictures smaller than its window.
    pub(super) fn ssim(&self, pattern: &[f64]) -> Result<f64> {
        let image = |values: Vec<f64>| Image::from_planes(self.stage.resolution, &[values]);
        let [photo, target] = [image(self.stage.photo(pattern))?, image(self.light.clone())?];
        Ok(similarity(&photo, &target, self.peak)?.ssim.unwrap_or(f64::NAN))
    }

    /// The contrast of the picture's bars on the back wall of the room in the true photo of a pattern, relative to their mean light and to
    /// the target. It is 1 if bright and dark bars are in the wanted proportion.
    pub(super) fn bar_contrast(&self, pattern: &[f64]) -> f64 {
        let width = self.stage.resolution.width;
        let sign = |pixel: usize| {
            let at = [pixel % width, pixel / width].map(|index| (index as f64 + 0.5) / width as f64);
            let is_on_wall = (0.22..0.78).contains(&at[0]) && at[1] < 0.78;
            match bar(at).filter(|_| is_on_wall) {
                Some(true) => 1.0,
                Some(false) => -1.0,
                None => 0.0,
            }
        };
        let mut signs: Vec<f64> = (0..self.picture.len()).map(sign).collect();
        let pixels = signs.iter().map(|sign| sign.abs()).sum::<f64>().max(1.0);
        let mean = signs.iter().sum::<f64>() / pixels;
        let lit: Vec<f64> = signs.iter().map(|sign| sign.abs()).collect();
        signs.iter_mut().filter(|sign| **sign != 0.0).for_each(|sign| *sign -= mean);
        let contrast = |light: &[f64]| dot(&signs, light) / dot(&lit, light);
        contrast(&self.stage.photo(pattern)) / contrast(&self.light)
    }

    /// The share of the bars' contrast that the target itself loses and the photo of `pattern` has again. More contrast than wanted counts
    /// as lost, too.
    pub(super) fn regained(&self, pattern: &[f64]) -> f64 {
        let off = |pattern: &[f64]| (1.0 - self.bar_contrast(pattern)).abs();
        1.0 - off(pattern) / off(&self.plain())
    }

    /// A wrong answer: the target divided by the photo under white, as if no pixel lit another.
    pub(super) fn divided(&self) -> Vec<f64> {
        let divide = |(light, white): (&f64, f64)| if white > 0.0 { light / white } else { 0.0 };
        clamped(&self.light.iter().zip(self.stage.white()).map(divide).collect::<Vec<_>>())
    }

    /// The share of pixels that clamping changes.
    pub(super) fn clamped_share(pattern: &[f64]) -> f64 {
        let is_outside = |value: &&f64| !(0.0..=1.0).contains(*value);
        pattern.iter().filter(is_outside).count() as f64 / pattern.len() as f64
    }

    /// The target's picture as a pattern, scaled as the target is.
    pub(super) fn plain(&self) -> Vec<f64> {
        clamped(&self.picture.iter().map(|value| 0.5 * value).collect::<Vec<_>>())
    }

    /// The target in the rig's units.
    pub(super) fn wanted(&self) -> Vec<f64> {
        self.light.iter().map(|light| self.unit * light).collect()
    }

    fn options(&self, method: Method, photos: usize) -> SolveOptions {
        let boxed = method.facts().constraint == Constraint::Box;
        let diagonal = boxed.then(|| self.white.clone());
        SolveOptions { products: photos, rtol: 0.0, diagonal, ..SolveOptions::default() }
    }

    /// Runs `method` for `photos` photos, and records its residuals after each. If `scaled`, the white photo is the preconditioner.
    pub(super) fn run(
        &self,
        operator: &mut dyn Adjoint,
        (method, scaled): (Method, bool),
        photos: usize,
    ) -> Result<MethodRun> {
        let mut options = self.options(method, photos);
        if scaled {
            // The floor limits the weight of very dark pixels, whose measurements are mostly noise.
            let floor = 1e-3 * self.white.iter().copied().fold(0.0, f64::max);
            let white = self.white.iter().map(|value| value.max(floor)).collect();
            options.preconditioner = Some(Arc::new(Diagonal::new(white)?));
        }
        let blurred = self.stage.set.is_out_of_focus() || operator.symmetry() != Symmetry::Symmetric;
        if method == Method::KrylovBox && blurred {
            options.surrogate = Some(Arc::new(Mixture::new(self.stage.resolution, &self.white)));
        }
        let mut run = MethodRun::default();
        let mut recorded = Recorded::new(operator);
        let observer = OnStep::new(|step: &Step<'_>| {
            let Estimate::Solution { iterate, .. } = step.estimate else { return ControlFlow::Continue(()) };
            let answer = iterate();
            // A step may take no photo. In methods that take pairs of photos, it may take two.
            while (run.answered.len() as u64) < step.done {
                self.record(&answer, &mut run);
            }
            ControlFlow::Continue(())
        });
        let wanted = self.wanted();
        let found = solve_adjoint(method, &mut Observed::new(&mut recorded, &observer), &wanted, &options)?;
        Ok(MethodRun { pattern: found.x, shots: recorded.products, frames: recorded.frames, ..run })
    }

    /// Records the residuals of the solution after one more photo.
    pub(super) fn record(&self, answer: &[f64], run: &mut MethodRun) {
        run.answered.push(self.residual(answer));
        run.displayed.push(self.residual(&clamped(answer)));
        run.answers.push(answer.to_vec());
    }

    /// A lower bound of the relative residual over all patterns in [0, 1], and the residual that the best pattern found attains.
    ///
    /// For the residual `r = b − A x` of a pattern `x`, convexity gives `½‖b − A z‖² ≥ ½‖r‖² + (Aᵀr)ᵀ(x − z)` for all patterns `z`. The
    /// minimum of the right side over the box is a sum over pixels (the Frank–Wolfe gap). Accelerated gradients give `x`, whose accuracy
    /// affects only the tightness of the bound.
    pub(super) fn optimum(&self, operator: &mut dyn Adjoint, products: usize) -> Result<(f64, f64)> {
        let mut options = self.options(Method::Fista, products);
        options.diagonal = Some(self.stage.white());
        let x = solve_adjoint(Method::Fista, operator, &self.light, &options)?.x;
        let misfit = minus(&self.light, &product(operator, &x)?);
        let mut gradient = vec![0.0; x.len()];
        operator.apply_adjoint(&misfit, &mut gradient)?;
        let gap =
            x.iter().zip(&gradient).map(|(x, g)| if *g > 0.0 { g * (1.0 - x) } else { -g * x }).sum::<f64>();
        let square = dot(&misfit, &misfit);
        let scale = norm(&self.light);
        Ok(((square - 2.0 * gap).max(0.0).sqrt() / scale, square.sqrt() / scale))
    }

    /// Pictures of the target, the photos with and without compensation, the pattern, and the errors. All photos share one exposure.
    pub(super) fn panels(&self, plain: &[f64], pattern: &[f64]) -> Vec<Panel> {
        let stage = self.stage;
        let light = |values: Vec<f64>| Content::Light { values, white: Some(self.peak) };
        let [seen, before] = [stage.photo(pattern), stage.photo(plain)];
        let error = |photo: &[f64]| Content::Signed(minus(photo, &self.light));
        let shown = Content::Light { values: pattern.to_vec(), white: Some(1.0) };
        let residual = |pattern: &[f64]| format!("residual {:.2} %", percent(self.residual(pattern)));
        vec![
            stage.panel("target", "The target, W/(m² sr)", light(self.light.clone())),
            stage.panel("before", format!("Projected as it is: {}", residual(plain)), light(before.clone())),
            stage.panel("after", format!("Compensated: {}", residual(pattern)), light(seen.clone())),
            stage.panel("pattern", "What is projected, 0 to 1", shown),
            stage.panel("error-before", "Projected as it is less the target, W/(m² sr)", error(&before)),
            stage.panel("error-after", "Compensated less the target, W/(m² sr)", error(&seen)),
        ]
    }
}

#[derive(Default)]
pub(super) struct MethodRun {
    /// The residual of the method's solution after each photo.
    pub(super) answered: Vec<f64>,
    /// The residual of that solution clamped to [0, 1], as a projector displays it.
    pub(super) displayed: Vec<f64>,
    /// The solution after each photo, not clamped.
    pub(super) answers: Vec<Vec<f64>>,
    /// The last solution, not clamped.
    pub(super) pattern: Vec<f64>,
    pub(super) shots: Vec<Product>,
    /// The number of frames that the camera had taken for the method after each photo; empty for an ideal rig.
    pub(super) frames: Vec<u64>,
}

impl MethodRun {
    /// The residual of the clamped solution after `photos` photos, or after the last photo if the method stopped earlier.
    pub(super) fn displayed_at(&self, photos: usize) -> f64 {
        at(&self.displayed, photos)
    }

    /// The smallest residual of the solutions that are not clamped; infinite without solutions.
    pub(super) fn least_answered(&self) -> f64 {
        self.answered.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The solution after `photos` photos, clamped to [0, 1]; empty without solutions.
    pub(super) fn shown_at(&self, photos: usize) -> Vec<f64> {
        let answer = self.answers.get(photos - 1).or(self.answers.last());
        clamped(answer.map_or(&[], Vec::as_slice))
    }

    /// The residual as [`MethodRun::displayed_at`], but of the solution without clamping.
    pub(super) fn answered_at(&self, photos: usize) -> f64 {
        at(&self.answered, photos)
    }
}

fn at(residuals: &[f64], photos: usize) -> f64 {
    residuals.get(photos - 1).or(residuals.last()).copied().unwrap_or(f64::NAN)
}

pub(super) struct Contest<'a> {
    pub(super) target_light: TargetLight<'a>,
    /// MINRES as in section 8.3 of the paper.
    pub(super) minres: MethodRun,
    pub(super) boxed: MethodRun,
    pub(super) jacobi: MethodRun,
    /// Lower bound of the residual; see [`TargetLight::optimum`].
    pub(super) bound: f64,
    pub(super) optimum: f64,
    /// The target picture used as a pattern, and its residual.
    pub(super) plain: Vec<f64>,
    pub(super) uncompensated: f64,
}

impl<'a> Contest<'a> {
    /// Runs the comparison for a target that is mapped to [`lift`, 1]: `photos` photos per method besides the white photo, and `products`
    /// true products for the optimum.
    pub(super) fn hold(
        bench: &mut Bench,
        stage: &'a Stage,
        lift: f64,
        photos: usize,
        products: usize,
    ) -> Result<Self> {
        let operator = &mut bench.photos(stage, Part::Full)?;
        let target_light = TargetLight::new(stage, operator, lift)?;
        let mut run = |method| target_light.run(operator, (method, false), photos);
        let [minres, boxed, jacobi] = [run(Method::Minres)?, run(Method::KrylovBox)?, run(Method::Jacobi)?];
        let (bound, optimum) = target_light.optimum(&mut bench.truth(stage, Part::Full)?, products)?;
        let plain = target_light.plain();
        let uncompensated = target_light.residual(&plain);
        Ok(Self { target_light, minres, boxed, jacobi, bound, optimum, plain, uncompensated })
    }

    /// Numbers that compare the photo of MINRES' clamped pattern after `photos` photos with the uncompensated photo: the residual of the one
    /// over that of the other, which has to be at most `share`, and what the structural similarity gains, at least `gain`.
    pub(super) fn against_uncompensated(
        &self,
        scene: &str,
        photos: usize,
        [share, gain]: [f64; 2],
    ) -> Result<[Check; 2]> {
        const DIVIDED: &str = "the target divided by the white photo";
        let of = &self.target_light;
        let (shown, divided) = (self.minres.shown_at(photos), of.divided());
        let gained = |pattern: &[f64]| -> Result<f64> { Ok(of.ssim(pattern)? - of.ssim(&self.plain)?) };
        let residual =
            format!("residual displayed by MINRES and clamping, {photos} photos, over that uncompensated");
        let similarity =
            format!("structural similarity to the target gained by MINRES and clamping, {photos} photos");
        Ok([
            Check::of(format!("{scene}: {residual}"))
                .at_most(of.residual(&shown) / self.uncompensated, share)
                .refutes(DIVIDED, of.residual(&divided) / self.uncompensated),
            Check::of(format!("{scene}: {similarity}"))
                .at_least(gained(&shown)?, gain)
                .refutes(DIVIDED, gained(&divided)?),
        ])
    }

    /// The methods whose patterns can be displayed, with the names of their curves.
    fn displayed(&self) -> [(&'static str, &MethodRun); 3] {
        [
            ("MINRES, then clamped", &self.minres),
            ("Krylov inside the box", &self.boxed),
            ("projected Jacobi", &self.jacobi),
        ]
    }

    /// The number of frames for each method's first `photos` photos, reported without a bound. There are none for an ideal rig.
    pub(super) fn frames_taken(&self, photos: usize) -> Vec<Check> {
        let taken = |(name, entry): (&str, &MethodRun)| {
            let frames = entry.frames.get(photos - 1).or(entry.frames.last())?;
            Some(Check::of(format!("frames of {photos} photos, {name}")).stated(*frames as f64))
        };
        self.displayed().into_iter().filter_map(taken).collect()
    }

    /// Plots of residuals after equal numbers of photos and, for a rig, of clamped patterns' residuals after equal numbers of frames.
    pub(super) fn plots(&self) -> Vec<Plot> {
        let plot = |caption: &str, axis: &str, lines: Vec<(&str, Points)>| {
            Plot::logarithmic(caption, [axis, "relative residual"], lines)
                .marked(self.uncompensated, "uncompensated")
                .marked(self.optimum, "best inside the box")
        };
        let mut lines = vec![("MINRES, not clamped", counted(&self.minres.answered))];
        lines.extend(self.displayed().map(|(name, run)| (name, counted(&run.displayed))));
        let caption = "Relative residual by the light itself, at equal photos (the white one not counted).";
        let mut plots = vec![plot(caption, "photos", lines)];
        let over_frames = over_frames(&self.displayed());
        if !over_frames.is_empty() {
            let caption = "The same, displayed, at equal frames: what the camera takes for each method. A photo of a signed pattern is that of \
                           two, and every pattern has its takes and exposures; sentinels are among them. Black, white and the choice of exposures \
                           are common to all methods and not counted.";
            plots.push(plot(caption, "frames", over_frames));
        }
        plots
    }
}

pub(super) fn clamped(pattern: &[f64]) -> Vec<f64> {
    pattern.iter().map(|value| value.clamp(0.0, 1.0)).collect()
}

/// Curves of the clamped patterns' residuals over the frames taken. There are none for an ideal rig, which takes no frames.
pub(super) fn over_frames<'a>(entries: &[(&'a str, &MethodRun)]) -> Vec<(&'a str, Points)> {
    let line = |&(name, entry): &(&'a str, &MethodRun)| {
        let points = entry.frames.iter().zip(&entry.displayed).map(|(&taken, &seen)| (taken as f64, seen));
        (name, points.collect())
    };
    let lines: Vec<(&str, Points)> = entries.iter().map(line).collect();
    if lines.iter().all(|(_, points)| points.is_empty()) { Vec::new() } else { lines }
}

pub(super) fn percent(share: f64) -> f64 {
    100.0 * share
}

/// A picture of `side × side` values in [0.02, 1]: a soft gradient, a bright disc with a dark ring, bars that become finer to the
/// right, and a staircase of grays. It has edges in all directions and large uniform areas.
fn picture(side: usize) -> Vec<f64> {
    let pixels = (0..side).flat_map(|row| (0..side).map(move |column| (row, column)));
    pixels
        .map(|(row, column)| {
            let (x, y) = ((column as f64 + 0.5) / side as f64, (row as f64 + 0.5) / side as f64);
            value(x, y)
        })
        .collect()
}

/// The value at `x` from the left and `y` from the top, both in [0, 1].
fn value(x: f64, y: f64) -> f64 {
    let from_center = (x - 0.5).hypot(y - 0.4);
    if from_center < 0.16 {
        return 1.0;
    }
    if from_center < 0.26 {
        return 0.02;
    }
    if y > 0.86 {
        return 0.02 + 0.19 * (6.0 * x).floor().min(5.0);
    }
    if let Some(is_bright) = bar([x, y]) {
        return if is_bright { 0.9 } else { 0.1 };
    }
    0.35 + 0.3 * x + 0.1 * (1.0 - y)
}

/// Whether a point is on a bright or on a dark bar; `None` off the bars. The bars have widths of 1/12, 1/16 and 1/24 of the picture.
fn bar([x, y]: [f64; 2]) -> Option<bool> {
    let bars = match x {
        _ if x < 1.0 / 3.0 => 12.0,
        _ if x < 2.0 / 3.0 => 16.0,
        _ => 24.0,
    };
    (0.72..0.82).contains(&y).then(|| ((bars * x) as usize).is_multiple_of(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_can_be_projected_and_edges_are_there() {
        let picture = picture(100);
        assert!(picture.iter().all(|value| (0.02..=1.0).contains(value)));
        let edges = picture.windows(2).filter(|pair| (pair[0] - pair[1]).abs() > 0.1).count();
        // The bars alone have nine edges in each of ten rows, the staircase has five in 14 rows, and disc and ring have four in most of 52
        // rows.
        assert!(edges > 9 * 10 + 5 * 14 + 2 * 52, "{edges} of 10,000 neighbours differ");
    }
}
