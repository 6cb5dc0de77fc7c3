//! The number of regions in a scene. A region is a set of pixels that exchanges almost no light with other pixels.
//!
//! Each region without exchange adds an eigenvalue 1 of `D^-½ G D^-½`, and each region with little exchange adds an eigenvalue near 1 (von
//! Luxburg, *A tutorial on spectral clustering*, 2007, doi:10.1007/s11222-007-9033-z, sections 3 and 8.3). There is thus one eigenvalue
//! with a small `1 − λ` per region, followed by a jump. The largest jump gives the suggested number of regions.
//!
//! A Krylov process finds only one vector of a repeated eigenvalue per starting vector. If all eigenvalues found are near 1, there may be
//! more regions, and the number is a lower bound. If an eigenvalue is repeated *exactly*, the single vector found is a random mixture of
//! the regions' indicator vectors. It is constant on each region and different between regions, so its levels are counted as well.
//!
//! Localized eigenvectors ([`Embedding::is_local`](super::Embedding::is_local)) are left out.

use super::confirm::Unseen;
use super::embedding::LEAST_SHARE;
use crate::finding::decimal;
use crate::krylov::{Completeness, temple_kato};

/// This value replaces any smaller distance of an eigenvalue from 1, so that rounding creates no gaps. An operator that blurs has a higher
/// floor.
const FLOOR: f64 = 1e-3;

/// An eigenvalue this close to 1 counts as 1.
const EXACT: f64 = 1e-6;

/// A region must keep at least this share of its light.
pub const KEPT: f64 = 0.85;

/// The count is clear if the next eigenvalue is at least this many times as far from 1 as the last eigenvalue of a region. In addition, a
/// region with this next eigenvalue must keep too little of its light ([`KEPT`]).
const CLEAR: f64 = 4.0;

/// A suggested number of regions, and the evidence for this number.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Regions {
    /// The suggested number of regions; at least 1.
    pub count: usize,
    /// The number of eigenvalues before the largest gap. It includes the known eigenvalue 1, but not the eigenvalues of localized
    /// eigenvectors.
    pub at_one: usize,
    /// The distance from 1 of the last eigenvalue before the gap.
    pub last: f64,
    /// The distance from 1 of the eigenvalue after the gap, or a lower bound; `None` if the capture ended before it found this eigenvalue.
    pub next: Option<f64>,
    /// The ratio of `next` to `last`. Here `last` is raised to at least 0.001, and to at least the share of light that a blur carries
    /// across a border.
    pub ratio: Option<f64>,
    /// The part of `count` that only the coordinates of the pixels reveal, because groups were divided.
    pub divided: usize,
    /// The number of levels of the second eigenvector if its eigenvalue is 1 to six digits. Each level is a region without any exchange.
    pub levels: Option<usize>,
    /// True if there may be more regions than `count`, because each starting pattern has found a region, or the gap after the last region
    /// was not seen.
    pub at_least: bool,
    /// True if the gap is wide enough to be trusted, and the number is not only a lower bound.
    pub clear: bool,
    /// Knowledge about regions that the capture may have missed.
    pub unseen: Unseen,
}

