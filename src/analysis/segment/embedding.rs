//! The coordinates of pixels in the space of eigenvectors. K-means groups the pixels by these coordinates.
//!
//! A pixel's coordinates are its entries in the eigenvectors `u` (`uᵀ W u = 1`, where `W` holds the pixels' weights), each divided by
//! `√(1 − λ)`. Distances between pixels are then commute times: the time that light takes from one pixel to another and back (Qiu and
//! Hancock, 2007, doi:10.1109/TPAMI.2007.1103).
//!
//! Some small sets of pixels exchange light almost only among themselves: flat spots that see only a sliver of the scene, or pixels with
//! the noise of a rare light path. The normalized cut treats each set as a region. The set has an eigenvalue near 1 and a localized
//! eigenvector. The entries of this eigenvector are so large, `1/√d`, that it weighs as much in k-means as any other eigenvector (Zhang and
//! Rohe, *Understanding regularized spectral clustering via graph conductance*, 2018, arXiv:1806.01468). The entries of each eigenvector
//! are therefore clamped to a range. The range leaves out the pixels at either end that have [`LEAST_SHARE`] of all light. Smaller sets
//! lose their influence; nothing else changes. The remedy of Zhang and Rohe, an edge `μ` between all pixels, would move all eigenvalues. It
//! would not suffice to leave out localized eigenvectors: for equal eigenvalues, Lanczos finds one mixture of the small set and all
//! regions.

use rayon::prelude::*;

use super::graph::Graph;
use super::options::Cut;
use crate::krylov::RitzPair;

/// A set of pixels with a smaller share of all light is not a group.
pub(super) const LEAST_SHARE: f64 = 1.0 / 500.0;

/// If clamping leaves less than this share of the squared norm of an eigenvector, the eigenvector is localized.
const LOCAL: f64 = 0.1;

/// This value replaces any smaller distance of an eigenvalue from 1, so that no eigenvector outweighs another by more than `1/√FLOOR`.
const FLOOR: f64 = 1e-3;

/// The map from eigenvectors to coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Embedding {
    /// The factor of each eigenvector (`k`): `1/√(1 − λ)`, or 0 for the known eigenvector, which is constant.
    pub weights: Vec<f64>,
    /// The range to which the entries of each eigenvector are clamped (`k`). The pixels beyond each end have a five-hundredth of the light.
    pub ranges: Vec<(f64, f64)>,
    /// The share of each eigenvector's squared norm that clamping leaves (`k`): nearly 1 for regions, nearly 0 for a localized eigenvector.
    pub within: Vec<f64>,
    /// The distance of each eigenvalue from the known eigenvalue (`k`): `1 − λ`, or for the average cut, `λ` relative to the mean degree.
    pub(super) gaps: Vec<f64>,
}

impl Embedding {
    /// Makes the embedding from `vectors` on `m` nodes with `weights`. The first vector is known; `pairs` belong to the other vectors.
    pub(super) fn new(
        cut: Cut,
        graph: &Graph,
        pairs: &[RitzPair],
        vectors: &[Vec<f64>],
        weights: &[f64],
    ) -> Self {
        // The eigenvalues and residuals of the average cut are in units of degree.
        let unit = match cut {
            Cut::Normalized => 1.0,
            Cut::Average => mean(graph.degree()),
        };
        let gap = |pair: &RitzPair| match cut {
            Cut::Normalized => 1.0 - pair.value,
            Cut::Average => -pair.value / unit,
        };
        let gaps: Vec<f64> = std::iter::once(0.0).chain(pairs.iter().map(gap)).collect();
        let weight = |(pair, &gap): (&RitzPair, &f64)| weight(gap, pair.residual / unit);
        let ranges: Vec<(f64, f64)> = vectors.par_iter().map(|vector| range(vector, weights)).collect();
        Self {
            weights: std::iter::once(0.0).chain(pairs.iter().zip(&gaps[1..]).map(weight)).collect(),
            within: vectors
                .iter()
                .zip(&ranges)
                .map(|(vector, &range)| within(vector, weights, range))
                .collect(),
            ranges,
            gaps,
        }
    }

    /// Makes the entries themselves the coordinates: all factors are 1, and nothing is clamped.
    pub(super) fn make_plain(&mut self) {
        self.weights.iter_mut().skip(1).for_each(|weight| *weight = 1.0);
        self.ranges.fill((f64::NEG_INFINITY, f64::INFINITY));
    }

    /// Whether entries are clamped, so that sets of few pixels have no influence.
    pub(super) fn is_clamped(&self) -> bool {
        self.ranges.iter().any(|(low, high)| low.is_finite() || high.is_finite())
    }

    /// Returns true if another vector (`m`, `uᵀ W u = 1`) with these weights is localized; see [`Embedding::is_local`].
    pub(super) fn would_be_local(vector: &[f64], weights: &[f64]) -> bool {
        within(vector, weights, range(vector, weights)) < LOCAL
    }

