//! The spectral density by stochastic Lanczos quadrature.

use super::super::factor::{Factorization, Lanczos, Step, Which};
use super::probe::{Estimate, at_least, signs, symmetric};
use crate::error::Result;
use crate::operator::Operator;

/// An estimate of the distribution of the eigenvalues of a symmetric operator of `n × n`.
#[derive(Clone, Debug)]
pub struct SpectralDensity {
    /// For each probe, nodes `θ` and weights `τ²` (which sum to 1) of its Gauss quadrature.
    pub quadratures: Vec<Vec<(f64, f64)>>,
    /// The dimension `n`.
    pub n: usize,
    /// The number of products taken.
    pub products: usize,
}

impl SpectralDensity {
    /// `tr f(A)`, e.g. `f = 1` for `n`, a step for a count of eigenvalues, `ln` for `ln det A`.
    ///
    /// Exact in each probe for polynomials up to degree `2 m − 1`, and then as good as Hutchinson's
    /// estimator.
    pub fn trace_of(&self, f: impl Fn(f64) -> f64) -> Estimate {
        let samples: Vec<f64> = self
            .quadratures
            .iter()
            .map(|nodes| self.n as f64 * nodes.iter().map(|(node, weight)| weight * f(*node)).sum::<f64>())
            .collect();
        Estimate::of(&samples, self.products)
    }

    /// The density at `at`, smoothed by a Gaussian of standard deviation `width`; its integral is 1.
    pub fn density(&self, at: f64, width: f64) -> Estimate {
        let height = 1.0 / (width * (2.0 * std::f64::consts::PI).sqrt() * self.n as f64);
        self.trace_of(|node| height * (-0.5 * ((at - node) / width).powi(2)).exp())
    }

    /// The smallest and the largest node: within the spectrum, and near its ends.
    pub fn range(&self) -> (f64, f64) {
        let nodes = self.quadratures.iter().flatten().map(|(node, _)| *node);
        nodes.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), node| (low.min(node), high.max(node)))
    }
}

/// The spectral density of a symmetric `A` (`n × n`) from `probes ≥ 2` Lanczos processes of `steps ≥ 1` steps
/// each.
///
/// The Ritz values of a process that starts from `ω/‖ω‖`, with the squares of the first entries of their
/// vectors, are the nodes and weights of the Gauss quadrature for `ωᵀ f(A) ω / ‖ω‖²`; its mean over random
/// signs `ω` is `tr f(A) / n`. Takes at most `probes × steps` products: a process that finds an invariant
/// subspace is exact, and stops.
///
/// # Errors
/// [`Error::Option`](crate::Error::Option) naming `--probes` or `--steps`; else as
/// [`Factorization::expand`].
///
/// # References
/// Ubaru, Chen and Saad, *Fast estimation of tr(f(A)) via stochastic Lanczos quadrature* (2017),
/// doi:10.1137/16M1104974; Lin, Saad and Yang, *Approximating spectral densities of large matrices* (2016),
/// doi:10.1137/130934283.
pub fn spectral_density(
    operator: &mut dyn Operator,
    probes: usize,
    steps: usize,
    seed: u64,
) -> Result<SpectralDensity> {
    symmetric(operator, "the spectral density")?;
    at_least(probes, 2, "--probes")?;
    at_least(steps, 1, "steps")?;
    let n = operator.cols();
    let mut quadratures = Vec::with_capacity(probes);
    let mut products = 0;
    for start in signs(n, probes, seed) {
        let mut lanczos = Lanczos::new(&start, &[])?;
        while lanczos.steps() < steps && lanczos.expand(operator)? == Step::Extended {}
        products += lanczos.products();
        let pairs = lanczos.ritz(Which::SmallestAlgebraic, lanczos.steps())?;
        quadratures.push(pairs.iter().map(|pair| (pair.value, pair.coefficients[0].powi(2))).collect());
    }
    Ok(SpectralDensity { quadratures, n, products })
}
