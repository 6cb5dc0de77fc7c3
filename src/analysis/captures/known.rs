//! Sets of patterns that a question asks for, found among captured patterns.

use std::collections::{BTreeSet, HashSet};

use crate::image::Resolution;
use crate::measure::shifted_checkerboards;

/// The side of the squares in pixels, and the places in each direction, of shifted checkerboards that are all among `patterns`. If several
/// such sets are, it returns the one with the most places.
pub fn captured_checkerboards(patterns: &[Vec<f64>], size: Resolution) -> Option<[usize; 2]> {
    let captured: HashSet<Vec<bool>> = patterns.iter().filter_map(|pattern| two_levels(pattern)).collect();
    // The longest run of equal pixels in a row is as long as the side of a square.
    let longest = |lit: &Vec<bool>| lit[..size.width].chunk_by(|a, b| a == b).map(<[bool]>::len).max();
    let squares: BTreeSet<usize> = captured.iter().filter_map(longest).collect();
    let all = |square: usize, shifts: usize| {
        let boards = shifted_checkerboards(size, square, shifts);
        boards
            .map(|board| board.iter().map(|value| *value > 0.5).collect())
            .all(|lit: Vec<bool>| captured.contains(&lit))
    };
    let places = squares.into_iter().filter(|square| 2 * square <= size.width).filter_map(|square| {
        let most = patterns.len().isqrt().min(2 * square);
        (2..=most).rev().find(|&shifts| all(square, shifts)).map(|shifts| [square, shifts])
    });
    places.max_by_key(|[_, shifts]| *shifts)
}

/// The lit pixels of a pattern that has two levels, or nothing.
fn two_levels(pattern: &[f64]) -> Option<Vec<bool>> {
    let [least, most] =
        pattern.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)]);
    let near = 1e-3 * (most - least);
    let is_level = |value: &f64| value - least <= near || most - value <= near;
    (near > 0.0 && pattern.iter().all(is_level))
        .then(|| pattern.iter().map(|value| *value > 0.5 * (least + most)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_set_of_checkerboards_is_found_among_other_patterns() {
        for (size, square, shifts) in [((24, 18), 4, 4), ((24, 18), 2, 4), ((30, 8), 3, 6), ((17, 11), 5, 3)]
        {
            let size = Resolution::new(size.0, size.1);
            let mut patterns: Vec<Vec<f64>> = shifted_checkerboards(size, square, shifts).collect();
            patterns.iter_mut().flatten().for_each(|value| *value = 0.1 + 0.7 * *value);
            let ramp: Vec<f64> = (0..size.pixels()).map(|pixel| pixel as f64).collect();
            patterns.extend([ramp, vec![1.0; size.pixels()]]);
            assert_eq!(captured_checkerboards(&patterns, size), Some([square, shifts]), "{size} {square}");
            // Two places may show the same pattern.
            let gone = patterns[1].clone();
            patterns.retain(|pattern| *pattern != gone);
            assert_ne!(captured_checkerboards(&patterns, size), Some([square, shifts]));
        }
        assert_eq!(captured_checkerboards(&[vec![1.0; 6], vec![0.0; 6]], Resolution::new(3, 2)), None);
    }
}
