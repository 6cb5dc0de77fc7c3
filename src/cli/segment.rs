//! `krylux segment`: light transport segmentation, from the scene to the report.

use std::str::FromStr;

use clap::ValueEnum;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::{Ending, Opening, finish, in_run};
use super::operator::OperatorArgs;
use super::options::{OutputArgs, RunArgs, SourceArgs};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::analysis::segment::{DirectLight, SegmentRequest, Segmented, Truth};
use crate::analysis::{Cut, DirectMethod, SegmentOptions};
use crate::error::{Error, Result};
use crate::lab::{Lab, Scored};
use crate::transport::Part;

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

/// What is asked, of whatever source.
#[derive(clap::Args)]
pub(super) struct Question {
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
    /// The library's options; `seed` for all choices by chance, `photos_of_run` the default budget of a run that is asked again.
    pub(super) fn options(&self, seed: u64, photos_of_run: Option<usize>) -> SegmentOptions {
        SegmentOptions {
            photos: self.photos.or(photos_of_run).unwrap_or(50),
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

/// Which light makes the graph, and what else is to be seen of it.
#[derive(clap::Args)]
struct LightArgs {
    /// How direct light, which says nothing about groups, is kept apart
    #[arg(long, value_enum, default_value = "source", conflicts_with = "keep_direct")]
    direct: DirectArg,
    /// Photos of direct light where it is measured: of random patterns, or of squares shifted to as many places
    #[arg(long, value_name = "N", default_value_t = 16)]
    direct_photos: usize,
    /// Pixels of a square's side, for --direct patterns
    #[arg(long, value_name = "N", default_value_t = 4)]
    direct_square: usize,
    /// Blur patterns and photos alike by a Gaussian of so many pixels: less noise, and still symmetric
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    blur: f64,
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

impl Args {
    fn request(&self, options: SegmentOptions) -> Result<SegmentRequest> {
        Ok(SegmentRequest {
            options,
            direct: self.light.direct(self.question.keep_direct)?,
            blur: self.light.blur,
            features: self.light.features.iter().map(|&Pixel(x, y)| (x, y)).collect(),
            evidence: self.light.evidence,
        })
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let opening = Opening::new(&args.source, &args.trace).operator(&args.operator);
    // Wrong options should show before anything is written or traced.
    let seed = args.trace.overrides().vector_seed();
    crate::analysis::Capture::new(args.question.options(seed, None))?;
    let mut lab = opening.open_shown(&args.live, console)?;
    let request = args.request(args.question.options(seed, lab.photos_of_run()))?;
    request.check(lab.resolution())?;
    in_run(&mut lab, &args.run, "segment", |lab| answer(args, &request, lab, console))
}

fn answer(args: &Args, request: &SegmentRequest, lab: &mut Lab, console: &Console) -> Result<Outcome> {
    let segmented = lab.segment(request)?;
    console.go_on()?;
    let truth = lab.known_truth()?;
    let scores = truth.as_ref().map(|truth| truth.scores(&segmented.segmentation)).transpose()?;
    let scores = scores.unwrap_or_default();
    say(&segmented, &scores, console)?;
    let answer = Scored { segmented: &segmented, truth: truth.as_ref(), scores: &scores };
    let summary = summary(&segmented, &scores);
    let (_, outcome) = finish(lab, console, &answer, Ending { run: &args.run, is_good: true, summary })?;
    let is_good = is_good(args.min_rand_index, &scores, truth.as_ref(), console)?;
    Ok(if is_good { outcome } else { Outcome::NotGoodEnough })
}

fn summary(segmented: &Segmented, scores: &[(usize, f64)]) -> serde_json::Value {
    let segmentation = &segmented.segmentation;
    let scores = scores.iter().map(|(groups, score)| (groups.to_string(), json!(score)));
    json!({
        "photos": segmentation.photos,
        "photos_direct": segmented.direct.as_ref().map(|direct| direct.photos),
        "status": segmentation.status,
        "regions": segmentation.regions,
        "eigenvalues": segmentation.eigenvalues,
        "residuals": segmentation.residuals,
        "within": segmentation.embedding.within,
        "masked": segmentation.mask.iter().filter(|&&masked| masked).count(),
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

fn say(segmented: &Segmented, scores: &[(usize, f64)], console: &Console) -> Result<()> {
    let segmentation = &segmented.segmentation;
    if let Some(direct) = &segmented.direct {
        let share = direct.direct.iter().sum::<f64>()
            / direct.direct.iter().zip(&direct.global).map(|(d, g)| d + g).sum::<f64>();
        console.say(format_args!(
            "direct    {:.1} % of the light, from {} photos",
            100.0 * share,
            direct.photos
        ))?;
    }
    console.say(format_args!("photos    {}", segmentation.status))?;
    let masked = segmentation.mask.iter().filter(|&&masked| masked).count();
    if masked > 0 {
        let share = 100.0 * masked as f64 / segmentation.mask.len() as f64;
        console.say(format_args!("masked    {masked} pixels without global light ({share:.1} %)"))?;
    }
    console.say("          eigenvalue   residual")?;
    for (index, (value, residual)) in segmentation.eigenvalues.iter().zip(&segmentation.residuals).enumerate()
    {
        let note = if segmentation.embedding.is_local(index) { "   localized eigenvector" } else { "" };
        console.say(format_args!("  {:>6}  {value:>10.6}   {residual:.1e}{note}", index + 1))?;
    }
    console.say(format_args!("regions   {}", segmentation.regions.sentence()))?;
    for &(groups, score) in scores {
        console.say(format_args!(
            "groups    {groups:>3}: adjusted Rand index {score:.4} against the true labels"
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
fn is_good(
    least: Option<f64>,
    scores: &[(usize, f64)],
    truth: Option<&Truth>,
    console: &Console,
) -> Result<bool> {
    let Some(least) = least else { return Ok(true) };
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
    let is_good = score >= least;
    if !is_good {
        console.note(format_args!("the adjusted Rand index {score:.4} is below {least}"));
    }
    Ok(is_good)
}
