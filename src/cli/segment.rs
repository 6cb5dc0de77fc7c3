//! `krylux segment`: light transport segmentation, from the scene to the report.

mod question;

use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::{Ending, Opening, finish, in_run};
use super::operator::OperatorArgs;
use super::options::{CheckArgs, RunArgs, SourceArgs, number};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::analysis::segment::{SegmentRequest, Truth};
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade, Ratio};
use crate::lab::text::{decimal, rounded, with_error};
use crate::lab::{Lab, Scored};
use crate::paint::Answer;
use crate::paint::page::Kept;
use question::LightArgs;
pub(super) use question::Question;

/// Segment a scene by how light travels in it: pixels that exchange light form a group
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  krylux segment scene.glb --groups 2,6 -o out/groups\n  krylux segment out/groups --groups 3     # the same photos, another question"
)]
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
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    min_rand_index: Option<f64>,
    #[command(flatten)]
    check: CheckArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let opening = Opening::new(&args.source, &args.trace).operator(&args.operator);
    // Wrong options should show before anything is written or traced.
    let seed = args.trace.overrides().vector_seed();
    crate::analysis::Capture::new(args.question.options(seed, None))?;
    let mut lab = opening.open_shown(&args.live, console)?;
    let request = args.light.request(args.question.options(seed, lab.photos_of_run()), &args.question)?;
    request.check(lab.resolution())?;
    in_run(&mut lab, &args.run, "segment", |lab| answer(args, &request, lab, console))
}

fn answer(args: &Args, request: &SegmentRequest, lab: &mut Lab, console: &Console) -> Result<Outcome> {
    let segmented = lab.segment(request)?;
    console.go_on()?;
    let truth = lab.known_truth()?;
    let scores = truth.as_ref().map(|truth| truth.scores(&segmented.segmentation)).transpose()?;
    let scores = scores.unwrap_or_default();
    let is_checked = args.check.is_on() && request.is_of_photos_as_taken(&segmented);
    let verified = match is_checked {
        true => lab.verify_segmentation(request.part(), request.options.cut, &segmented.segmentation)?,
        false => None,
    };
    let at_one = segmented.segmentation.regions.at_one;
    let refuted = verified.as_ref().map_or(0, |verified| verified.refuted(at_one));
    let (estimates, supported) =
        verified.map(|verified| (verified.estimates, verified.supported)).unwrap_or_default();
    let answer = Scored {
        segmented: &segmented,
        truth: truth.as_ref(),
        scores: &scores,
        estimates: &estimates,
        supported: &supported,
        is_undivided: request.options.groups.is_empty() && segmented.segmentation.regions.count < 2,
    };
    say(&answer, console)?;
    let summary = summary(&answer, refuted);
    if refuted > 0 {
        console.note(format_args!(
            "warning: {refuted} of the {at_one} eigenvectors that were counted as regions are noise: other light paths do not confirm them; give more --spp"
        ));
    }
    if answer.is_undivided {
        console.note(
            "the light shows one region, which has no groups to tell apart; the two that are shown divide it, as --groups 2 asks for",
        );
    }
    let kept = Kept { groups: Some(Answer::from(&segmented.segmentation)), eigenvectors: None };
    // What is wrong with the option is told once the answer is written.
    let agreement = agreement(args.min_rand_index, &scores, truth.as_ref());
    let demands = agreement.as_ref().ok().cloned().flatten().into_iter().collect();
    let (_, outcome) = finish(lab, console, &answer, Ending { run: &args.run, demands, summary, kept })?;
    agreement.map(|_| outcome)
}

fn summary(answer: &Scored<'_>, refuted: usize) -> serde_json::Value {
    let Scored { segmented, scores, estimates, .. } = answer;
    let segmentation = &segmented.segmentation;
    let scores = scores.iter().map(|(groups, score)| (groups.to_string(), json!(score)));
    json!({
        "photos": segmentation.photos,
        "photos_direct": segmented.direct.as_ref().map(|direct| direct.photos),
        "status": segmentation.status,
        "there_and_back": segmented.there_and_back,
        "regions": segmentation.regions,
        "refuted_regions": refuted,
        "blur": segmented.blur,
        "eigenvalues": segmentation.eigenvalues.iter().enumerate().map(|(index, &value)| {
            let estimate = index.checked_sub(1).and_then(|index| estimates.get(index));
            rounded(value, estimate.map_or(0.0, |of| of.standard_error))
        }).collect::<Vec<f64>>(),
        "residuals": segmentation.residuals,
        // The first is known.
        "of_scene": estimates.iter().map(|of| json!({
            "eigenvalue": rounded(of.value, of.standard_error),
            "standard_error": of.standard_error,
        })).collect::<Vec<_>>(),
        "within": segmentation.embedding.within,
        "masked": segmentation.mask.iter().filter(|&&masked| masked).count(),
        "share_of_sure": segmentation.labels.iter()
            .map(|(groups, _)| (groups.to_string(), json!(answer.share_of_sure(*groups))))
            .collect::<serde_json::Map<_, _>>(),
        "adjusted_rand_index": scores.collect::<serde_json::Map<_, _>>(),
        "evidence": segmented.evidence.iter().map(|of| json!({
            "groups": of.groups,
            "photos": of.photos.len(),
            "cut": of.cut(),
            "kept": of.kept(),
            "exchange": of.exchange,
        })).collect::<Vec<_>>(),
        "features": segmented.features.as_ref().map(|view| json!({
            "pixels": view.pixels,
            "coordinates": view.coordinates,
            "distances": view.distances,
        })),
    })
}