impl Regions {
    /// Suggests a number of regions from the eigenvalues and the second eigenvector.
    ///
    /// * `gaps` holds the distances `1 − λ` of the eigenvalues with the residuals of their eigenvectors. The known eigenvalue is first;
    ///   eigenvalues of localized eigenvectors are left out.
    /// * `second` is the second eigenvector `u` on `m` nodes of `degrees` (`uᵀ D u = 1`), with its residual.
    /// * `starts` is the number of starting patterns of the Krylov process.
    /// * `leak` is the share of light that the operator of the process carries across a region's border.
    pub(super) fn suggested(
        gaps: &[(f64, f64)],
        second: Option<(&[f64], f64)>,
        degrees: &[f64],
        starts: usize,
        leak: f64,
    ) -> Self {
        let floor = FLOOR.max(leak);
        let residuals: Vec<f64> = gaps.iter().map(|(_, residual)| *residual).collect();
        let gaps: Vec<f64> = gaps.iter().map(|(gap, _)| *gap).collect();
        // A Ritz value that has not converged may still move nearer to 1.
        let converged = |index: usize| {
            let residual = residuals[index];
            let apart = gaps.get(index + 1).map_or(0.0, |next| next - gaps[index]);
            (gaps[index] - temple_kato(residual, apart)).max(floor)
        };
        let jump = |index: usize| gaps[index + 1].max(floor) / converged(index);
        let jumps = (0..gaps.len().saturating_sub(1)).take_while(|&index| gaps[index] <= 1.0 - KEPT);
        let last = jumps.max_by(|&a, &b| jump(a).total_cmp(&jump(b)).then(b.cmp(&a))).unwrap_or(0);
        let next = gaps.get(last + 1).copied();
        let ratio = next.map(|next| next.max(floor) / gaps[last].max(floor));
        let exact = gaps.iter().take_while(|gap| **gap <= EXACT).count();
        let levels = match second {
            Some((vector, residual)) if exact == 2 => {
                let beyond = gaps.get(2).copied().unwrap_or(1.0).max(EXACT);
                Some(count_levels(vector, degrees, (20.0 * residual / beyond).max(1e-3)))
            }
            _ => None,
        };
        let unseen = levels.map_or(0, |levels| levels.saturating_sub(exact));
        // The known eigenvalue needs no start. A single start separates eigenvalues that differ a little, and the levels of its vector show
        // equal eigenvalues.
        let at_least = next.is_none() || (starts > 1 && last >= starts) || (starts == 1 && last > 1);
        // An eigenvalue may still move nearer to 1 by the residual of its eigenvector.
        let is_far =
            |next: f64| next > 1.0 - KEPT && next - residuals[last + 1] >= CLEAR * gaps[last].max(floor);
        Self {
            count: last + 1 + unseen,
            at_one: last + 1,
            divided: 0,
            last: gaps.get(last).copied().unwrap_or(0.0),
            next,
            ratio,
            levels,
            at_least,
            clear: !at_least && next.is_some_and(is_far),
            unseen: Unseen::default(),
        }
    }

    /// Counts `more` regions that only the coordinates of the pixels show. Copies of eigenvalues are then missing; there may be further
    /// regions.
    pub(super) fn divide(&mut self, more: usize) {
        self.count += more;
        self.divided += more;
        (self.at_least, self.clear) = (true, false);
    }

    pub(super) fn confirm(&mut self, unseen: Unseen) {
        self.unseen = unseen;
        if unseen.missed.is_some() {
            (self.at_least, self.clear) = (true, false);
        }
    }

    /// The number of regions in words, such as `at least 2 independent regions`.
    pub fn count_in_words(&self) -> String {
        let least = if self.at_least || self.next.is_none() { "at least " } else { "" };
        let guess = if self.next.is_some() && !self.at_least && !self.clear { " (a guess)" } else { "" };
        let regions = if self.count == 1 { "region" } else { "regions" };
        format!("{least}{} independent {regions}{guess}", self.count)
    }

    /// The evidence as a sentence, without its full stop.
    pub fn sentence(&self) -> String {
        let regions = self.count_in_words();
        let mut text = match (self.next, self.ratio) {
            (Some(next), Some(ratio)) => format!(
                "the light shows {regions}: {} eigenvalue(s) within {} of one, the next {} from it ({ratio:.0} times as far)",
                self.at_one,
                decimal(self.last.abs(), 4),
                decimal(next, 4)
            ),
            _ => format!(
                "{regions}: all {} eigenvalues are within {} of one; ask for more --eigenvectors",
                self.at_one,
                decimal(self.last.abs(), 4)
            ),
        };
        if let Some(levels) = self.levels.filter(|levels| *levels > 2) {
            text += &format!(
                "; the eigenvector at one has {levels} levels, and so many regions exchange nothing at all"
            );
        }
        if let Some(missed) = self.unseen.missed {
            text += &format!(
                "; a further eigenvalue {} from one was found afterwards, so there may be more: allow more --photos",
                decimal(1.0 - missed, 4)
            );
        } else if self.divided > 0 {
            text += &format!(
                "; {} of them only by the coordinates of their pixels, since not all eigenvectors were found, so there may be more: allow more --photos",
                self.divided
            );
        } else if self.next.is_some() && self.at_least {
            text += "; each starting pattern has found one, so there may be more: allow more --photos, or give --starts";
        } else if self.next.is_some() && !self.clear {
            text += "; the gap is not clear, so this is a guess";
        }
        match self.unseen.completeness {
            // Without a limit below one, nothing is claimed.
            Completeness::Confirmed(claim) if claim.limits[1].is_some_and(|limit| limit < 0.995) => {
                let kept = 100.0 * claim.limits[1].unwrap_or(1.0);
                text += &format!("; no other eigenvector keeps more than {kept:.0} % of its light");
                if claim.chance > 0.0 {
                    text += &format!(", except with a chance of {:.1e}", claim.chance);
                }
            }
            _ => text += "; further regions are not excluded",
        }
        text
    }
}

