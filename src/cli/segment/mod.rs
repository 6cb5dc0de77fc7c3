//! `krylux segment`: light transport segmentation, from the scene to the report.

mod photos;
mod question;
mod verdict;

use anyhow::Result;
use serde_json::json;

use super::Outcome;
use super::about;
use super::console::Console;
use super::live::{Live, LiveArgs};
use super::operator::OperatorArgs;
use super::options::{OutputArgs, RunArgs, SourceArgs};
use super::run_folder::RunFolder;
use super::source::Source;
use super::trace::TraceArgs;
use crate::analysis::Capture;
use crate::analysis::segment::feature_view;
use crate::observer::{OnStep, Step};
use crate::operator::Observed;
use crate::report::segmentation::{SegmentationExtras, SegmentationRun};
use crate::transport::Channels;
use photos::{Graph, LightArgs};
pub(super) use question::Question;

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
    #[command(flatten)]
    light: LightArgs,
    /// Exit with 1 if the groups agree less than this with the scene's true labels (adjusted Rand index, at the number of
    /// groups that the labels have)
    #[arg(long, value_name = "X")]
    min_rand_index: Option<f64>,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    // What is wrong with the options or the scene should show before anything is written or traced.
    Capture::new(args.question.options(args.trace.seed(), None))?;
    let mut source = Source::open(&args.source, &args.trace, console)?;
    let options = args.question.options(args.trace.seed(), source.held());
    let photos = options.photos;
    let capture = Capture::new(options)?;
    let graph = args.light.graph(&args.question, source.resolution(), args.trace.seed())?;
    let mut folder = RunFolder::create(&args.run, &format!("{}-segment", source.name()), console)?;
    source.describe(&mut folder.manifest, Channels::Luma);
    folder.manifest.photos_allowed = Some(photos);
    let outcome = segment(args, console, (capture, &graph), &mut source, &mut folder);
    folder.close(outcome)
}

fn segment(
    args: &Args,
    console: &Console,
    (mut capture, graph): (Capture, &Graph),
    source: &mut Source,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let (name, resolution, unit) = (source.name(), source.resolution(), source.unit());
    let live = Live::new(&args.live, source, Channels::Luma, console);
    let photos = folder.manifest.photos_allowed.unwrap_or(0);
    let truth = folder.timed("true labels", |_| source.truth())?;
    if let Some(truth) = &truth {
        folder.keep(about::TRUTH, truth)?;
    }
    let mut light = folder.timed(source.preparation(), |folder| {
        source.light(&args.operator, Channels::Luma, Some(folder), console)
    })?;
    folder.describe_light(&light);

    live.expect(photos + graph.beside(&args.question));
    let taken = folder.timed("photos", |_| {
        light.with_operator(graph.part, console, |operator| {
            let observer = OnStep::new(|step: &Step<'_>| live.so_far(step.estimate));
            graph.photograph(&mut Observed::new(&mut live.watch(0, operator), &observer), &mut capture)
        })
    });
    live.pause();
    let taken = folder.record_rig(&mut light, taken, console)?;
    if console.check().is_break() {
        return Err(crate::Error::Interrupted.into());
    }
    let segmentation = &taken.segmentation;
    let features = match args.light.chosen().as_slice() {
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
    let strip = live.strip();
    let run = SegmentationRun {
        title: format!("{name} · light transport segmentation"),
        segmentation,
        resolution,
        white: &white,
        truth: truth.as_ref(),
        scores: &scores,
        extras,
        unit,
        strip: &strip,
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
        "within": segmentation.embedding.within,
        "noise": folder.manifest.noise,
        "rig": folder.manifest.rig,
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
