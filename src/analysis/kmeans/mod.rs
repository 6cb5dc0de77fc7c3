//! Weighted k-means: groups of points around centres. `linfa-clustering` gives all points the same weight, so k-means is implemented here.

mod bounded;
mod points;

use points::{Assignment, Points};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// The options of [`kmeans`].
#[derive(Clone, Copy, Debug)]
pub struct KmeansOptions {
    /// The number of groups, `K`.
    pub clusters: usize,
    /// The number of starts. The best result of all starts is used. Default 64/K, at least 8, because the cost of a start is proportional
    /// to K, and near ties between two groups are common in symmetric scenes.
    pub restarts: usize,
    /// The largest number of rounds per start. Default 100.
    pub rounds: usize,
    /// Seed of the starts.
    pub seed: u64,
}

impl KmeansOptions {
    /// Options for `clusters` groups, with defaults for all other options.
    pub fn new(clusters: usize, seed: u64) -> Self {
        Self { clusters, restarts: (64 / clusters.max(1)).max(8), rounds: 100, seed }
    }
}

/// The result of [`kmeans`].
#[derive(Clone, Debug, PartialEq)]
pub struct Clusters {
    /// The group of each point, below `K`.
    pub labels: Vec<usize>,
    /// The centre of each group: `K` vectors of length `d`.
    pub centres: Vec<Vec<f64>>,
    /// The objective `Σ w_i ‖x_i − c(i)‖²` at a local minimum.
    pub inertia: f64,
}

/// Groups `n` points of `d` coordinates to minimize `Σ w_i ‖x_i − c(i)‖²`, where `c(i)` is the weighted mean of the point's group.
///
/// Lloyd's algorithm (doi:10.1109/TIT.1982.1056489) from k-means++ starts (Arthur and Vassilvitskii, SODA 2007) finds local minima, and the
/// best of several minima is returned. For more than 32,768 points, the starts are compared on a random sample, and the best start
/// continues with all points (as Bradley and Fayyad, ICML 1998, choose starts). If a group becomes empty, it gets the point that is
/// farthest from its own centre. With fewer than `K` distinct points, some groups stay empty. The result depends only on the seed, not on
/// the number of threads.
///
/// `coordinates` holds `d` columns of length `n`; `weights` has length `n` and is not negative.
pub fn kmeans(coordinates: &[Vec<f64>], weights: &[f64], options: &KmeansOptions) -> Clusters {
    let points = Points { coordinates, weights };
    let mut random = Pcg64::seed_from_u64(options.seed);
    if weights.len() <= MOST_COMPARED {
        return best_start(&points, options, &mut random);
    }
    let chosen = strata(weights.len(), &mut random);
    let sample = |column: &Vec<f64>| chosen.iter().map(|&point| column[point]).collect();
    let coordinates: Vec<Vec<f64>> = coordinates.iter().map(sample).collect();
    let weights: Vec<f64> = chosen.iter().map(|&point| weights[point]).collect();
    let sample = Points { coordinates: &coordinates, weights: &weights };
    lloyd(&points, best_start(&sample, options, &mut random).centres, options.rounds)
}

/// The largest number of points on which all starts are compared. A group of a thousandth of all points then has about 32 points in the
/// sample.
const MOST_COMPARED: usize = 1 << 15;

/// Draws one point at random from each group of consecutive points.
fn strata(points: usize, random: &mut Pcg64) -> Vec<usize> {
    let each = points.div_ceil(MOST_COMPARED);
    (0..points).step_by(each).map(|first| random.random_range(first..points.min(first + each))).collect()
}

fn best_start(points: &Points<'_>, options: &KmeansOptions, random: &mut Pcg64) -> Clusters {
    let mut best = lloyd(points, points.start(options.clusters, random), options.rounds);
    for _ in 1..options.restarts {
        let candidate = lloyd(points, points.start(options.clusters, random), options.rounds);
        if candidate.inertia < best.inertia {
            best = candidate;
        }
    }
    best
}

/// Lloyd's rounds from these centres. Most rounds examine only points near a border; the last round examines all, and recomputes all sums.
fn lloyd(points: &Points<'_>, mut centres: Vec<Vec<f64>>, rounds: usize) -> Clusters {
    let mut assignment = points.assign(&centres);
    let mut left = rounds;
    while left > 0 {
        move_centres(points, &assignment, &mut centres);
        let next = points.assign(&centres);
        let settled = next.labels == assignment.labels;
        assignment = next;
        left -= 1;
        if settled {
            break;
        }
        if left > 0 {
            left -= bounded::advance(points, assignment, &mut centres, left);
            assignment = points.assign(&centres);
        }
    }
    Clusters { labels: assignment.labels, centres, inertia: assignment.inertia }
}

/// Moves each centre to the mean of its group. The centre of an empty group moves to the point farthest from its own centre.
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
            // The next empty group must take another point.
            distances[farthest] = 0.0;
        }
    }
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
        // Each circle has the radius ½ around a centre that is nearly its mean. Each point adds ¼, and the exact mean gives no larger sum.
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
    fn many_points_are_grouped_as_few_are() {
        // The last group has a hundredth of the points of each other group.
        let centres = [(0.0, 0.0), (9.0, 0.0), (0.0, 9.0), (9.0, 9.0)];
        let mut columns = rings(&centres, 1.0, 12_000);
        for (column, value) in columns.iter_mut().zip([30.0, 4.0]) {
            column.extend((0..120).map(|i| value + 1e-3 * f64::from(i % 7)));
        }
        let count = columns[0].len();
        assert!(count > MOST_COMPARED);
        let clusters = kmeans(&columns, &vec![1.0; count], &KmeansOptions::new(5, 4));
        let label = |i: usize| clusters.labels[i];
        assert!((0..48_000).all(|i| label(i) == label(i % 4)));
        assert!((48_000..count).all(|i| label(i) == label(48_000) && label(i) != label(i % 4)));
        // All points count in the inertia. The circles have radius 1 around their means.
        assert!((clusters.inertia / 48_000.0 - 1.0).abs() < 1e-3, "{}", clusters.inertia);
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
