//! A low-rank model from products that were taken for another purpose.

use super::LowRank;
use crate::error::{Error, Result};
use crate::krylov::{dot, norm};
use crate::operator::Product;

/// A pattern adds only noise if less than this share of its norm lies outside the span of the earlier patterns.
const NEW: f64 = 1e-3;

/// The model of products `G x`, in the order in which they were taken; `G` is all light but the direct part. The patterns need
/// not be orthogonal. `direct` has the meaning that it has in [`LowRank::new`]. Fails with [`Error::Numerical`] if all patterns
/// are dark, and with [`Error::Dimension`] if lengths differ.
pub fn from_products(products: Vec<Product>, direct: Vec<f64>, symmetric: bool) -> Result<LowRank> {
    let (mut basis, mut photos): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    for Product { from: mut pattern, to: mut photo } in products {
        let before = norm(&pattern);
        // The second pass removes the rounding errors of the first.
        for _ in 0..2 {
            for (q, w) in basis.iter().zip(&photos) {
                let share = dot(q, &pattern);
                subtract(&mut pattern, share, q);
                subtract(&mut photo, share, w);
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

/// Estimates unmeasured direct light as a share of the white photo. The share is the median of `θ = vᵀ D^-½ A D^-½ v` over the
/// newer half of the directions `v` of `products` with all light. Direct light prevails there, because global light is smooth.
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

fn subtract(from: &mut [f64], factor: f64, vector: &[f64]) {
    from.iter_mut().zip(vector).for_each(|(from, value)| *from -= factor * value);
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
