//! Inverse transport: removes the interreflections from a photo.
//!
//! A photo is `y = A p = D p + G p`. The direct image is `z = D p = D A⁻¹ y` for any pattern `p`. It solves
//!
//! ```text
//! (I + G D⁻¹) z = y
//! ```
//!
//! All eigenvalues of this system are positive and most are near 1, so a solver takes only a few dozen products. With a model, these
//! products cost no photo. The source is Seitz, Matsushita and Kutulakos, *A theory of inverse light transport* (2005),
//! doi:10.1109/ICCV.2005.25; `D A⁻¹` is their `C₁`.

use crate::error::{Error, Result};
use crate::krylov::{Method, SolveOptions, Status, solve};
use crate::operator::{Operator, Symmetry, between, delegate};

/// Pixels with less than this share of the largest direct light count as unlit. Light from unlit pixels is attributed to the other pixels.
const DARK: f64 = 1e-6;

/// The result of [`cancel_interreflections`].
#[derive(Clone, Debug, PartialEq)]
pub struct Cancelled {
    /// The direct image `z = D A⁻¹ y` (`n`).
    pub direct: Vec<f64>,
    /// The pattern `A⁻¹ y` (`n`) under which the photo was taken; 0 at pixels without direct light.
    pub pattern: Vec<f64>,
    /// The relative residual `‖y − (I + G D⁻¹) z‖ / ‖y‖`.
    pub residual: f64,
    /// Number of products with `G`.
    pub products: usize,
    /// The reason why the solver ended.
    pub status: Status,
}

/// Removes the interreflections from `photo` (`n`, without ambient light). `global` is light transport without its direct part (`n × n`),
/// either from a model ([`LowRank::global`](super::LowRank::global)) or the true transport. `direct` is the diagonal of the direct part
/// (`n`). Takes at most `products` products with `global`, to a relative residual of 1e-6.
///
/// # Errors
/// [`Error::Dimension`] if sizes differ; [`Error::Numerical`] if no pixel has direct light; the errors of [`solve`].
pub fn cancel_interreflections(
    global: &mut dyn Operator,
    direct: &[f64],
    photo: &[f64],
    products: usize,
) -> Result<Cancelled> {
    let n = global.cols();
    for (what, length) in [
        ("rows of the global part of light transport", global.rows()),
        ("pixels of the direct image", direct.len()),
        ("pixels of the photo", photo.len()),
    ] {
        Error::check_size(what, n, length)?;
    }
    let most = direct.iter().copied().fold(0.0, f64::max);
    if most <= 0.0 {
        return Err(Error::Numerical(
            "no pixel has direct light, so there is nothing that a photo could be reduced to".into(),
        ));
    }
    let inverse: Vec<f64> = direct.iter().map(|&d| if d > DARK * most { 1.0 / d } else { 0.0 }).collect();
    let options = SolveOptions { products, rtol: 1e-6, ..SolveOptions::default() };
    let mut system = Scaled { global, inverse: &inverse };
    let found = solve(Method::Gmres, &mut system, photo, &options)?;
    let pattern: Vec<f64> = found.x.iter().zip(&inverse).map(|(z, inverse)| z * inverse).collect();
    let direct = found.x.iter().zip(&inverse).map(|(z, &inverse)| if inverse > 0.0 { *z } else { 0.0 });
    Ok(Cancelled {
        direct: direct.collect(),
        pattern,
        residual: found.residual,
        products: found.stats.products,
        status: found.stats.status,
    })
}

/// The operator `I + G D⁻¹`.
struct Scaled<'a> {
    global: &'a mut dyn Operator,
    inverse: &'a [f64],
}

impl Operator for Scaled<'_> {
    delegate!(global: rows, cols, block_size, observer);

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        let inverse = self.inverse;
        let before = |x: &[f64]| x.iter().zip(inverse).map(|(x, inverse)| x * inverse).collect();
        let after = |x: &[f64], photo: &[f64], y: &mut [f64]| {
            y.iter_mut().zip(photo).zip(x).for_each(|((y, photo), x)| *y = photo + x);
        };
        between(self.global, (xs, ys), before, after)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LowRank, LowRankCapture, capture};
    use super::*;
    use crate::operator::Closure;

    /// `G = u uᵀ / 10 + v vᵀ / 20` for 8 pixels. A model of two photos represents it exactly.
    fn rank_two() -> impl Operator {
        Closure::new(8, 8, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
            let v = |i: usize| (i % 3) as f64;
            let (sum, weighted) =
                x.iter().enumerate().fold((0.0, 0.0), |(s, w), (i, x)| (s + x, w + v(i) * x));
            for (i, y) in y.iter_mut().enumerate() {
                *y = sum / 10.0 + v(i) * weighted / 20.0;
            }
            Ok(())
        })
    }

    #[test]
    fn any_photo_is_reduced_to_its_direct_light() -> Result<()> {
        // Pixel 3 is black. It returns no direct light, and its pattern value cannot be recovered.
        let direct: Vec<f64> = (0..8).map(|i| if i == 3 { 0.0 } else { 1.0 + 0.25 * i as f64 }).collect();
        let model =
            capture(&mut rank_two(), &direct, &LowRankCapture { photos: 2, ..LowRankCapture::default() })?;
        for seed in 0..3 {
            let pattern: Vec<f64> =
                (0..8).map(|i| if i == 3 { 0.0 } else { ((seed + 5 * i) % 7) as f64 / 7.0 }).collect();
            let found = cancel_interreflections(&mut model.global(), &direct, &model.relight(&pattern), 50)?;
            for i in 0..8 {
                // The solver's tolerance is 1e-6 times the norm of the photo, which is below 10.
                assert!((found.direct[i] - direct[i] * pattern[i]).abs() < 1e-5, "direct light at {i}");
                assert!((found.pattern[i] - pattern[i]).abs() < 1e-5, "pattern at {i}");
            }
        }
        Ok(())
    }

    #[test]
    fn a_scene_without_direct_light_is_refused() -> Result<()> {
        let model = LowRank::new(vec![vec![1.0, 0.0]], vec![vec![0.5, 0.5]], Vec::new(), true)?;
        let refused = cancel_interreflections(&mut model.global(), &[0.0; 2], &[1.0; 2], 10);
        assert!(matches!(refused, Err(Error::Numerical(_))));
        assert!(cancel_interreflections(&mut model.global(), &[1.0; 3], &[1.0; 2], 10).is_err());
        Ok(())
    }
}
