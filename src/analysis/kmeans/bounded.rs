//! Lloyd's rounds that only examine points near a border between groups.
//!
//! Each point keeps an upper bound of the distance to its own centre and a lower bound of the distance to any other centre. Both bounds
//! follow from the movements of the centres (Hamerly, *Making k-means even faster*, SDM 2010, doi:10.1137/1.9781611972801.12). If the upper
//! bound of a point is below its lower bound, the point keeps its group, at the cost of two additions. A point that changes its group
//! changes two sums.

use rayon::prelude::*;

use super::points::{Assignment, BLOCK, Points};

/// Bounds with a relative difference below this value may be in the wrong order, because about 50 rounds add rounding errors to each bound.
const ROUNDING: f64 = 1e-12;

struct Bounded<'a> {
    points: &'a Points<'a>,
    labels: Vec<usize>,
    /// An upper bound of the distance of each point to its centre.
    upper: Vec<f64>,
    /// A lower bound of the distance of each point to any other centre.
    lower: Vec<f64>,
    weights: Vec<f64>,
    sums: Vec<Vec<f64>>,
}

struct Moves {
    each: Vec<f64>,
    /// The centre that has moved farthest, the distance that it has moved, and the next largest of these distances.
    farthest: (usize, f64, f64),
}

/// The effect of the points of a block that change groups: the gain of each group in weight and in the weighted sum of its points.
struct Change {
    weights: Vec<f64>,
    sums: Vec<Vec<f64>>,
}

/// Takes up to `rounds` rounds, starting from an assignment of all points to these centres. Ends when no point changes its group, or when a
/// group has lost all its points. The sums are updated instead of recomputed, so the centres have rounding errors. Returns the number of
/// rounds.
pub(super) fn advance(
    points: &Points<'_>,
    assignment: Assignment,
    centres: &mut [Vec<f64>],
    rounds: usize,
) -> usize {
    let Assignment { labels, distances, seconds, weights, sums, .. } = assignment;
    let root = |squares: Vec<f64>| squares.into_iter().map(f64::sqrt).collect();
    let mut groups = Bounded { points, labels, upper: root(distances), lower: root(seconds), weights, sums };
    for round in 0..rounds {
        let Some(moves) = groups.move_centres(centres) else { return round };
        if !groups.assign(centres, &moves) {
            return round + 1;
        }
    }
    rounds
}

impl Bounded<'_> {
    /// Moves each centre to the mean of its group. Returns `None` and moves no centre if the weight of a group is negligible. The sums of
    /// such a group may consist only of rounding errors, because the group has lost its points.
    fn move_centres(&self, centres: &mut [Vec<f64>]) -> Option<Moves> {
        let least = 1e-9 * self.weights.iter().sum::<f64>() / self.labels.len().max(1) as f64;
        if self.weights.iter().any(|&weight| weight <= least) {
            return None;
        }
        let mut each = Vec::with_capacity(centres.len());
        for ((centre, sums), weight) in centres.iter_mut().zip(&self.sums).zip(&self.weights) {
            let mut square = 0.0;
            for (value, sum) in centre.iter_mut().zip(sums) {
                let mean = sum / weight;
                square += (mean - *value) * (mean - *value);
                *value = mean;
            }
            each.push(square.sqrt());
        }
        let mut farthest = (0, 0.0, 0.0);
        for (cluster, &moved) in each.iter().enumerate() {
            if moved > farthest.1 {
                farthest = (cluster, moved, farthest.1);
            } else if moved > farthest.2 {
                farthest.2 = moved;
            }
        }
        Some(Moves { each, farthest })
    }

    /// Assigns each point to its nearest centre. `moves` holds the centres' movements. Returns true if any point changed its group.
    fn assign(&mut self, centres: &[Vec<f64>], moves: &Moves) -> bool {
        let points = self.points;
        let bounds = self.upper.par_chunks_mut(BLOCK).zip(self.lower.par_chunks_mut(BLOCK));
        let blocks = self.labels.par_chunks_mut(BLOCK).zip(bounds).enumerate();
        let changes: Vec<Option<Change>> = blocks
            .map(|(index, (labels, (upper, lower)))| {
                let mut change = None;
                for (offset, label) in labels.iter_mut().enumerate() {
                    let (upper, lower) = (&mut upper[offset], &mut lower[offset]);
                    let (farthest, moved, next) = moves.farthest;
                    *upper += moves.each[*label];
                    *lower -= if *label == farthest { next } else { moved };
                    if *upper < *lower * (1.0 - ROUNDING) {
                        continue;
                    }
                    let point = index * BLOCK + offset;
                    let before = *label;
                    let (distance, second);
                    (*label, distance, second) = points.nearest(point, centres);
                    (*upper, *lower) = (distance.sqrt(), second.sqrt());
                    if *label != before {
                        change.get_or_insert_with(|| Change::none(centres)).of(
                            points,
                            point,
                            [before, *label],
                        );
                    }
                }
                change
            })
            .collect();
        let mut changed = false;
        // The order of the blocks is fixed, so that sums do not depend on the number of threads.
        for change in changes.into_iter().flatten() {
            changed = true;
            self.weights.iter_mut().zip(&change.weights).for_each(|(weight, gain)| *weight += gain);
            for (sums, gains) in self.sums.iter_mut().zip(&change.sums) {
                sums.iter_mut().zip(gains).for_each(|(sum, gain)| *sum += gain);
            }
        }
        changed
    }
}

