//! The photos of a low-rank model: a Krylov process that stores its photos.

use std::ops::Range;

use super::LowRank;
use super::model::add;
use crate::analysis::probe::{default_sigma, smooth_patterns};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::krylov::{Factorization, Start, dot, norm};
use crate::observer::{Estimate, Step};
use crate::operator::{Operator, Product, Recorded, Symmetry};
use crate::sparse::{Csr, Mapped};

/// The options of a low-rank capture.
#[derive(Clone, Debug)]
pub struct LowRankCapture {
    /// The number of photos of the process, which is also the rank `k` of `W Qᵀ`; at least 1.
    pub photos: usize,
    /// The first pattern. The default `None` means all ones, so that the capture includes the white photo and begins with smooth patterns.
    pub start: Option<Start>,
    /// Further start vectors of the first block, for a symmetric operator. Other operators ignore them. A single start finds one vector per
    /// eigenspace. It hardly separates similar regions that exchange no light, such as the cups of an egg carton, but [`smooth_starts`]
    /// separate them.
    pub beside: Vec<Vec<f64>>,
    /// The map `W` from camera to projector (`n × m`), if photos and patterns have different sizes. The process then projects `W` times its
    /// photos.
    pub map: Option<Csr>,
}

/// Returns the smooth random patterns (`n` each) at these places of the sequence of this seed, for [`LowRankCapture::beside`]. They are
/// random signs blurred by a sixteenth of the width, because global light and natural images are smooth as well.
///
/// For an egg carton at 100×100, a model of 40 photos with eleven of these starts in addition to white relights checkerboards, stripes and
/// a half-lit field with errors of 3.2 to 4.7 %. With white alone, it relights four natural images with errors of 2.2 to 5.9 %.
pub fn smooth_starts(resolution: Resolution, places: Range<usize>, seed: u64) -> Vec<Vec<f64>> {
    smooth_patterns(resolution, std::f64::consts::SQRT_2 * default_sigma(resolution), places, seed)
}

impl Default for LowRankCapture {
    fn default() -> Self {
        Self { photos: 40, start: None, beside: Vec::new(), map: None }
    }
}

/// Captures a model from `photos` photos with `operator` (`m × n`, without its direct light). `direct` is the direct image under white
/// (`n`), or empty if direct light stays in the operator. The operator's observer sees each photo ([`Estimate::Unpredicted`]). If the
/// observer breaks, the capture ends with the photos taken so far.
///
/// # Errors
/// [`Error::Option`] naming `--photos`; [`Error::Dimension`] if `operator` is not square and there is no map, or if `direct` has another length; any
/// error of the operator.
pub fn capture(operator: &mut dyn Operator, direct: &[f64], options: &LowRankCapture) -> Result<LowRank> {
    let n = operator.cols();
    if options.photos == 0 {
        return Err(Error::option("--photos", "no photo makes no model").help("give at least 1; 40 is usual"));
    }
    let symmetric = operator.symmetry() == Symmetry::Symmetric;
    let start = options.start.as_ref().map_or_else(|| vec![1.0; n], |start| start.vector(n));
    let mut recorder = Recorded::new(operator);
    let basis = if symmetric {
        let mut block = vec![start];
        // If the block were wider than the number of photos, some start vectors would never be photographed.
        block.extend(options.beside.iter().take(options.photos - 1).cloned());
        run(Factorization::block_lanczos(&block, &[])?, &mut recorder, (options.photos, symmetric), None)?
    } else {
        let map = options.map.as_ref();
        run(Factorization::arnoldi(&start, &[])?, &mut recorder, (options.photos, symmetric), map)?
    };
    let photos = recorder.products.into_iter().take(basis.len()).map(|product| product.to).collect();
    LowRank::new(basis, photos, direct.to_vec(), symmetric)
}

/// Runs the process for a number of photos, or until the space is exhausted, and returns its basis.
fn run(
    mut process: Factorization,
    recorder: &mut Recorded<'_, dyn Operator + '_>,
    (photos, symmetric): (usize, bool),
    map: Option<&Csr>,
) -> Result<Vec<Vec<f64>>> {
    while process.steps() < photos && !process.is_exhausted() {
        let left = photos - process.steps();
        match map {
            None => {
                process.multiply_block(recorder, left)?;
                process.expand(recorder)?;
            }
            Some(map) => {
                let mut mapped = Mapped { operator: &mut *recorder, map };
                process.multiply_block(&mut mapped, left)?;
                process.expand(&mut mapped)?;
            }
        }
        let taken = &recorder.products[..process.products()];
        let step = Step {
            stage: "photos",
            done: taken.len() as u64,
            total: photos as u64,
            estimate: Estimate::Unpredicted(unpredicted(taken, symmetric)),
        };
        if recorder.observer().step(&step).is_break() {
            break;
        }
    }
    Ok(process.basis().to_vec())
}

/// The part of the last photo that the model of the earlier photos did not predict: `‖w − Q Wᵀ q‖` for the last pattern `q` (of norm 1) and
/// its photo `w`, relative to the strongest photo. `Q` holds the earlier patterns, and `W` their photos. This part falls with the error of
/// the model. Without symmetry, the model predicts nothing for a new orthogonal pattern.
fn unpredicted(products: &[Product], symmetric: bool) -> f64 {
    let Some((last, before)) = products.split_last() else { return 1.0 };
    let mut rest = last.to.clone();
    if symmetric {
        for known in before {
            add(&mut rest, -dot(&known.to, &last.from), &known.from);
        }
    }
    let strongest = products.iter().map(|product| norm(&product.to)).fold(0.0, f64::max);
    if strongest > 0.0 { norm(&rest) / strongest } else { 0.0 }
}