/// Counts clusters of values in which neighbouring values differ by at most `tolerance` standard deviations. A cluster counts if it has two
/// or more pixels and at least the share [`LEAST_SHARE`] of all light.
fn count_levels(vector: &[f64], degrees: &[f64], tolerance: f64) -> usize {
    let all = degrees.iter().sum::<f64>();
    let apart = tolerance / all.sqrt();
    let mut values: Vec<(f64, f64)> = vector.iter().copied().zip(degrees.iter().copied()).collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let levels = values.chunk_by(|a, b| b.0 - a.0 <= apart);
    let light = |level: &[(f64, f64)]| level.iter().map(|(_, degree)| degree).sum::<f64>();
    levels.filter(|level| level.len() >= 2 && light(level) >= LEAST_SHARE * all).count().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(gaps: &[f64]) -> Vec<(f64, f64)> {
        gaps.iter().map(|&gap| (gap, 0.0)).collect()
    }

    #[test]
    fn a_gap_that_an_unconverged_eigenvector_may_still_close_is_not_clear() {
        let with_residual =
            |residual| Regions::suggested(&[(0.0, 0.0), (0.01, 1e-3), (0.2, residual)], None, &[], 12, 0.0);
        assert!(with_residual(0.1).clear && !with_residual(0.19).clear);
        assert_eq!(with_residual(0.19).count, 2);
    }

    #[test]
    fn the_widest_gap_near_one_is_the_number_of_regions() {
        let suggested = |gaps: &[f64]| Regions::suggested(&exact(gaps), None, &[], 12, 0.0);
        let count = |gaps: &[f64]| suggested(gaps).count;
        assert_eq!(count(&[0.0, 0.2, 0.25, 0.3]), 1);
        assert_eq!(count(&[0.0, 0.006, 0.18, 0.19]), 2);
        assert_eq!(count(&[0.0, 1e-9, 0.001, 0.0012, 0.0036, 0.15, 0.16]), 5);
        // A wide gap far from 1 gives no information on regions.
        assert_eq!(count(&[0.0, 0.16, 0.99]), 1);
        let unclear = suggested(&[0.0, 0.05, 0.1, 0.14, 0.2]);
        assert!(!unclear.clear && unclear.count == 1, "{unclear:?}");
        let open = suggested(&[0.0]);
        assert!(open.next.is_none() && open.sentence().contains("at least 1"), "{}", open.sentence());
    }

    #[test]
    fn a_value_that_is_still_on_its_way_to_one_is_counted_as_there() {
        // The values are from a rig with 40 photos. The second region's eigenvalue may still move nearer to 1 by its residual.
        let gaps = [(0.0, 0.0), (0.0137, 0.061), (0.154, 0.06), (0.217, 0.1)];
        let found = Regions::suggested(&gaps, None, &[], 9, 0.0);
        assert_eq!((found.count, found.clear), (2, true), "{found:?}");
    }

    #[test]
    fn what_a_blur_carries_across_the_border_joins_no_regions() {
        // The values are from the scene zigzag through a rig whose camera is as coarse as the projector, blurred by one pixel of 64.
        let gaps = [(0.0, 0.0), (0.0195, 0.02), (0.188, 0.031), (0.211, 0.064)];
        let suggested = |leak| Regions::suggested(&gaps, None, &[], 9, leak);
        assert_eq!((suggested(0.0).count, suggested(0.0176).count), (1, 2));
        assert!(suggested(0.0176).clear);
    }

    #[test]
    fn as_many_regions_as_starts_are_a_lower_bound() {
        let gaps = [0.0, 0.001, 0.002, 0.001, 0.3];
        let [few, enough] = [3, 4].map(|starts| Regions::suggested(&exact(&gaps), None, &[], starts, 0.0));
        assert!(few.at_least && !few.clear && few.sentence().contains("at least 4"), "{}", few.sentence());
        assert!(!enough.at_least && enough.clear && enough.count == 4, "{}", enough.sentence());
    }

    #[test]
    fn regions_without_any_exchange_are_the_levels_of_one_eigenvector() {
        let vector: Vec<f64> = (0..3000).map(|i| f64::from((i % 4) as u8) * 0.01 + 1e-9 * i as f64).collect();
        let degrees = vec![1.0; 3000];
        let found =
            Regions::suggested(&exact(&[0.0, 0.0, 0.003, 0.2]), Some((&vector, 1e-9)), &degrees, 4, 0.0);
        assert_eq!((found.count, found.at_one, found.levels), (5, 3, Some(4)));
        assert!(found.sentence().contains("4 levels"), "{}", found.sentence());
    }
}