impl Change {
    fn none(centres: &[Vec<f64>]) -> Self {
        let sums = centres.iter().map(|centre| vec![0.0; centre.len()]).collect();
        Self { weights: vec![0.0; centres.len()], sums }
    }

    fn of(&mut self, points: &Points<'_>, point: usize, [from, to]: [usize; 2]) {
        let weight = points.weights[point];
        self.weights[from] -= weight;
        self.weights[to] += weight;
        for (coordinate, column) in points.coordinates.iter().enumerate() {
            let value = weight * column[point];
            self.sums[from][coordinate] -= value;
            self.sums[to][coordinate] += value;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn rounds_by_bounds_end_where_rounds_over_all_points_do() {
        let mut random = Pcg64::seed_from_u64(3);
        for clusters in [2, 3, 7, 12] {
            // The points are a cloud without gaps, so some points change their groups for many rounds.
            let column = |random: &mut Pcg64| (0..3000).map(|_| random.random::<f64>()).collect::<Vec<f64>>();
            let coordinates: Vec<Vec<f64>> = (0..4).map(|_| column(&mut random)).collect();
            let weights = column(&mut random);
            let points = Points { coordinates: &coordinates, weights: &weights };
            let start = points.start(clusters, &mut random);

            let (mut centres, mut plain) = (start.clone(), points.assign(&start));
            let mut rounds = 0;
            loop {
                for (centre, (sums, weight)) in centres.iter_mut().zip(plain.sums.iter().zip(&plain.weights))
                {
                    centre.iter_mut().zip(sums).for_each(|(value, sum)| *value = sum / weight);
                }
                rounds += 1;
                let next = points.assign(&centres);
                let settled = next.labels == plain.labels;
                plain = next;
                if settled {
                    break;
                }
            }
            let mut bounded = start.clone();
            let taken = advance(&points, points.assign(&start), &mut bounded, 1000);
            assert!(rounds > 10, "the cloud is to take many rounds, not {rounds}");
            assert_eq!((taken, points.assign(&bounded).labels), (rounds, plain.labels), "{clusters} groups");
            // Sums that are updated instead of recomputed differ by the rounding of at most 3,000 additions.
            let off = bounded.iter().flatten().zip(centres.iter().flatten()).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 3000.0 * f64::EPSILON);
        }
    }

    #[test]
    fn a_group_that_loses_its_points_ends_the_rounds() {
        let coordinates = [vec![0.0, 1.0, 2.0, 10.0]];
        let points = Points { coordinates: &coordinates, weights: &[1.0; 4] };
        let mut centres = vec![vec![1.0], vec![-50.0]];
        let taken = advance(&points, points.assign(&centres.clone()), &mut centres, 10);
        assert_eq!((taken, centres), (0, vec![vec![1.0], vec![-50.0]]), "nothing has moved");
    }
}
