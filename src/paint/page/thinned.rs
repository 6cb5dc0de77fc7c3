//! A matrix with fewer entries, chosen by chance so that every photo stays right on average.

use rand::{RngExt, SeedableRng};

use super::packed::scale_of;
use crate::paint::canvas::Light;
use crate::paint::columns::Columns;
use crate::sparse::Csr;

/// Keeps about this share of the entries of all layers together: those above a threshold `τ` as they are, a smaller one `a` with the probability
/// `|a| / τ` as `±τ`. The mean of every entry stays what it was. Both halves of a symmetric matrix are thinned alike.
pub(super) fn thinned(layers: &[(Light, Columns)], share: f64) -> Vec<(Light, Columns)> {
    if share >= 1.0 {
        return layers.to_vec();
    }
    // Channels share positions: an entry counts by its largest size relative to its channel's largest.
    let channels = layers.first().map_or(0, |(_, columns)| columns.channels().len());
    let largest = |channel: usize| {
        layers.iter().map(|(_, columns)| scale_of(&columns.channels()[channel])).fold(0.0, f64::max)
    };
    let scales: Vec<f64> = (0..channels).map(largest).collect();
    let sizes = layers.iter().flat_map(|(_, columns)| sizes(columns, &scales)).collect();
    let threshold = threshold(sizes, share);
    layers.iter().map(|(light, columns)| (*light, without_small(columns, &scales, threshold))).collect()
}

/// The size of each entry of a layer, column by column.
fn sizes(columns: &Columns, scales: &[f64]) -> Vec<f64> {
    let mut sizes = vec![0.0_f64; columns.nonzeros()];
    for (of, scale) in columns.channels().iter().zip(scales) {
        sizes.iter_mut().zip(of.weights()).for_each(|(size, value)| *size = size.max(value.abs() / scale));
    }
    sizes
}

/// A layer whose entries below the threshold are left out, or made larger, by chance.
fn without_small(columns: &Columns, scales: &[f64], threshold: f64) -> Columns {
    let sizes = sizes(columns, scales);
    let first = &columns.channels()[0];
    let mut row_start = vec![0];
    let mut places_kept = Vec::new();
    let mut values_kept: Vec<Vec<f64>> = vec![Vec::new(); scales.len()];
    for column in 0..first.rows() {
        let of_column = first.row_start()[column]..first.row_start()[column + 1];
        for (at, size) in of_column.clone().zip(&sizes[of_column]) {
            let place = first.columns()[at];
            let probability = (size / threshold).min(1.0);
            if probability < 1.0 && chance(column, place as usize) >= probability {
                continue;
            }
            places_kept.push(place);
            for (values, of) in values_kept.iter_mut().zip(columns.channels()) {
                values.push(of.weights()[at] / probability);
            }
        }
        row_start.push(places_kept.len());
    }
    let thin = |values: Vec<f64>| Csr::new(first.cols(), row_start.clone(), places_kept.clone(), values).ok();
    // The positions are a part of those of a valid matrix.
    Columns::new(values_kept.into_iter().filter_map(thin).collect())
}

/// The threshold above which entries count whole, so that `Σ min(1, size / τ)` is this share of them.
fn threshold(mut sizes: Vec<f64>, share: f64) -> f64 {
    sizes.sort_by(f64::total_cmp);
    let wanted = share * sizes.len() as f64;
    let mut below = sizes.iter().sum::<f64>();
    // From the largest down: with `k` whole ones, τ is what the others must share.
    for (whole, &size) in sizes.iter().rev().enumerate() {
        let threshold = below / (wanted - whole as f64).max(f64::MIN_POSITIVE);
        if size <= threshold {
            return threshold.max(f64::MIN_POSITIVE);
        }
        below -= size;
    }
    f64::MIN_POSITIVE
}

/// A number from 0 to 1 by chance, the same for both halves of a symmetric matrix.
fn chance(column: usize, place: usize) -> f64 {
    let (low, high) = (column.min(place) as u64, column.max(place) as u64);
    rand_pcg::Pcg64Mcg::seed_from_u64(high << 32 | low).random()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Result;

    #[test]
    fn thinning_keeps_the_mean_of_every_photo_and_symmetry() -> Result<()> {
        let entries = |row: usize| (0..60).map(move |column| 1.0 + ((row * column) % 7) as f64);
        let weights: Vec<f64> = (0..60).flat_map(entries).collect();
        let columns: Vec<u32> = (0..60).flat_map(|_| 0..60).collect();
        let matrix = Csr::new(60, (0..=60).map(|row| 60 * row).collect(), columns, weights)?;
        let sum = |of: &Csr| of.weights().iter().sum::<f64>();
        let thin = thinned(&[(Light::All, Columns::new(vec![matrix.clone()]))], 0.3);
        let thin = &thin[0].1.channels()[0];
        assert!(thin.is_symmetric());
        let share = thin.weights().len() as f64 / matrix.weights().len() as f64;
        // 1,830 independent choices: three standard deviations are 3.5 % of the share and about 5 % of the sum.
        assert!((share / 0.3 - 1.0).abs() < 0.15, "{share}");
        assert!((sum(thin) / sum(&matrix) - 1.0).abs() < 0.1);
        Ok(())
    }

    #[test]
    fn the_threshold_keeps_the_share_that_is_wanted() {
        let sizes: Vec<f64> = (1..=1000).map(|size| f64::from(size).powi(2)).collect();
        for share in [0.9, 0.5, 0.1] {
            let threshold = threshold(sizes.clone(), share);
            let kept: f64 = sizes.iter().map(|size| (size / threshold).min(1.0)).sum();
            assert!((kept / 1000.0 - share).abs() < 1e-9, "{share}: {kept}");
        }
    }
}
