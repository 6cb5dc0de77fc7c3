//! Where pixels lie in the space of eigenvectors: the points that k-means groups.
//!
//! A pixel's coordinates are its entries in the eigenvectors `u` (`uᵀ W u = 1`, with `W` what each pixel counts), each over `√(1
//! − λ)`. Their distances are those of the commute time, how long light takes from one pixel to the other and back (Qiu and
//! Hancock, 2007, doi:10.1109/TPAMI.2007.1103).
//!
//! A few pixels are no group. Some exchange light with next to nobody but each other: flat spots that see a sliver, noise of a
//! light path that nobody else took. Each such set is a region as far as the normalized cut can tell, with an eigenvalue near 1
//! of its own and entries so large, `1/√d`, that it weighs in k-means as much as any other (Zhang and Rohe, *Understanding
//! regularized spectral clustering via graph conductance*, 2018, arXiv:1806.01468). So the entries of each eigenvector are held
//! to the range that they have without the [`LEAST_SHARE`] of all light at either end. What has less light than that has no say,
//! and all else is as before. Their cure, an edge `μ` between all pixels, moves all eigenvalues; and to leave out such
//! eigenvectors would not do: where eigenvalues are equal, Lanczos sees one mixture, of the few pixels and of all regions.

use super::graph::Graph;
use super::options::Cut;
use crate::krylov::RitzPair;

/// A set of pixels with a smaller share of all light is no group.
pub(super) const LEAST_SHARE: f64 = 1.0 / 500.0;

/// An eigenvector of whose norm less than this is left within its range is one of a few pixels alone.
const LOCAL: f64 = 0.1;

/// An eigenvalue nearer to 1 than this counts as 1: no vector may outweigh the next by more than `1/√FLOOR`.
const FLOOR: f64 = 1e-3;

/// How eigenvectors become coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Embedding {
    /// What each eigenvector is multiplied by (`k`): `1/√(1 − λ)`; 0 for the known one, which tells no pixels apart.
    pub weights: Vec<f64>,
    /// The range that entries of each eigenvector are held to (`k`): what a five-hundredth of the light lies below, and above.
    pub ranges: Vec<(f64, f64)>,
    /// Of each eigenvector's squared norm 1, what is left within its range (`k`): nearly 1 for an eigenvector of regions, and
    /// next to nothing for one of a few pixels alone.
    pub within: Vec<f64>,
    /// How far each eigenvalue is from that of the known pair (`k`): `1 − λ`, or for the average cut `λ` in units of the mean
    /// degree.
    pub(super) gaps: Vec<f64>,
}

impl Embedding {
    /// For the eigenvectors `vectors` on `m` nodes that each count for `weights`, the known one first, and the pairs of all
    /// others.
    pub(super) fn new(
        cut: Cut,
        graph: &Graph,
        pairs: &[RitzPair],
        vectors: &[Vec<f64>],
        weights: &[f64],
    ) -> Self {
        // For the average cut eigenvalues and residuals are in units of degree.
        let unit = match cut {
            Cut::Normalized => 1.0,
            Cut::Average => mean(graph.degree()),
        };
        let gap = |pair: &RitzPair| match cut {
            Cut::Normalized => 1.0 - pair.value,
            Cut::Average => -pair.value / unit,
        };
        let gaps: Vec<f64> = std::iter::once(0.0).chain(pairs.iter().map(gap)).collect();
        // `1 − λ` is not known better than to the residual, so no less than that divides an unresolved vector.
        let weight = |(pair, gap): (&RitzPair, &f64)| 1.0 / gap.max(pair.residual / unit).max(FLOOR).sqrt();
        let ranges: Vec<(f64, f64)> = vectors.iter().map(|vector| range(vector, weights)).collect();
        let within = |(vector, &(low, high)): (&Vec<f64>, &(f64, f64))| {
            vector.iter().zip(weights).map(|(u, weight)| weight * u.max(low).min(high).powi(2)).sum()
        };
        Self {
            weights: std::iter::once(0.0).chain(pairs.iter().zip(&gaps[1..]).map(weight)).collect(),
            within: vectors.iter().zip(&ranges).map(within).collect(),
            ranges,
            gaps,
        }
    }

    /// A pixel's coordinate along an eigenvector, from its entry there.
    pub fn coordinate(&self, eigenvector: usize, entry: f64) -> f64 {
        let (low, high) = self.ranges[eigenvector];
        self.weights[eigenvector] * entry.max(low).min(high)
    }

    /// Whether an eigenvector is one of a few pixels alone, which tells nothing of regions.
    pub fn is_local(&self, eigenvector: usize) -> bool {
        self.within[eigenvector] < LOCAL
    }

    /// How many eigenvectors are.
    pub fn local(&self) -> usize {
        (0..self.within.len()).filter(|&index| self.is_local(index)).count()
    }
}

/// What the [`LEAST_SHARE`] of all weight lies below, and above.
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
    fn a_range_leaves_out_the_least_share_of_weight_at_either_end() {
        let vector: Vec<f64> = (0..1000).map(f64::from).collect();
        // Two of a thousand equal ones are the share: the second of either end is where it is reached.
        assert_eq!(range(&vector, &vec![1.0; 1000]), (1.0, 998.0));
        let mut weights = vec![1.0; 1000];
        weights[..3].fill(0.1);
        assert_eq!(range(&vector, &weights), (4.0, 998.0));
        // Few heavy ones are all of them more than the share.
        assert_eq!(range(&[3.0, -1.0, 2.0], &[1.0; 3]), (-1.0, 3.0));
    }
}
