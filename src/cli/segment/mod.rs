//! `krylux segment`: light transport segmentation, from the scene to the report.

mod photos;
mod verdict;

use std::str::FromStr;

use anyhow::Result;
use clap::ValueEnum;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::operator::OperatorArgs;
use super::options::{OutputArgs, RunArgs, SourceArgs};
use super::run_folder::RunFolder;
use super::source::Source;
use super::trace::TraceArgs;
use crate::analysis::segment::feature_view;
use crate::analysis::{Capture, Cut, SegmentOptions};
use crate::image::Resolution;
use crate::report::segmentation::{SegmentationExtras, SegmentationRun};
use crate::transport::Channels;
use photos::{DirectArg, Question};

/// Segment a scene by how light travels in it: pixels that exchange light form a group
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    operator: OperatorArgs,
    /// Photos to take at most
    #[arg(long, value_name = "N", default_value_t = 50)]
    photos: usize,
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
    /// How direct light, which tells nothing of groups, is told apart
    #[arg(long, value_enum, default_value = "simulator")]
    direct: DirectArg,
    /// Photos of direct light where it is measured: of random patterns, or of squares shifted to as many places
    #[arg(long, value_name = "N", default_value_t = 16)]
    direct_photos: usize,
    /// Pixels of a square's side, for --direct patterns
    #[arg(long, value_name = "N", default_value_t = 4)]
    direct_square: usize,
    /// The same as --direct keep
    #[arg(long, conflicts_with = "direct")]
    keep_direct: bool,
    /// Blur patterns and photos alike by a Gaussian of so many pixels: less noise, and still symmetric
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    blur: f64,
    /// Show where these pixels lie in the space of eigenvectors, and how far apart
    #[arg(long, value_name = "X,Y;X,Y;...", value_delimiter = ';')]
    features: Vec<Pixel>,
    /// Light each group alone, one more photo for each: how much of its light stays within it
    #[arg(long)]
    evidence: bool,
    /// Mask pixels with less than this share of the median global light
    #[arg(long, value_name = "SHARE", default_value_t = 0.01)]
    mask_below: f64,
    /// Exit with 1 if the groups agree less than this with the scene's true labels (adjusted Rand index, at the number of
    /// groups that the labels have)
    #[arg(long, value_name = "X")]
    min_rand_index: Option<f64>,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum CutArg {
    Normalized,
    Average,
}

/// `--features`: a column and a row.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pixel(usize, usize);

impl FromStr for Pixel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed =
            text.split_once(',').and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
        let (x, y) = parsed.ok_or_else(|| format!("`{text}` is no pixel; write column,row as in 20,35"))?;
        Ok(Self(x, y))
    }
}

impl Args {
    fn chosen(&self) -> Vec<(usize, usize)> {
        self.features.iter().map(|&Pixel(x, y)| (x, y)).collect()
    }

    /// Whether a pixel is in the picture is known before any photo.
    fn check_pixels(&self, resolution: Resolution) -> crate::Result<()> {
        let outside = |&(x, y): &(usize, usize)| x >= resolution.width || y >= resolution.height;
        match self.chosen().into_iter().find(outside) {
            None => Ok(()),
            Some((x, y)) => Err(crate::Error::Option {
                option: "--features".into(),
                fault: format!("pixel {x},{y} is outside of the picture"),
                help: format!("it has {resolution} pixels; columns and rows are counted from 0"),
            }),
        }
    }

    fn question(&self, resolution: Resolution) -> Question {
        Question {
            direct: if self.keep_direct { DirectArg::Keep } else { self.direct },
            direct_photos: self.direct_photos,
            square: self.direct_square,
            blur: self.blur,
            resolution,
            seed: self.trace.seed(),
        }
    }

