//! What `krylux segment` is asked.

use std::str::FromStr;

use clap::ValueEnum;

use crate::analysis::segment::{DirectLight, SegmentRequest};
use crate::analysis::{Cut, DirectMethod, SegmentOptions};
use crate::cli::options::{count, number};
use crate::error::{Error, Result};
use crate::krylov::Confirm;
use crate::transport::Part;

/// What is asked, of whatever source.
#[derive(clap::Args)]
pub(in crate::cli) struct Question {
    /// Photos to take at most [default: 50, or the budget of the run that is SOURCE]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    photos: Option<usize>,
    /// Numbers of groups, all from the same photos [default: the number of regions that the light shows]
    #[arg(long, value_name = "K,K,...", value_delimiter = ',', value_parser = count::<usize>)]
    groups: Vec<usize>,
    /// Patterns that the photos start from: no fewer than regions; 1 is the paper's process [default: a quarter of the
    /// photos, from 1 to 12]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    starts: Option<usize>,
    /// Eigenvectors that the groups are made from
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = count::<usize>)]
    eigenvectors: usize,
    /// Weigh the light across a cut against each side's light, or against its number of pixels
    #[arg(long, value_enum, default_value = "normalized")]
    cut: CutArg,
    /// Added to every edge of the graph, in units of A: very small groups are worth less
    #[arg(long, value_name = "X", default_value_t = 0.0, value_parser = number::<f64>)]
    mu: f64,
    /// Keep the direct light, as a rig that cannot tell it apart would: the same as --direct keep
    #[arg(long)]
    keep_direct: bool,
    /// Mask pixels with less than this share of the median global light
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = number::<f64>)]
    mask_below: f64,
    /// Confirm that no region was missed: none whose eigenvalue is above those found by more than this share of the spectrum's spread. On
    /// a rig it takes further photos: 28 at 128×128 pixels for 0.05. Traced scenes are confirmed in any case [default there: 0.01]
    #[arg(long, value_name = "SHARE", value_parser = number::<f64>)]
    confirm: Option<f64>,
}

#[derive(Clone, Copy, ValueEnum)]
enum CutArg {
    Normalized,
    Average,
}

impl Question {
    /// The library's options; `seed` for all choices by chance, `photos_of_run` the default budget of a run that is asked again.
    pub(in crate::cli) fn options(&self, seed: u64, photos_of_run: Option<usize>) -> SegmentOptions {
        SegmentOptions {
            photos: self.photos.or(photos_of_run).unwrap_or(50),
            groups: self.groups.clone(),
            eigenvectors: self.eigenvectors,
            // Fewer photos of a run than it has ask for the same patterns.
            starts: self.starts.or(photos_of_run.map(SegmentOptions::automatic_starts)),
            cut: match self.cut {
                CutArg::Normalized => Cut::Normalized,
                CutArg::Average => Cut::Average,
            },
            mu: self.mu,
            mask_below: self.mask_below,
            confirm: self.confirm.map(|share| Confirm { share, ..Confirm::default() }),
            seed,
            ..SegmentOptions::default()
        }
    }

    /// Which light.
    pub(in crate::cli) fn part(&self) -> Part {
        if self.keep_direct { Part::Full } else { Part::Global }
    }
}

/// Which light makes the graph, and what else is to be seen of it.
#[derive(clap::Args)]
pub(super) struct LightArgs {
    /// How direct light, which says nothing about groups, is kept apart
    #[arg(long, value_enum, default_value = "source", conflicts_with = "keep_direct")]
    direct: DirectArg,
    /// Photos of direct light where it is measured: of random patterns, or of squares shifted to as many places
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = count::<usize>)]
    direct_photos: usize,
    /// Pixels of a square's side, for --direct patterns
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = count::<usize>)]
    direct_square: usize,
    /// Blur patterns and photos alike by a Gaussian of so many pixels: less noise, and still symmetric [default: 1 on a calibrated rig whose
    /// camera has fewer than two pixels along a side for each of the projector's, else 0]
    #[arg(long, value_name = "PIXELS", value_parser = number::<f64>)]
    blur: Option<f64>,
    /// Show where these pixels lie in the space of eigenvectors, and how far apart
    #[arg(long, value_name = "X,Y;X,Y;...", value_delimiter = ';')]
    features: Vec<Pixel>,
    /// Light each group alone, one more photo for each: how much of its light stays within it
    #[arg(long)]
    evidence: bool,
}

/// `--direct`.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum DirectArg {
    /// The source leaves it out: a simulator exactly, a rig as its file says
    #[value(alias = "simulator")]
    Source,
    /// Measured by Nayar's shifted checkerboards
    Patterns,
    /// Estimated from photos of random patterns, as the diagonal of A
    Estimator,
    /// Kept, as by a rig that cannot tell it apart
    Keep,
}

/// `--features`: a column and a row.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pixel(usize, usize);

impl FromStr for Pixel {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parsed =
            text.split_once(',').and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
        let (x, y) = parsed.ok_or_else(|| format!("`{text}` is no pixel; write column,row as in 20,35"))?;
        Ok(Self(x, y))
    }
}

impl LightArgs {
    /// The library's request.
    pub(super) fn request(&self, options: SegmentOptions, question: &Question) -> Result<SegmentRequest> {
        Ok(SegmentRequest {
            options,
            direct: self.direct(question.keep_direct)?,
            blur: self.blur,
            features: self.features.iter().map(|&Pixel(x, y)| (x, y)).collect(),
            evidence: self.evidence,
        })
    }

    fn direct(&self, keep: bool) -> Result<DirectLight> {
        Ok(match self.direct {
            DirectArg::Source if !keep => DirectLight::Source,
            DirectArg::Source | DirectArg::Keep => DirectLight::Keep,
            DirectArg::Estimator => {
                DirectLight::Measured(DirectMethod::Estimator { photos: self.direct_photos })
            }
            DirectArg::Patterns => {
                let shifts = self.direct_photos.isqrt();
                if shifts < 2 || shifts * shifts != self.direct_photos {
                    return Err(Error::Option {
                        option: "--direct-photos".into(),
                        fault: format!("{} photos of shifted squares", self.direct_photos),
                        help: "give a square number from 4 on: 4, 9, 16, 25".into(),
                    });
                }
                DirectLight::Measured(DirectMethod::Checkerboards { square: self.direct_square, shifts })
            }
        })
    }
}