    pub(super) fn truncate(&mut self, count: usize) {
        self.weights.truncate(count);
        self.ranges.truncate(count);
        self.within.truncate(count);
        self.gaps.truncate(count);
    }

    /// The coordinate of a pixel along an eigenvector, computed from the pixel's entry in the eigenvector.
    pub fn coordinate(&self, eigenvector: usize, entry: f64) -> f64 {
        let (low, high) = self.ranges[eigenvector];
        self.weights[eigenvector] * entry.max(low).min(high)
    }

    /// Returns true if an eigenvector is localized, so that it contains no information on regions.
    pub fn is_local(&self, eigenvector: usize) -> bool {
        self.within[eigenvector] < LOCAL
    }

    /// The number of localized eigenvectors.
    pub fn local(&self) -> usize {
        (0..self.within.len()).filter(|&index| self.is_local(index)).count()
    }
}

fn within(vector: &[f64], weights: &[f64], (low, high): (f64, f64)) -> f64 {
    vector.iter().zip(weights).map(|(u, weight)| weight * u.max(low).min(high).powi(2)).sum()
}

/// The factor of an eigenvector with the gap `1 − λ`, which is known only up to the `residual`. If the gap is smaller than the residual,
/// the residual replaces the gap. The residual does not include noise that a low-pass filter removed.
fn weight(gap: f64, residual: f64) -> f64 {
    1.0 / gap.max(residual).max(FLOOR).sqrt()
}

/// The range of a vector's entries, without the entries at either end that have [`LEAST_SHARE`] of all weight.
fn range(vector: &[f64], weights: &[f64]) -> (f64, f64) {
    let mut order: Vec<usize> = (0..vector.len()).collect();
    order.sort_by(|&a, &b| vector[a].total_cmp(&vector[b]));
    let share = LEAST_SHARE * weights.iter().sum::<f64>();
    let end = |order: &mut dyn Iterator<Item = usize>| {
        let mut sum = 0.0;
        let mut past = order.skip_while(|&index| {
            sum += weights[index];
            sum < share
        });
        past.next().map_or(0.0, |index| vector[index])
    };
    (end(&mut order.iter().copied()), end(&mut order.iter().rev().copied()))
}

pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unresolved_eigenvector_weighs_no_more_than_its_residual_allows() {
        assert_eq!(weight(0.25, 0.0), 2.0);
        assert_eq!(weight(0.01, 0.25), 2.0, "the gap may be the residual's error");
        assert_eq!(weight(-1e-9, 0.0), 1.0 / FLOOR.sqrt());
    }

    fn pair(value: f64, residual: f64) -> RitzPair {
        RitzPair {
            value,
            imaginary: 0.0,
            residual,
            gap: f64::INFINITY,
            condition: 1.0,
            rounding: 0.0,
            noise: 0.0,
            asymmetric: 0.0,
            unresolved: 0.0,
            coefficients: Vec::new(),
            imaginary_coefficients: Vec::new(),
        }
    }

    #[test]
    fn the_residual_of_each_pair_bounds_the_weight_of_its_eigenvector() {
        let photo = |_: &[f64]| unreachable!("every pixel sees light");
        let graph = Graph::measure(&[2.0, 6.0], 0.0, 0.0, photo).expect("a graph");
        let vectors = vec![vec![0.5, 0.5]; 3];
        let embedded =
            |cut, pairs: [RitzPair; 2]| Embedding::new(cut, &graph, &pairs, &vectors, &[1.0, 1.0]).weights;
        // In binary, 1 − 0.75 and 1 − 0.984375 have no rounding errors.
        let pairs = [pair(0.75, 1e-6), pair(0.984_375, 0.0625)];
        assert_eq!(embedded(Cut::Normalized, pairs), [0.0, 2.0, 4.0]);
        // Eigenvalues and residuals of the average cut are relative to the mean degree, 4.
        let pairs = [pair(-1.0, 4e-6), pair(-0.0625, 0.25)];
        assert_eq!(embedded(Cut::Average, pairs), [0.0, 2.0, 4.0]);
    }

    #[test]
    fn a_range_leaves_out_the_least_share_of_weight_at_either_end() {
        let vector: Vec<f64> = (0..1000).map(f64::from).collect();
        // The share is two of a thousand equal weights, so it is reached at the second entry from either end.
        assert_eq!(range(&vector, &vec![1.0; 1000]), (1.0, 998.0));
        let mut weights = vec![1.0; 1000];
        weights[..3].fill(0.1);
        assert_eq!(range(&vector, &weights), (4.0, 998.0));
        // With few nodes, each node weighs more than the share.
        assert_eq!(range(&[3.0, -1.0, 2.0], &[1.0; 3]), (-1.0, 3.0));
    }
}
