//! The reliability of groups: whether a group consists of two groups, and how certain the group of a pixel is.

use crate::analysis::kmeans::Clusters;

/// A group counts as two if the best cut across its longest axis explains this share of its variance along this axis. Points of a normal
/// distribution reach a share of 0.64, and points of a uniform distribution 0.75.
const TWO: f64 = 0.95;

/// Each of the two parts must have this share of the group's light.
const LEAST_PART: f64 = 0.05;

/// The degrees of freedom of Student's distribution for a pixel's distance from its group. They are few, because some pixels are far from
/// every group.
const DEGREES_OF_FREEDOM: f64 = 4.0;

/// The number of steps of the power iteration for the longest axis. It need not converge, because any axis near the longest axis separates
/// two parts that are far apart.
const ROUNDS: usize = 50;

/// The number of groups that count as two. `coordinates` holds `d` columns of `n` values.
pub(super) fn divided(coordinates: &[Vec<f64>], weights: &[f64], clusters: &Clusters) -> usize {
    let is_two = |group: &usize| {
        let pixels: Vec<usize> =
            (0..weights.len()).filter(|&pixel| clusters.labels[pixel] == *group).collect();
        is_two(coordinates, weights, &pixels, &clusters.centres[*group])
    };
    (0..clusters.centres.len()).filter(is_two).count()
}

fn is_two(coordinates: &[Vec<f64>], weights: &[f64], pixels: &[usize], centre: &[f64]) -> bool {
    let axis = longest_axis(coordinates, weights, pixels, centre);
    let along = |&pixel: &usize| {
        let terms = coordinates.iter().zip(centre).zip(&axis);
        (terms.map(|((column, centre), axis)| (column[pixel] - centre) * axis).sum::<f64>(), weights[pixel])
    };
    let mut points: Vec<(f64, f64)> = pixels.iter().map(along).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let light: f64 = points.iter().map(|point| point.1).sum();
    let moment: f64 = points.iter().map(|(at, weight)| weight * at).sum();
    let variance: f64 = points.iter().map(|(at, weight)| weight * at * at).sum();
    let (mut below, mut moment_below) = (0.0, 0.0);
    points.iter().any(|(at, weight)| {
        below += weight;
        moment_below += weight * at;
        let above = light - below;
        if below.min(above) < LEAST_PART * light {
            return false;
        }
        let between = moment_below.powi(2) / below + (moment - moment_below).powi(2) / above;
        between > TWO * variance && variance > 0.0
    })
}

fn longest_axis(coordinates: &[Vec<f64>], weights: &[f64], pixels: &[usize], centre: &[f64]) -> Vec<f64> {
    let entry = |a: usize, b: usize| -> f64 {
        let of = |axis: usize, pixel: usize| coordinates[axis][pixel] - centre[axis];
        pixels.iter().map(|&pixel| weights[pixel] * of(a, pixel) * of(b, pixel)).sum()
    };
    let d = coordinates.len();
    let rows: Vec<Vec<f64>> = (0..d).map(|a| (0..d).map(|b| entry(a, b)).collect()).collect();
    let longest = (0..d).max_by(|&a, &b| rows[a][a].total_cmp(&rows[b][b])).unwrap_or(0);
    let mut axis: Vec<f64> = (0..d).map(|at| f64::from(u8::from(at == longest))).collect();
    for _ in 0..ROUNDS {
        let next: Vec<f64> = rows.iter().map(|row| row.iter().zip(&axis).map(|(a, b)| a * b).sum()).collect();
        let length = crate::krylov::norm(&next);
        if length == 0.0 {
            break;
        }
        axis = next.into_iter().map(|value| value / length).collect();
    }
    axis
}

/// The confidence in the group of each point, from 0 to 1: the probability of this group among all groups. The distances from the centres
/// are assumed to follow Student's distribution with their average width. The confidence says how well the point fits its group, not
/// whether the number of groups is right.
pub(super) fn confidence(coordinates: &[Vec<f64>], weights: &[f64], clusters: &Clusters) -> Vec<f64> {
    let d = coordinates.len() as f64;
    let width = clusters.inertia / (weights.iter().sum::<f64>() * d);
    if width <= 0.0 || !width.is_finite() {
        return vec![1.0; weights.len()];
    }
    let of = |pixel: usize| {
        let density = |centre: &Vec<f64>| {
            let squares = coordinates.iter().zip(centre).map(|(column, at)| (column[pixel] - at).powi(2));
            let distance = squares.sum::<f64>() / width;
            -0.5 * (DEGREES_OF_FREEDOM + d) * (distance / DEGREES_OF_FREEDOM).ln_1p()
        };
        let densities: Vec<f64> = clusters.centres.iter().map(density).collect();
        let own = densities[clusters.labels[pixel]];
        1.0 / densities.iter().map(|other| (other - own).exp()).sum::<f64>()
    };
    (0..weights.len()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;
    use crate::analysis::kmeans::{KmeansOptions, kmeans};

    /// A thousand points around each of these centres on a line, in two coordinates with uniform noise of width 2.
    fn around(centres: &[f64]) -> [Vec<f64>; 2] {
        let mut random = Pcg64::seed_from_u64(7);
        let mut noise = |_| random.random_range(-1.0..1.0);
        let all = centres.iter().flat_map(|centre| std::iter::repeat_n(*centre, 1000));
        let across: Vec<f64> = all.clone().enumerate().map(|(at, centre)| centre + noise(at)).collect();
        let down = all.enumerate().map(|(at, _)| noise(at)).collect();
        [across, down]
    }

    #[test]
    fn groups_that_are_two_are_found_and_others_are_not() {
        let points = around(&[0.0, 20.0, 40.0]);
        let weights = vec![1.0; 3000];
        let found =
            |groups| divided(&points, &weights, &kmeans(&points, &weights, &KmeansOptions::new(groups, 1)));
        assert_eq!([1, 2, 3, 4].map(found), [0, 1, 0, 0], "three parts in one group are not two");
    }

    #[test]
    fn points_between_groups_are_less_sure() {
        let mut points = around(&[0.0, 20.0]);
        points[0].extend([10.0, 3.0]);
        points[1].extend([0.0, 0.0]);
        let weights = vec![1.0; 2002];
        let clusters = kmeans(&points, &weights, &KmeansOptions::new(2, 1));
        let sure = confidence(&points, &weights, &clusters);
        assert!(sure[2000] < 0.6 && sure[2001] > 0.95, "{:?}", &sure[2000..]);
        assert!(sure[..2000].iter().all(|&sure| sure > 0.99));
        let one = kmeans(&points, &weights, &KmeansOptions::new(1, 1));
        assert!(confidence(&points, &weights, &one).iter().all(|&sure| sure == 1.0));
    }
}
