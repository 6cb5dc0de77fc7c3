//! Weighted k-means: groups of points around centres.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Points in a block: fixed, so that sums are added in the same order for any number of threads.
const BLOCK: usize = 512;

/// What [`kmeans`] is asked for.
#[derive(Clone, Copy, Debug)]
pub struct KmeansOptions {
    /// How many groups, `K`.
    pub clusters: usize,
    /// How many starts; the best result is kept. Default 64/K, at least 8: a start costs in proportion to K, and near
    /// ties between two groups are common in symmetric scenes.
    pub restarts: usize,
    /// Rounds per start at most. Default 100.
    pub rounds: usize,
    /// Seed of the starts.
    pub seed: u64,
}

impl KmeansOptions {
    /// `clusters` groups, and else the defaults.
    pub fn new(clusters: usize, seed: u64) -> Self {
        Self { clusters, restarts: (64 / clusters.max(1)).max(8), rounds: 100, seed }
    }
}

/// Groups of points.
#[derive(Clone, Debug, PartialEq)]
pub struct Clusters {
    /// The group of each point, below `K`.
    pub labels: Vec<usize>,
    /// The centre of each group, `K` of length `d`.
    pub centres: Vec<Vec<f64>>,
    /// `Σ w_i ‖x_i − c(i)‖²`, which is (locally) least.
    pub inertia: f64,
}

/// Groups `n` points of `d` coordinates so that `Σ w_i ‖x_i − c(i)‖²` is small, `c(i)` being the weighted mean of the
/// point's group.
///
/// Lloyd's algorithm (doi:10.1109/TIT.1982.1056489) from k-means++ starts (Arthur and Vassilvitskii, SODA 2007): a
/// local minimum, the best of several. A group that runs empty gets the point farthest from its centre; with fewer
/// than `K` distinct points some groups stay empty. Deterministic for a seed, whatever the number of threads.
///
/// `coordinates` holds `d` columns of length `n`; `weights` has length `n` and is not negative.
pub fn kmeans(coordinates: &[Vec<f64>], weights: &[f64], options: &KmeansOptions) -> Clusters {
    let points = Points { coordinates, weights };
    let mut random = Pcg64::seed_from_u64(options.seed);
    let mut best = lloyd(&points, points.start(options.clusters, &mut random), options.rounds);
    for _ in 1..options.restarts {
        let candidate = lloyd(&points, points.start(options.clusters, &mut random), options.rounds);
        if candidate.inertia < best.inertia {
            best = candidate;
        }
    }
    best
}

struct Points<'a> {
    coordinates: &'a [Vec<f64>],
    weights: &'a [f64],
}

/// The outcome of giving each point to its nearest centre.
struct Assignment {
    labels: Vec<usize>,
    /// Squared distance of each point to its centre.
    distances: Vec<f64>,
    /// Weight of each group.
    weights: Vec<f64>,
    /// Weighted sum of each group's points, `K` of length `d`.
    sums: Vec<Vec<f64>>,
    inertia: f64,
}

