//! The light of a fold that is sharp at every scale, and what eigenvalues it can have.
//!
//! From a strip at distance `s` from the crease on one face, the share `K(s, t) dt` goes to that at `t` on the other:
//!
//! ```text
//! K(s, t) = s t sin²φ / (2 (s² + t² − 2 s t cos φ)^{3/2})
//! ```
//!
//! for the opening angle `φ`. `K` is homogeneous of degree −1, so that `s^{-a}` is an eigenfunction on the half line, of the eigenvalue
//! `κ(a) = ∫ K(1, t) t^{-a} dt`. Those with `a = ½ + iω` fill a continuous spectrum, with its edge at `ω = 0`. Global light of albedo `ρ` and
//! up to six bounces is the polynomial `g(κ) = Σ ρ^{b−1} κ^b`, `b` from 1 to 5, and the normalized cut divides it by that of even light,
//! `g(κ(0))`. `guide/src/concepts/segmentation.md` tells what follows.

/// The albedo of the scenes' paper.
const ALBEDO: f64 = 0.8;
/// Bounces between the faces: a path of six surfaces has five, the first of which is direct light's second.
const BOUNCES: i32 = 5;

/// `κ(a)` at `a = real + i·imaginary`; its imaginary part vanishes on `real = ½`, and for real `a`.
fn kernel(angle: f64, [real, imaginary]: [f64; 2]) -> f64 {
    // t = e^x. The integrand falls exponentially at both ends, where the trapezoid rule converges faster than any power of the step.
    const REACH: f64 = 60.0;
    const STEPS: i32 = 24_000;
    let step = 2.0 * REACH / f64::from(STEPS);
    let at = |index: i32| {
        let x = step * f64::from(index) - REACH;
        let t = x.exp();
        let distance = 1.0 + t * t - 2.0 * t * angle.cos();
        let share = t * angle.sin().powi(2) / (2.0 * distance.powf(1.5));
        share * (x * (1.0 - real)).exp() * (imaginary * x).cos()
    };
    step * (0..=STEPS).map(at).sum::<f64>()
}

/// `g(κ)`.
fn bounced(kernel: f64) -> f64 {
    (1..=BOUNCES).map(|bounce| ALBEDO.powi(bounce - 1) * kernel.powi(bounce)).sum()
}

/// The eigenvalue of the normalized cut at `a = ½ + iω` of a fold with this opening angle; its edge is at `ω = 0`.
pub(super) fn continuous(angle: f64, frequency: f64) -> f64 {
    bounced(kernel(angle, [0.5, frequency])) / bounced(kernel(angle, [0.0, 0.0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_light_is_shared_as_by_form_factors() {
        // All that leaves one face of an infinite fold towards the other: (1 + cos φ) / 2, the form factor of two half planes.
        for angle in [0.6_f64, 1.176, std::f64::consts::FRAC_PI_2] {
            let wanted = (1.0 + angle.cos()) / 2.0;
            assert!((kernel(angle, [0.0, 0.0]) - wanted).abs() < 1e-9, "quadrature at {angle}");
        }
    }

    #[test]
    fn the_edge_of_the_zigzag_is_that_of_the_guide() {
        let angle = 2.0 * (0.2_f64 / 0.3).atan();
        assert!((continuous(angle, 0.0) - 0.790).abs() < 5e-4, "{}", continuous(angle, 0.0));
        // Faster oscillations are farther below.
        assert!(continuous(angle, 0.5) < continuous(angle, 0.0));
    }
}
