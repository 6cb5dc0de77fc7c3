//! Figure 9: the photos of a segmentation in order.

use super::bench::Bench;
use super::check::Check;
use super::figure::{Figure, Reproduced, Strip};
use super::stage::Set;
use crate::analysis::segment::segment;
use crate::analysis::{SegmentOptions, Segmentation};
use crate::error::Result;
use crate::krylov::{dot, norm};
use crate::operator::Recorded;
use crate::transport::Part;

const SIDE: usize = 100;
const PHOTOS: usize = 50;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Zigzag, side)?;
    let options =
        SegmentOptions { photos: PHOTOS, tolerance: 0.0, starts: Some(1), ..SegmentOptions::default() };
    let mut operator = bench.photos(&stage, Part::Global)?;
    let mut recorded = Recorded::new(&mut operator);
    let Segmentation { photos, degree, .. } = segment(&mut recorded, &options)?;
    let shots = recorded.products;
    // The patterns are `D^-½` times an orthogonal basis.
    let basis: Vec<Vec<f64>> = shots[1..]
        .iter()
        .map(|shot| shot.from.iter().zip(&degree).map(|(x, d)| x * d.sqrt()).collect())
        .collect();
    let is_white = shots.first().is_some_and(|shot| shot.from.iter().all(|&value| value == 1.0));
    let checks = vec![
        Check::at_most("photos taken", shots.len() as f64, PHOTOS as f64),
        Check::at_least("photos taken that are counted", photos as f64 / shots.len() as f64, 1.0),
        Check::at_least("the first is of white (1 is yes)", f64::from(u8::from(is_white)), 1.0),
        Check::at_most(
            "patterns after it: the largest overlap of two, weighted by the degree",
            overlap(&basis),
            1e-8,
        ),
    ];
    Ok(Reproduced {
        setting: format!("zigzag, {}, the run of figure 4", stage.resolution),
        checks,
        strips: vec![Strip {
            caption: "Above what is projected, below its photo without direct light; blue is negative. The first is white."
                .into(),
            resolution: stage.resolution,
            photos: shots,
        }],
        photos,
        ..Reproduced::of(Figure::Fig9, bench.rig())
    })
}

/// The largest `|xᵀy| / (‖x‖ ‖y‖)` over all pairs of basis vectors.
fn overlap(basis: &[Vec<f64>]) -> f64 {
    let pairs = (0..basis.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
    pairs
        .map(|(i, j)| dot(&basis[i], &basis[j]).abs() / (norm(&basis[i]) * norm(&basis[j])))
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::overlap;

    #[test]
    fn overlap_is_that_of_the_worst_pair() {
        let basis = [vec![1.0, 0.0], vec![0.0, 2.0], vec![3.0, 4.0]];
        assert_eq!(overlap(&basis), 0.8);
    }
}
