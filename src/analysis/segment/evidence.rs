//! Evidence for groups: each is lit alone, to measure where its light goes.
//!
//! The photo under a group's own pixels shows all pixels that its light reaches. Summed over groups, these photos give the
//! exchanged light, `E_ab = 1_aᵀ G 1_b`, and the value of the cut, `Σ_a (1 − E_aa / Σ_b E_ab)`, without any model.

use super::segmentation::MASKED;
use crate::error::{Error, Result};
use crate::operator::{Operator, each_product};

/// The photos of a segmentation's groups, each lit alone.
#[derive(Clone, Debug)]
pub struct Evidence {
    /// The number of groups.
    pub groups: usize,
    /// The photo of each group (`n`), without direct light if the operator has none.
    pub photos: Vec<Vec<f64>>,
    /// `E_ab / Σ_c E_cb`: the share of group `b`'s light to unmasked pixels that arrives in group `a`; row `a`, column `b`.
    pub exchange: Vec<Vec<f64>>,
}

impl Evidence {
    /// The share of its light that each group keeps.
    pub fn kept(&self) -> Vec<f64> {
        (0..self.groups).map(|group| self.exchange[group][group]).collect()
    }

    /// The value of the normalized cut: the sum of the shares of light that leave their groups.
    pub fn cut(&self) -> f64 {
        self.kept().iter().map(|kept| 1.0 - kept).sum()
    }
}

/// Lights each group of `labels` (`n`; 255 is masked and dark) alone, with one photo each by `operator`. Fails with
/// [`Error::Dimension`] if there is not one label per pixel, or as the operator does.
pub fn evidence(operator: &mut dyn Operator, labels: &[u8]) -> Result<Evidence> {
    if labels.len() != operator.cols() || labels.len() != operator.rows() {
        return Err(Error::dimension("labels of the groups to be lit", operator.cols(), labels.len()));
    }
    let last = labels.iter().copied().filter(|&label| label != MASKED).max();
    let groups = last.map_or(0, |last| usize::from(last) + 1);
    let mut photos = Vec::with_capacity(groups);
    let mut exchange = vec![vec![0.0; groups]; groups];
    let pattern = |group| {
        let lit = |&label: &u8| f64::from(u8::from(usize::from(label) == group));
        labels.iter().map(lit).collect()
    };
    each_product(operator, (0..groups).map(pattern), |_, photo| {
        let group = photos.len();
        for (&label, value) in labels.iter().zip(&photo).filter(|(label, _)| **label != MASKED) {
            exchange[usize::from(label)][group] += value;
        }
        photos.push(photo);
        let all: f64 = exchange.iter().map(|row| row[group]).sum();
        exchange.iter_mut().for_each(|row| row[group] /= if all == 0.0 { 1.0 } else { all });
        Ok(())
    })?;
    Ok(Evidence { groups, photos, exchange })
}
