//! The options of a segmentation.

use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::krylov::Confirm;

/// The normalization of a cut.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Cut {
    /// Light across the cut relative to each side's light: `(D − G) u = (1 − λ) D u`.
    #[default]
    Normalized,
    /// Light across the cut relative to each side's number of pixels: `(D − G) u = λ u`.
    Average,
}

/// The coordinates of pixels that k-means groups.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Coordinates {
    /// By commute times of a random walk along the light: entries in the eigenvectors over √(1 − λ), and pixels weighted by their light
    #[default]
    Commute,
    /// Entries in the eigenvectors as they are, all pixels with the same weight, as in Algorithm 2 of the paper (section 5.2)
    Plain,
}

/// The options of [`segment`](super::segment()).
#[derive(Clone, Debug)]
pub struct SegmentOptions {
    /// The largest number of photos, including the photos of the degree; at least 3. Default 50.
    pub photos: usize,
    /// The numbers of groups, each from 2 to 254. By default there is one number: the number of regions that the light shows, but at least
    /// two.
    pub groups: Vec<usize>,
    /// The number of eigenvectors, including the known eigenvector; at least 2. Each Lanczos photo adds at most one eigenvector. If no
    /// number of groups is given, there is at least one eigenvector per region. Default 10.
    pub eigenvectors: usize,
    /// The number of starting patterns of the Krylov process. Among regions that exchange the same small amount of light, each pattern
    /// finds only one region, so every region needs a pattern. With more patterns, each pattern has fewer photos. If each of several
    /// patterns has found a region and photos are left, the same number of patterns is added. In section 4 of the paper there is one
    /// pattern. Default none: [`SegmentOptions::automatic_starts`] if `resolution` is given, otherwise one.
    pub starts: Option<usize>,
    /// The resolution of patterns and photos. It is used to make several starting patterns smooth, because regions are extended and noise
    /// is not. Default none: random signs, pixel by pixel.
    pub resolution: Option<Resolution>,
    /// The normalization of the cut.
    pub cut: Cut,
    /// The coordinates of pixels that k-means groups.
    pub coordinates: Coordinates,
    /// The weight `μ ≥ 0` added to every edge (in units of `G`), which makes small groups less likely. Default 0.
    pub mu: f64,
    /// The share of a region's light that the operator itself carries across the region's border, as a blur does. Eigenvalues this far from
    /// 1 still count as near 1. Default 0.
    pub leak: f64,
    /// Pixels with at most this share, in [0, 1), of the median degree are masked ([`Graph`](super::Graph::measure)). Default 0.01.
    pub mask_below: f64,
    /// The capture ends early once every eigenvector's residual is at most this share of the matrix norm. Default 1e-6.
    pub tolerance: f64,
    /// Seed of the Lanczos start and of k-means.
    pub seed: u64,
    /// The confirmation, by photos beyond the budget, that no region was missed. Default none: the regions are confirmed only if photos are
    /// free.
    pub confirm: Option<Confirm>,
}

impl Default for SegmentOptions {
    fn default() -> Self {
        Self {
            photos: 50,
            groups: Vec::new(),
            eigenvectors: 10,
            starts: None,
            resolution: None,
            cut: Cut::default(),
            coordinates: Coordinates::default(),
            mu: 0.0,
            leak: 0.0,
            mask_below: 0.01,
            tolerance: 1e-6,
            seed: 0,
            confirm: None,
        }
    }
}

impl SegmentOptions {
    /// The default options with these numbers of groups. All numbers use the same photos.
    pub fn groups(groups: impl IntoIterator<Item = usize>) -> Self {
        Self { groups: groups.into_iter().collect(), ..Self::default() }
    }

    /// The default number of starting patterns for this number of photos: one per four photos, from 1 to 12.
    pub fn automatic_starts(photos: usize) -> usize {
        (photos.saturating_sub(2) / 4).clamp(1, 12)
    }

    pub(super) fn start_count(&self) -> usize {
        let automatic = if self.resolution.is_some() { Self::automatic_starts(self.photos) } else { 1 };
        self.starts.unwrap_or(automatic)
    }

    pub(super) fn check(&self) -> Result<()> {
        let refuse = |option: &str, fault: String, help: &str| Err(Error::option(option, fault).help(help));
        if self.photos < 3 {
            return refuse(
                "--photos",
                format!("{} photos are too few for a segmentation", self.photos),
                "allow at least 3 (one or two for the degree, the rest for eigenvectors), better 50",
            );
        }
        if let Some(groups) = self.groups.iter().find(|groups| !(2..=254).contains(*groups)) {
            return refuse("--groups", format!("{groups} groups"), "give numbers from 2 to 254, e.g. 2,6,10");
        }
        if self.eigenvectors < 2 {
            return refuse(
                "--eigenvectors",
                format!("{} is too few: the first is the same in all pixels", self.eigenvectors),
                "ask for at least 2, better 10",
            );
        }
        if self.starts == Some(0) {
            return refuse("--starts", "no pattern to start from".into(), "give at least 1, better 12");
        }
        if !(self.mu >= 0.0 && self.mu.is_finite()) {
            return refuse("--mu", format!("{} is not a weight", self.mu), "give a number from 0 on");
        }
        if !(0.0..1.0).contains(&self.mask_below) {
            return refuse(
                "--mask-below",
                format!("{} is not a share", self.mask_below),
                "give a number in [0, 1)",
            );
        }
        Ok(())
    }
}
