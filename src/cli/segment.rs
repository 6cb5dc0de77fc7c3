//! `krylux segment`: light transport segmentation, from the scene to the report.

use anyhow::Result;
use clap::ValueEnum;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::operator::OperatorArgs;
use super::options::{OutputArgs, RunArgs, SourceArgs};
use super::replay;
use super::run_folder::RunFolder;
use super::source::Source;
use super::trace::TraceArgs;
use crate::analysis::{Capture, Cut, SegmentOptions, Segmentation, adjusted_rand_index};
use crate::report::segmentation::{SegmentationRun, Truth};
use crate::transport::{Channels, Part};

/// Segment a scene by how light travels in it: pixels that exchange light form a group
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    question: Question,
    /// Exit with 1 if the groups agree less than this with the scene's true labels (adjusted Rand index, at the number of
    /// groups that the labels have)
    #[arg(long, value_name = "X")]
    min_rand_index: Option<f64>,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

/// What is asked, of whatever source.
#[derive(clap::Args)]
pub(super) struct Question {
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
    /// Keep the direct light, as a rig that cannot tell it apart would
    #[arg(long)]
    keep_direct: bool,
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
    /// As the library has it; `seed` for what is chosen by chance.
    pub(super) fn options(&self, seed: u64) -> SegmentOptions {
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
            seed,
            ..SegmentOptions::default()
        }
    }

    /// Which light.
    pub(super) fn part(&self) -> Part {
        if self.keep_direct { Part::Full } else { Part::Global }
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    // What is wrong with the options or the scene should show before anything is written or traced.
    let capture = Capture::new(args.question.options(args.trace.seed()))?;
    let mut source = Source::open(&args.source, &args.trace, console)?;
    let mut folder = RunFolder::create(&args.run, &format!("{}-segment", source.name()), console)?;
    source.describe(&mut folder.manifest, Channels::Luma);
    let outcome = segment(args, console, capture, &mut source, &mut folder);
    folder.close(outcome)
}

fn segment(
    args: &Args,
    console: &Console,
    mut capture: Capture,
    source: &mut Source,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let (name, resolution) = (source.name(), source.resolution());
    let truth = folder.timed("true labels", |_| source.truth())?;
    if let Some(truth) = &truth {
        folder.keep(replay::TRUTH, truth)?;
    }
    let mut light = folder.timed(source.preparation(), |folder| {
        source.light(&args.operator, Channels::Luma, Some(folder), console)
    })?;
    folder.manifest.noise = light.noise().map(Into::into);

    let bar = console.bar("photos");
    let taken = folder.timed("photos", |_| {
        light.with_operator(args.question.part(), console, |operator| {
            capture.run(operator, &mut |step| bar.at(step.products as u64, step.budget as u64))
        })
    });
    drop(bar);
    folder.record_rig(&mut light, taken, console)?;
    if console.check().is_break() {
        return Err(crate::Error::Interrupted.into());
    }
    let segmentation = folder.timed("groups", |_| capture.segmentation())?;
    folder.manifest.photos = segmentation.photos as u64;
    say(&segmentation, console)?;

    let scores = score(&segmentation, truth.as_ref())?;
    for &(groups, score) in &scores {
        console.say(format_args!(
            "groups    {groups:>3}: adjusted Rand index {score:.4} against the true labels"
        ))?;
    }
    let white = light.white(console)?;
    let run = SegmentationRun {
        title: format!("{name} · light transport segmentation"),
        segmentation: &segmentation,
        resolution,
        white: &white,
        truth: truth.as_ref(),
        scores: &scores,
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
        "status": segmentation.status,
        "eigenvalues": segmentation.eigenvalues,
        "residuals": segmentation.residuals,
        "noise": folder.manifest.noise,
        "rig": folder.manifest.rig,
        "masked": segmentation.mask.iter().filter(|&&masked| masked).count(),
        "adjusted_rand_index": scores.iter().map(|(k, s)| (k.to_string(), json!(s))).collect::<serde_json::Map<_, _>>(),
        "seconds": folder.seconds(),
    }))?;
    Ok((judge(args, &scores, truth.as_ref(), console)?, segmentation.status))
}

/// The adjusted Rand index of each number of groups.
fn score(segmentation: &Segmentation, truth: Option<&Truth>) -> Result<Vec<(usize, f64)>> {
    let Some(truth) = truth else { return Ok(Vec::new()) };
    let score =
        |(groups, labels): &(usize, Vec<u8>)| Ok((*groups, adjusted_rand_index(labels, &truth.labels)?));
    segmentation.labels.iter().map(score).collect()
}

fn say(segmentation: &Segmentation, console: &Console) -> Result<()> {
    console.say(format_args!("photos    {}", segmentation.status))?;
    let masked = segmentation.mask.iter().filter(|&&masked| masked).count();
    if masked > 0 {
        let share = 100.0 * masked as f64 / segmentation.mask.len() as f64;
        console.say(format_args!("masked    {masked} pixels without global light ({share:.1} %)"))?;
    }
    console.say("          eigenvalue   residual")?;
    for (index, (value, residual)) in segmentation.eigenvalues.iter().zip(&segmentation.residuals).enumerate()
    {
        console.say(format_args!("  {:>6}  {value:>10.6}   {residual:.1e}", index + 1))?;
    }
    Ok(())
}

/// Whether the groups are as good as the user demanded.
fn judge(args: &Args, scores: &[(usize, f64)], truth: Option<&Truth>, console: &Console) -> Result<Outcome> {
    let Some(wanted) = args.min_rand_index else { return Ok(Outcome::Done) };
    let Some(truth) = truth else {
        return Err(crate::Error::Option {
            option: "--min-rand-index".into(),
            fault: "the scene has no true labels to compare with".into(),
            help: "give regions by `region` in the extras of its nodes, meshes or primitives".into(),
        }
        .into());
    };
    let regions = truth.seen();
    let Some(&(_, score)) = scores.iter().find(|(groups, _)| *groups == regions) else {
        return Err(crate::Error::Option {
            option: "--min-rand-index".into(),
            fault: format!(
                "the scene shows {regions} labelled regions, but --groups does not ask for {regions}"
            ),
            help: format!("add --groups {regions}"),
        }
        .into());
    };
    if score < wanted {
        console.note(format_args!("the adjusted Rand index {score:.4} is below {wanted}"));
        return Ok(Outcome::NotGoodEnough);
    }
    Ok(Outcome::Done)
}
