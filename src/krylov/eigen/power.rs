//! Power iteration, one product per step.

use std::ops::ControlFlow;

use super::{Eigs, EigsOptions, Found, good_enough, spent};
use crate::error::{Error, Result};
use crate::krylov::basis::{dot, norm};
use crate::krylov::completeness::{Recorder, Stats, Status};
use crate::krylov::factor::{Factorization, RitzPair, Which, point_upwards};
use crate::operator::{Operator, Symmetry, check_square};

/// Power iteration, `x ← A x / ‖A x‖`: finds the eigenpair `A x = θ x` of largest magnitude of an `A` of `n × n`.
///
/// The product that makes the next vector also gives the Rayleigh quotient `θ = xᵀA x` and the residual `A x − θ x`. They cost no further
/// product. The result is the vector before the last product. Each product multiplies the error by `|λ₂/λ₁|`. Lanczos converges faster, at
/// a rate of about `2 √gap`. Known vectors are projected out of every product.
///
/// The method stores four vectors of `n`. `which` must be [`Which::LargestMagnitude`], or [`Which::LargestAlgebraic`] if the dominant
/// eigenvalue is known to be positive (as for a matrix without negative entries: Perron). `count` must be 1.
///
/// O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*, section 4, Algorithm 1. As written there, a step
/// takes two products, one of them for the Rayleigh quotient.
pub(super) fn power(operator: &mut dyn Operator, options: &EigsOptions) -> Result<Eigs> {
    let n = operator.cols();
    check(operator, options)?;
    // The factorization checks, orthonormalizes and projects the start as for Lanczos, and takes no step.
    let start = Factorization::lanczos(&options.start.vector(n), &options.deflate)?;
    let known = start.known();
    let Some(first) = start.waiting().first() else {
        return Err(Error::Numerical("the known vectors span the whole space".into()));
    };
    let (mut x, mut product) = (first.clone(), vec![0.0; n]);
    let mut best: Vec<f64> = Vec::new();
    let mut pairs: Vec<RitzPair> = Vec::new();
    let mut scale = 0.0_f64;
    let mut recorder = Recorder::new(options.products);
    let mut products = 0;
    let status = loop {
        if let Some(status) = good_enough(&pairs, options, (scale, n)) {
            break status;
        }
        if products >= options.products {
            break spent(&pairs, options, scale);
        }
        operator.apply(&x, &mut product)?;
        products += 1;
        let length = norm(&product);
        if !length.is_finite() {
            return Err(Error::Numerical(format!(
                "product {products} with the operator holds a NaN or an infinity"
            )));
        }
        scale = scale.max(length);
        let value = dot(&x, &product);
        // ‖A x − θ x‖ is computed from the vector, because the difference of squares would lose half the digits.
        let residual = distance(&product, &x, value);
        let noise = operator.standard_error();
        pairs = vec![pair([value, residual, noise], scale, n, operator.symmetry())];
        best.clone_from(&x);
        let flow = recorder.row(operator.observer(), products, [(value, residual)].into_iter());
        for vector in known {
            let share = dot(vector, &product);
            product.iter_mut().zip(vector).for_each(|(value, entry)| *value -= share * entry);
        }
        let length = norm(&product);
        if flow == ControlFlow::Break(()) {
            break Status::Stopped;
        }
        if length == 0.0 {
            break Status::Breakdown("a product of the power iteration is zero");
        }
        x.iter_mut().zip(&product).for_each(|(next, value)| *next = value / length);
    };
    point_upwards(&mut best);
    let common = vec![operator.common_error(&best)?];
    let found =
        Found { pairs: &pairs, vectors: vec![best], common, imaginary: vec![Vec::new()], scale, rows: n };
    Ok(found.eigs(options, 0.0, recorder.history, Stats { products, status }))
}

fn pair([value, residual, noise]: [f64; 3], scale: f64, n: usize, symmetry: Symmetry) -> RitzPair {
    RitzPair {
        value,
        residual,
        // The left eigenvector is unknown.
        condition: if symmetry == Symmetry::Symmetric { 1.0 } else { f64::INFINITY },
        rounding: f64::EPSILON * scale * (10.0 + (n as f64).sqrt()),
        noise,
        unresolved: (residual * residual - noise * noise).max(0.0).sqrt(),
        coefficients: vec![1.0],
        ..RitzPair::default()
    }
}

fn distance(product: &[f64], x: &[f64], value: f64) -> f64 {
    product.iter().zip(x).map(|(product, x)| (product - value * x).powi(2)).sum::<f64>().sqrt()
}

fn check(operator: &dyn Operator, options: &EigsOptions) -> Result<()> {
    check_square("the operator of a power iteration", operator.cols(), operator)?;
    let refuse = |option: &str, fault: &str, help: &str| Err(Error::option(option, fault).help(help));
    if options.count != 1 {
        return refuse("--count", "power iteration finds one eigenpair", "ask for 1, or use another method");
    }
    if !matches!(options.which, Which::LargestMagnitude | Which::LargestAlgebraic) {
        return refuse(
            "--which",
            "power iteration finds the eigenvalue of largest magnitude",
            "use another method for other ends of the spectrum",
        );
    }
    Ok(())
}
