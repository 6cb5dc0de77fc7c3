//! Inverse transport: a photo without its interreflections.
//!
//! A photo is `y = A p = D p + G p`. The direct-only image is `z = D p = D A⁻¹ y`, whatever the pattern `p` was, and solves
//!
//! ```text
//! (I + G D⁻¹) z = y
//! ```
//!
//! a system of which all eigenvalues are positive and most are near 1, so that it is solved in a few dozen products. Of a model
//! these cost no photo. Seitz, Matsushita and Kutulakos, *A theory of inverse light transport* (2005), doi:10.1109/ICCV.2005.25,
//! whose `C₁` is `D A⁻¹`.

use crate::error::{Error, Result};
use crate::krylov::{Method, SolveOptions, Status, solve};
use crate::observer::Observer;
use crate::operator::{Operator, Symmetry, block};

/// Pixels whose direct light is below this share of the greatest get none from the projector as far as can be told: what they
/// send on is left to the others.
const DARK: f64 = 1e-6;

/// A photo without its interreflections.
#[derive(Clone, Debug, PartialEq)]
pub struct Cancelled {
    /// `z = D A⁻¹ y` (`n`).
    pub direct: Vec<f64>,
    /// `A⁻¹ y` (`n`): the pattern that it was taken under; 0 at pixels without direct light.
    pub pattern: Vec<f64>,
    /// `‖y − (I + G D⁻¹) z‖ / ‖y‖`.
    pub residual: f64,
    /// Products with `G`.
    pub products: usize,
    /// Why it ended.
    pub status: Status,
}

/// Takes the interreflections out of `photo` (`n`, ambient light subtracted), given the light transport without its direct part,
/// `global` (`n × n`; [`LowRank::global`](super::LowRank::global), or the true one), and the diagonal of that, `direct` (`n`);
/// within `products` products with `global`, to a relative residual of 1e-6.
///
/// # Errors
/// [`Error::Dimension`]; [`Error::Numerical`] when no pixel has direct light; as [`solve`].
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
        if length != n {
            return Err(Error::Dimension { what, expected: n.to_string(), found: length.to_string() });
        }
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

/// `I + G D⁻¹`.
struct Scaled<'a> {
    global: &'a mut dyn Operator,
    inverse: &'a [f64],
}

impl Operator for Scaled<'_> {
    fn rows(&self) -> usize {
        self.inverse.len()
    }

    fn cols(&self) -> usize {
        self.inverse.len()
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        let pattern: Vec<f64> = x.iter().zip(self.inverse).map(|(x, inverse)| x * inverse).collect();
        self.global.apply(&pattern, y)?;
        y.iter_mut().zip(x).for_each(|(y, x)| *y += x);
        Ok(())
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        let scaled = |x: &&[f64]| x.iter().zip(self.inverse).map(|(x, inverse)| x * inverse).collect();
        let patterns: Vec<Vec<f64>> = xs.iter().map(scaled).collect();
        self.global.apply_block(&block(&patterns), ys)?;
        for (y, x) in ys.iter_mut().zip(xs) {
            y.iter_mut().zip(*x).for_each(|(y, x)| *y += x);
        }
        Ok(())
    }

    fn block_size(&self) -> usize {
        self.global.block_size()
    }

    fn observer(&self) -> &dyn Observer {
        self.global.observer()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LowRank, LowRankCapture, capture};
    use super::*;

    /// `G = u uᵀ / 10 + v vᵀ / 20` of 8 pixels: a model of two photos knows all of it.
    struct RankTwo;

    impl Operator for RankTwo {
        fn rows(&self) -> usize {
            8
        }

        fn cols(&self) -> usize {
            8
        }

        fn symmetry(&self) -> Symmetry {
            Symmetry::Symmetric
        }

        fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
            let v = |i: usize| (i % 3) as f64;
            let (sum, weighted) =
                x.iter().enumerate().fold((0.0, 0.0), |(s, w), (i, x)| (s + x, w + v(i) * x));
            for (i, y) in y.iter_mut().enumerate() {
                *y = sum / 10.0 + v(i) * weighted / 20.0;
            }
            Ok(())
        }
    }

    #[test]
    fn any_photo_is_reduced_to_its_direct_light() -> Result<()> {
        // Pixel 3 is black: it sends nothing back directly, and what it was lit with cannot be known.
        let direct: Vec<f64> = (0..8).map(|i| if i == 3 { 0.0 } else { 1.0 + 0.25 * i as f64 }).collect();
        let model =
            capture(&mut RankTwo, &direct, &LowRankCapture { photos: 2, ..LowRankCapture::default() })?;
        for seed in 0..3 {
            let pattern: Vec<f64> =
                (0..8).map(|i| if i == 3 { 0.0 } else { ((seed + 5 * i) % 7) as f64 / 7.0 }).collect();
            let found = cancel_interreflections(&mut model.global(), &direct, &model.relight(&pattern), 50)?;
            for i in 0..8 {
                // The solver's tolerance is 1e-6 of the photo, which is below 10.
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