    fn options(&self) -> SegmentOptions {
        SegmentOptions {
            photos: self.photos,
            groups: self.groups.clone(),
            eigenvectors: self.eigenvectors,
            cut: match self.cut {
                CutArg::Normalized => Cut::Normalized,
                CutArg::Average => Cut::Average,
            },
            mu: self.mu,
            mask_below: self.mask_below,
            seed: self.trace.seed(),
            ..SegmentOptions::default()
        }
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    // What is wrong with the options or the scene should show before anything is written or traced.
    let capture = Capture::new(args.options())?;
    let mut source = Source::open(&args.source, &args.trace, console)?;
    let question = args.question(source.resolution());
    question.check()?;
    args.check_pixels(source.resolution())?;
    let mut folder = RunFolder::create(&args.run, &format!("{}-segment", source.name()))?;
    source.describe(&mut folder.manifest, Channels::Luma);
    let outcome = segment(args, console, (capture, &question), &mut source, &mut folder);
    folder.close(outcome)
}

fn segment(
    args: &Args,
    console: &Console,
    (mut capture, question): (Capture, &Question),
    source: &mut Source,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let (name, resolution) = (source.name(), source.resolution());
    let truth = folder.timed("true labels", |_| source.truth())?;
    let mut light =
        folder.timed(source.preparation(), |_| source.light(&args.operator, Channels::Luma, console))?;
    folder.manifest.noise = light.noise().map(Into::into);

    let bar = console.bar("photos");
    let taken = folder.timed("photos", |_| {
        light.with_operator(question.part(), console, |operator| {
            question.ask(operator, &mut capture, args.evidence, &mut |step| {
                bar.at(step.products as u64, step.budget as u64)
            })
        })
    })?;
    drop(bar);
    if console.check().is_break() {
        return Err(crate::Error::Interrupted.into());
    }
    let segmentation = &taken.segmentation;
    let features = match args.chosen().as_slice() {
        [] => None,
        chosen => Some(feature_view(segmentation, resolution, chosen)?),
    };
    let extras = SegmentationExtras {
        direct: taken.direct.as_ref(),
        features: features.as_ref(),
        evidence: &taken.evidence,
    };
    folder.manifest.photos = (segmentation.photos + extras.photos()) as u64;
    let scores = verdict::score(segmentation, truth.as_ref())?;
    verdict::say(&taken, &scores, console)?;
    let white = light.white(console)?;
    let run = SegmentationRun {
        title: format!("{name} · light transport segmentation"),
        segmentation,
        resolution,
        white: &white,
        truth: truth.as_ref(),
        scores: &scores,
        extras,
    };
    let seconds = folder.seconds();
    let files = folder.timed("files", |folder| run.write(&folder.path, &folder.manifest, seconds))?;
    folder.manifest.outputs = files;

    let report = folder.path.join("report.html");
    console.say(format_args!("pictures  {}", folder.path.display()))?;
    console.say(format_args!("report    {}", report.display()))?;
    console.summary(&json!({
        "verb": "segment",
        "folder": folder.path,
        "report": report,
        "photos": segmentation.photos,
        "photos_direct": taken.direct.as_ref().map(|direct| direct.photos),
        "status": segmentation.status,
        "regions": segmentation.regions,
        "eigenvalues": segmentation.eigenvalues,
        "residuals": segmentation.residuals,
        "noise": folder.manifest.noise,
        "masked": segmentation.mask.iter().filter(|&&masked| masked).count(),
        "adjusted_rand_index": scores.iter().map(|(k, s)| (k.to_string(), json!(s))).collect::<serde_json::Map<_, _>>(),
        "evidence": taken.evidence.iter().map(|of| {
            json!({ "groups": of.groups, "photos": of.photos.len(), "cut": of.cut(), "kept": of.kept(), "exchange": of.exchange })
        }).collect::<Vec<_>>(),
        "features": features.as_ref().map(|view| json!({ "pixels": view.pixels, "coordinates": view.coordinates, "distances": view.distances })),
        "seconds": folder.seconds(),
    }))?;
    let outcome = verdict::judge(args.min_rand_index, &scores, truth.as_ref(), console)?;
    Ok((outcome, segmentation.status.clone()))
}