impl Points<'_> {
    fn len(&self) -> usize {
        self.weights.len()
    }

    fn point(&self, index: usize) -> Vec<f64> {
        self.coordinates.iter().map(|column| column[index]).collect()
    }

    /// k-means++: each centre is a point drawn with probability proportional to its weighted squared distance to
    /// those before.
    fn start(&self, clusters: usize, random: &mut Pcg64) -> Vec<Vec<f64>> {
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

    /// `nearest_i ← min(nearest_i, ‖x_i − centre‖²)`.
    fn lower_distances(&self, centre: &[f64], nearest: &mut [f64]) {
        nearest.par_chunks_mut(BLOCK).enumerate().for_each(|(index, nearest)| {
            let mut squares = [0.0; BLOCK];
            self.squared_distances(index * BLOCK, centre, &mut squares[..nearest.len()]);
            for (nearest, square) in nearest.iter_mut().zip(&squares) {
                *nearest = nearest.min(*square);
            }
        });
    }

    /// `‖x_i − centre‖²` of a block's points; column by column, which vectorizes.
    fn squared_distances(&self, first: usize, centre: &[f64], squares: &mut [f64]) {
        squares.fill(0.0);
        for (column, &centre) in self.coordinates.iter().zip(centre) {
            let column = &column[first..first + squares.len()];
            for (square, &value) in squares.iter_mut().zip(column) {
                *square += (value - centre) * (value - centre);
            }
        }
    }

    fn assign(&self, centres: &[Vec<f64>]) -> Assignment {
        let mut labels = vec![0; self.len()];
        let mut distances = vec![f64::INFINITY; self.len()];
        let blocks: Vec<_> = labels
            .par_chunks_mut(BLOCK)
            .zip(distances.par_chunks_mut(BLOCK))
            .enumerate()
            .map(|(index, (labels, distances))| {
                let first = index * BLOCK;
                let mut squares = [0.0; BLOCK];
                let squares = &mut squares[..labels.len()];
                for (cluster, centre) in centres.iter().enumerate() {
                    self.squared_distances(first, centre, squares);
                    for ((label, distance), &square) in
                        labels.iter_mut().zip(distances.iter_mut()).zip(&*squares)
                    {
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

fn lloyd(points: &Points<'_>, mut centres: Vec<Vec<f64>>, rounds: usize) -> Clusters {
    let mut assignment = points.assign(&centres);
    for _ in 0..rounds {
        move_centres(points, &assignment, &mut centres);
        let next = points.assign(&centres);
        let settled = next.labels == assignment.labels;
        assignment = next;
        if settled {
            break;
        }
    }
    Clusters { labels: assignment.labels, centres, inertia: assignment.inertia }
}

/// Each centre to its group's mean; that of an empty group to the point which is farthest from its own.
fn move_centres(points: &Points<'_>, assignment: &Assignment, centres: &mut [Vec<f64>]) {
    let mut distances = assignment.distances.clone();
    for (cluster, centre) in centres.iter_mut().enumerate() {
        let weight = assignment.weights[cluster];
        if weight > 0.0 {
            for (value, sum) in centre.iter_mut().zip(&assignment.sums[cluster]) {
                *value = sum / weight;
            }
            continue;
        }
        let farthest = (0..distances.len()).fold(0, |far, i| {
            if points.weights[i] * distances[i] > points.weights[far] * distances[far] { i } else { far }
        });
        if distances.get(farthest).is_some_and(|&distance| distance > 0.0) {
            *centre = points.point(farthest);
            // Not again for the next empty group.
            distances[farthest] = 0.0;
        }
    }
}

/// An index drawn with probability proportional to `odds`; any index when all are zero.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// `count` points around each of the centres, on small circles.
    fn rings(centres: &[(f64, f64)], radius: f64, count: usize) -> Vec<Vec<f64>> {
        let mut columns = vec![Vec::new(), Vec::new()];
        for i in 0..count * centres.len() {
            let (x, y) = centres[i % centres.len()];
            let angle = i as f64;
            columns[0].push(x + radius * angle.cos());
            columns[1].push(y + radius * angle.sin());
        }
        columns
    }

    #[test]
    fn separate_rings_are_found_and_their_inertia_is_least() {
        let centres: Vec<(f64, f64)> = (0..7).map(|k| (f64::from(k * k), f64::from(3 * k))).collect();
        let columns = rings(&centres, 0.5, 300);
        let weights = vec![1.0; 2100];
        let clusters = kmeans(&columns, &weights, &KmeansOptions::new(7, 1));
        let label = |i: usize| clusters.labels[i];
        assert!((0..2100).all(|i| label(i) == label(i % 7)), "points of a ring share a label");
        // Rings of radius ½ about (nearly) their means: ¼ a point, and never more about the mean itself.
        assert!(
            clusters.inertia <= 0.25 * 2100.0 && clusters.inertia > 0.249 * 2100.0,
            "{}",
            clusters.inertia
        );
    }

    #[test]
    fn result_depends_on_the_seed_only_and_not_on_threads() {
        let columns = rings(&[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], 0.9, 1500);
        let weights: Vec<f64> = (0..4500).map(|i| 1.0 + f64::from(i % 5)).collect();
        let with = |threads| {
            let pool =
                rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
            pool.install(|| kmeans(&columns, &weights, &KmeansOptions::new(5, 9)))
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn heavy_points_draw_the_centre() {
        let clusters = kmeans(&[vec![0.0, 1.0]], &[3.0, 1.0], &KmeansOptions::new(1, 0));
        assert_eq!(clusters.centres, [[0.25]]);
        assert_eq!(clusters.inertia, 0.75);
    }

    #[test]
    fn an_empty_group_takes_the_farthest_point() {
        let columns = [vec![0.0, 0.1, 10.0]];
        let points = Points { coordinates: &columns, weights: &[1.0; 3] };
        let clusters = lloyd(&points, vec![vec![0.0], vec![-100.0]], 10);
        assert_eq!(clusters.labels, [0, 0, 1]);
    }

    #[test]
    fn fewer_distinct_points_than_groups_leave_groups_empty() {
        let clusters = kmeans(&[vec![2.0; 5]], &[1.0; 5], &KmeansOptions::new(3, 0));
        assert_eq!(clusters.inertia, 0.0);
        assert!(clusters.labels.iter().all(|&label| label == clusters.labels[0]));
    }
}
