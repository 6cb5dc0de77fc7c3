//! Points, and two operations on all of them: draw the first centres, and assign each point to the nearest centre.

use rand::RngExt;
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// The number of points per block. It is fixed, so that sums are added in the same order for any number of threads.
pub(super) const BLOCK: usize = 512;

/// `n` weighted points of `d` coordinates.
pub(super) struct Points<'a> {
    pub(super) coordinates: &'a [Vec<f64>],
    pub(super) weights: &'a [f64],
}

pub(super) struct Assignment {
    pub(super) labels: Vec<usize>,
    /// The squared distance of each point to its centre.
    pub(super) distances: Vec<f64>,
    /// The squared distance of each point to the nearest other centre.
    pub(super) seconds: Vec<f64>,
    pub(super) weights: Vec<f64>,
    /// The weighted sum of each group's points: `K` vectors of length `d`.
    pub(super) sums: Vec<Vec<f64>>,
    pub(super) inertia: f64,
}

impl Points<'_> {
    fn len(&self) -> usize {
        self.weights.len()
    }

    pub(super) fn point(&self, index: usize) -> Vec<f64> {
        self.coordinates.iter().map(|column| column[index]).collect()
    }

    /// Draws k-means++ centres. The probability of a point is proportional to its weighted squared distance to the earlier centres.
    pub(super) fn start(&self, clusters: usize, random: &mut Pcg64) -> Vec<Vec<f64>> {
        let mut centres: Vec<Vec<f64>> = Vec::with_capacity(clusters);
        let mut odds = self.weights.to_vec();
        let mut nearest = vec![f64::INFINITY; self.len()];
        while centres.len() < clusters && !odds.is_empty() {
            let centre = self.point(draw(&odds, random));
            self.lower_distances(&centre, &mut nearest);
            for ((odds, weight), distance) in odds.iter_mut().zip(self.weights).zip(&nearest) {
                *odds = weight * distance;
            }
            centres.push(centre);
        }
        centres
    }

    /// Updates `nearest_i ← min(nearest_i, ‖x_i − centre‖²)`.
    fn lower_distances(&self, centre: &[f64], nearest: &mut [f64]) {
        nearest.par_chunks_mut(BLOCK).enumerate().for_each(|(index, nearest)| {
            let mut squares = [0.0; BLOCK];
            self.squared_distances(index * BLOCK, centre, &mut squares[..nearest.len()]);
            for (nearest, square) in nearest.iter_mut().zip(&squares) {
                *nearest = nearest.min(*square);
            }
        });
    }

    /// Computes `‖x_i − centre‖²` for the points of a block. The loop goes column by column, so that it vectorizes.
    fn squared_distances(&self, first: usize, centre: &[f64], squares: &mut [f64]) {
        squares.fill(0.0);
        for (column, &centre) in self.coordinates.iter().zip(centre) {
            let column = &column[first..first + squares.len()];
            for (square, &value) in squares.iter_mut().zip(column) {
                *square += (value - centre) * (value - centre);
            }
        }
    }

    pub(super) fn assign(&self, centres: &[Vec<f64>]) -> Assignment {
        let mut labels = vec![0; self.len()];
        let mut distances = vec![f64::INFINITY; self.len()];
        let mut seconds = distances.clone();
        let blocks: Vec<_> = labels
            .par_chunks_mut(BLOCK)
            .zip(distances.par_chunks_mut(BLOCK))
            .zip(seconds.par_chunks_mut(BLOCK))
            .enumerate()
            .map(|(index, ((labels, distances), seconds))| {
                let first = index * BLOCK;
                let mut squares = [0.0; BLOCK];
                let squares = &mut squares[..labels.len()];
                for (cluster, centre) in centres.iter().enumerate() {
                    self.squared_distances(first, centre, squares);
                    let nearest = labels.iter_mut().zip(distances.iter_mut()).zip(seconds.iter_mut());
                    for (((label, distance), second), &square) in nearest.zip(&*squares) {
                        *second = second.min(square.max(*distance));
                        if square < *distance {
                            *distance = square;
                            *label = cluster;
                        }
                    }
                }
                self.sum_block(first, labels, distances, centres.len())
            })
            .collect();
        let mut total = Assignment {
            labels,
            distances,
            seconds,
            weights: vec![0.0; centres.len()],
            sums: Vec::new(),
            inertia: 0.0,
        };
        total.sums = vec![vec![0.0; self.coordinates.len()]; centres.len()];
        for (weights, sums, inertia) in blocks {
            total.inertia += inertia;
            for cluster in 0..centres.len() {
                total.weights[cluster] += weights[cluster];
                for (sum, part) in total.sums[cluster].iter_mut().zip(&sums[cluster]) {
                    *sum += part;
                }
            }
        }
        total
    }

    /// Finds the nearest centre of one point, and the squared distances to the two nearest centres. The results equal those of
    /// [`Self::assign`].
    pub(super) fn nearest(&self, point: usize, centres: &[Vec<f64>]) -> (usize, f64, f64) {
        let (mut label, mut distance, mut second) = (0, f64::INFINITY, f64::INFINITY);
        for (cluster, centre) in centres.iter().enumerate() {
            let terms = self.coordinates.iter().zip(centre);
            let square = terms
                .fold(0.0, |sum, (column, centre)| sum + (column[point] - centre) * (column[point] - centre));
            second = second.min(square.max(distance));
            if square < distance {
                (label, distance) = (cluster, square);
            }
        }
        (label, distance, second)
    }

    /// Each group's weight and weighted sum of points within a block, and the block's inertia.
    fn sum_block(
        &self,
        first: usize,
        labels: &[usize],
        distances: &[f64],
        clusters: usize,
    ) -> (Vec<f64>, Vec<Vec<f64>>, f64) {
        let weights_here = &self.weights[first..first + labels.len()];
        let mut weights = vec![0.0; clusters];
        let mut sums = vec![vec![0.0; self.coordinates.len()]; clusters];
        let mut inertia = 0.0;
        for ((&label, &weight), &distance) in labels.iter().zip(weights_here).zip(distances) {
            weights[label] += weight;
            inertia += weight * distance;
        }
        for (d, column) in self.coordinates.iter().enumerate() {
            let column = &column[first..first + labels.len()];
            for ((&label, &weight), &value) in labels.iter().zip(weights_here).zip(column) {
                sums[label][d] += weight * value;
            }
        }
        (weights, sums, inertia)
    }
}

/// Draws an index with a probability proportional to `odds`. If all `odds` are zero, it may draw any index.
fn draw(odds: &[f64], random: &mut Pcg64) -> usize {
    let total: f64 = odds.iter().sum();
    let mut left = random.random::<f64>() * total;
    if total <= 0.0 {
        return random.random_range(0..odds.len());
    }
    let mut last = 0;
    for (index, &weight) in odds.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
        last = index;
        if left < weight {
            break;
        }
        left -= weight;
    }
    last
}
