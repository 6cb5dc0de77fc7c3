//! What a segmentation is asked for, of whatever source.

use clap::ValueEnum;

use crate::analysis::{Cut, SegmentOptions};
use crate::transport::Part;

/// What is asked, of whatever source.
#[derive(clap::Args)]
pub(in crate::cli) struct Question {
    /// Photos to take at most [default: 50, or as many as the run that is SOURCE might take]
    #[arg(long, value_name = "N")]
    photos: Option<usize>,
    /// Numbers of groups, all from the same photos
    #[arg(long, value_name = "K,K,...", value_delimiter = ',', default_value = "2,6,10")]
    groups: Vec<usize>,
    /// Eigenvectors that the groups are made from
    #[arg(long, value_name = "N", default_value_t = 10)]
    eigenvectors: usize,
    /// Weigh the light across a cut against each side's light, or against its number of pixels
    #[arg(long, value_enum, default_value = "normalized")]
    cut: CutArg,
    /// Added to every edge of the graph, in units of A: very small groups are worth less
    #[arg(long, value_name = "X", default_value_t = 0.0)]
    mu: f64,
    /// Keep the direct light, as a rig that cannot tell it apart would: the same as --direct keep
    #[arg(long)]
    pub(super) keep_direct: bool,
    /// Mask pixels with less than this share of the median global light
    #[arg(long, value_name = "SHARE", default_value_t = 0.01)]
    mask_below: f64,
}

#[derive(Clone, Copy, ValueEnum)]
enum CutArg {
    Normalized,
    Average,
}

impl Question {
    /// As the library has it; `seed` for what is chosen by chance, `held` the photos of a run that is asked anew.
    pub(in crate::cli) fn options(&self, seed: u64, held: Option<usize>) -> SegmentOptions {
        SegmentOptions {
            photos: self.photos.or(held).unwrap_or(50),
            groups: self.groups.clone(),
            eigenvectors: self.eigenvectors,
            cut: match self.cut {
                CutArg::Normalized => Cut::Normalized,
                CutArg::Average => Cut::Average,
            },
            mu: self.mu,
            mask_below: self.mask_below,
            seed,
            ..SegmentOptions::default()
        }
    }

    /// The numbers of groups.
    pub(super) fn groups(&self) -> &[usize] {
        &self.groups
    }

    /// Which light.
    pub(in crate::cli) fn part(&self) -> Part {
        if self.keep_direct { Part::Full } else { Part::Global }
    }
}