fn say(answer: &Scored<'_>, console: &Console) -> Result<()> {
    let Scored { segmented, scores, estimates, .. } = answer;
    let segmentation = &segmented.segmentation;
    if let Some(direct) = &segmented.direct {
        let [own, global] = [&direct.direct, &direct.global].map(|light| light.iter().sum::<f64>());
        let share = Ratio::of(own, own + global, 0.0);
        console.say(format_args!("direct    {share} of the light, from {} photos", direct.photos))?;
    }
    console.say(format_args!("photos    {}", segmentation.status))?;
    if segmented.there_and_back {
        console.say(
            "matrix    not symmetric: camera and projector stand apart; every second photo is one with the two exchanged",
        )?;
    }
    let masked = segmentation.mask.iter().filter(|&&masked| masked).count();
    if masked > 0 {
        let share = 100.0 * masked as f64 / segmentation.mask.len() as f64;
        console.say(format_args!("masked    {masked} pixels without global light ({share:.1} %)"))?;
    }
    let of_scene = if estimates.is_empty() { "" } else { "   of the scene" };
    console.say(format_args!("          eigenvalue   residual{of_scene}"))?;
    for (index, (value, residual)) in segmentation.eigenvalues.iter().zip(&segmentation.residuals).enumerate()
    {
        let note = if segmentation.embedding.is_local(index) { "   localized eigenvector" } else { "" };
        let estimate = index.checked_sub(1).and_then(|index| estimates.get(index));
        let (value, of_scene) = match estimate {
            Some(of) => (
                rounded(*value, of.standard_error).to_string(),
                format!("   {:<16}", with_error(of.value, of.standard_error)),
            ),
            None => (decimal(*value, 6), String::new()),
        };
        console.say(format_args!("  {:>6}  {value:>10}   {residual:.1e}{of_scene}{note}", index + 1))?;
    }
    console.say(format_args!("regions   {}", segmentation.regions.sentence()))?;
    for (groups, _) in &segmentation.labels {
        let sure = 100.0 * answer.share_of_sure(*groups).unwrap_or(0.0);
        let score = scores.iter().find(|(of, _)| of == groups);
        let score =
            score.map(|(_, score)| format!("; adjusted Rand index {score:.4} against the true labels"));
        console.say(format_args!(
            "groups    {groups:>3}: {sure:.1} % of the pixels are sure of theirs{}",
            score.unwrap_or_default()
        ))?;
    }
    for evidence in &segmented.evidence {
        let least = evidence.kept().into_iter().fold(1.0, f64::min);
        console.say(format_args!(
            "evidence  {:>3} groups, each lit alone: the cut is {:.4}, and each keeps {:.2} % of its light or more",
            evidence.groups,
            evidence.cut(),
            100.0 * least
        ))?;
    }
    Ok(())
}

/// Whether the groups agree with the true labels as well as the user demands.
fn agreement(least: Option<f64>, scores: &[(usize, f64)], truth: Option<&Truth>) -> Result<Option<Finding>> {
    let Some(least) = least else { return Ok(None) };
    let refuse =
        |fault: String, help: String| Err(Error::Option { option: "--min-rand-index".into(), fault, help });
    let Some(truth) = truth else {
        return refuse(
            "the scene has no true labels to compare with".into(),
            "give regions by `region` in the extras of its nodes, meshes or primitives".into(),
        );
    };
    let regions = truth.seen();
    let Some(&(_, score)) = scores.iter().find(|(groups, _)| *groups == regions) else {
        return refuse(
            format!("the scene shows {regions} labelled regions, but --groups does not ask for {regions}"),
            format!("add --groups {regions}"),
        );
    };
    // A bound that is not a number is missed, not passed.
    let grade = if score >= least { Grade::Ok } else { Grade::Fails };
    let found = format!("the adjusted Rand index against the true labels is {score:.4}");
    let help = "give more --photos or --spp";
    Ok(Some(Finding::graded("agreement", grade, found, format!("at least {least}"), help)))
}