/// A pattern adds only noise if less than this share of its norm lies outside the span of the earlier patterns.
const NEW: f64 = 1e-3;

/// Makes the model from products `G x`, in the order in which they were taken. `G` is all light except direct light. The patterns need not
/// be orthogonal. `direct` has the same meaning as in [`LowRank::new`]. Fails with [`Error::Numerical`] if all patterns are dark, and with
/// [`Error::Dimension`] if lengths differ.
pub fn from_products(products: Vec<Product>, direct: Vec<f64>, symmetric: bool) -> Result<LowRank> {
    let (mut basis, mut photos): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    for Product { from: mut pattern, to: mut photo } in products {
        let before = norm(&pattern);
        // A second pass removes the rounding errors of the first pass.
        for _ in 0..2 {
            for (q, w) in basis.iter().zip(&photos) {
                let share = dot(q, &pattern);
                add(&mut pattern, -share, q);
                add(&mut photo, -share, w);
            }
        }
        let rest = norm(&pattern);
        if rest <= NEW * before || !rest.is_finite() {
            continue;
        }
        for vector in [&mut pattern, &mut photo] {
            vector.iter_mut().for_each(|value| *value /= rest);
        }
        basis.push(pattern);
        photos.push(photo);
    }
    if basis.is_empty() {
        return Err(Error::Numerical("among the photos there is none of a pattern with light in it".into()));
    }
    LowRank::new(basis, photos, direct, symmetric)
}

/// Estimates unmeasured direct light as a share of the white photo, from `products` that include all light. The share is the median of
/// `θ = vᵀ D^-½ A D^-½ v` over the newer half of the directions `v` of the products. Direct light dominates in these directions, because
/// global light is smooth.
pub fn estimated_direct(products: &[Product], white: &[f64]) -> Result<Vec<f64>> {
    let floor = 1e-3 * white.iter().copied().fold(0.0, f64::max);
    let root: Vec<f64> = white.iter().map(|white| white.max(floor).sqrt()).collect();
    let scaled = |Product { from, to }: &Product| Product {
        from: from.iter().zip(&root).map(|(x, s)| x * s).collect(),
        to: to.iter().zip(&root).map(|(y, s)| y / s).collect(),
    };
    let model = from_products(products.iter().map(scaled).collect(), Vec::new(), false)?;
    let quotients = model.basis().iter().zip(model.photos()).map(|(v, w)| dot(v, w));
    let mut newer: Vec<f64> = quotients.skip(model.rank() / 2).collect();
    newer.sort_by(f64::total_cmp);
    let share = newer.get(newer.len() / 2).copied().unwrap_or(0.0).clamp(0.0, 1.0);
    Ok(white.iter().map(|white| share * white).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `D + u uᵀ` with constant direct light.
    fn light(x: &[f64], direct: f64) -> Vec<f64> {
        let u = |i: usize| 0.05 + 0.0005 * i as f64;
        let share: f64 = x.iter().enumerate().map(|(i, x)| u(i) * x).sum();
        x.iter().enumerate().map(|(i, x)| direct * x + u(i) * share).collect()
    }

    #[test]
    fn patterns_of_any_kind_make_the_model_that_orthonormal_ones_would() -> Result<()> {
        let n = 9;
        let pattern = |k: usize| (0..n).map(|i| ((i * (k + 2)) % 5) as f64 / 5.0).collect::<Vec<f64>>();
        // The last pattern depends on the first.
        let mut patterns: Vec<Vec<f64>> = (0..3).map(pattern).collect();
        patterns.push(patterns[0].iter().map(|value| 2.0 * value).collect());
        let products = patterns.iter().map(|x| Product { from: x.clone(), to: light(x, 0.0) }).collect();
        let model = from_products(products, vec![0.5; n], true)?;
        assert_eq!(model.rank(), 3);
        for x in &patterns {
            for (found, expected) in model.relight(x).iter().zip(light(x, 0.5)) {
                assert!((found - expected).abs() < 1e-13, "rounding: {found} {expected}");
            }
        }
        let dark = Product { from: vec![0.0; n], to: vec![0.0; n] };
        assert!(matches!(from_products(vec![dark], Vec::new(), true), Err(Error::Numerical(_))));
        Ok(())
    }

    #[test]
    fn an_even_direct_light_is_told_from_what_new_patterns_leave() -> Result<()> {
        let n = 60;
        let direct = 0.7;
        let pattern =
            |k: usize| (0..n).map(|i| ((i * i * (k + 3) + 7 * k) % 11) as f64 / 11.0).collect::<Vec<f64>>();
        let products: Vec<Product> =
            (0..12).map(|k| Product { to: light(&pattern(k), direct), from: pattern(k) }).collect();
        let white = light(&vec![1.0; n], direct);
        for found in estimated_direct(&products, &white)? {
            // The white photo varies by 12 %, and so does the estimate.
            assert!((direct - found).abs() < 0.1 * direct, "{found}");
        }
        Ok(())
    }
}
