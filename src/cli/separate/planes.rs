//! Sums and differences of planes of light.

use crate::report::separation::Planes;

/// `a + b`.
pub(super) fn sum(a: &Planes, b: &Planes) -> Planes {
    combined(a, b, |a, b| a + b)
}

/// `a − b`.
pub(super) fn difference(a: &Planes, b: &Planes) -> Planes {
    combined(a, b, |a, b| a - b)
}

fn combined(a: &Planes, b: &Planes, with: fn(f64, f64) -> f64) -> Planes {
    let plane = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(&a, &b)| with(a, b)).collect();
    a.iter().zip(b).map(plane).collect()
}
