//! `krylux separate`: direct and global light.

use clap::ValueEnum;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::{Ending, Opening, finish, in_run};
use super::operator::OperatorArgs;
use super::options::{ChannelsArg, CheckArgs, RunArgs, SourceArgs, count, number};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::analysis::probe::default_sigma;
use crate::analysis::separate::{NearFarOptions, SeparateBy};
use crate::error::Result;
use crate::lab::{
    Lab, SeparateRequest, Separated, SourceKind,
    text::{decimal, percent},
};
use crate::paint::page::Kept;

/// Photos of codes where no number is asked for: as many as those of checkerboards.
const CODES: usize = 16;

/// Separate direct and global light, and the global light by bounces and by how far it went
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux separate scene.glb --by checkerboards --compare -o out/separated")]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// One gray system, or red, green and blue as three
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    /// The method [default: exact on scenes, checkerboards on rigs]
    #[arg(long, value_enum, value_name = "NAME")]
    by: Option<ByArg>,
    /// Pixels of a checkerboard's squares
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count::<usize>)]
    square: usize,
    /// Places that checkerboards are shifted to in each direction: as many photos squared
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = count::<usize>)]
    shifts: usize,
    /// Pixels of a sinusoid's wave
    #[arg(long, value_name = "X", default_value_t = 4.0, value_parser = number::<f64>)]
    period: f64,
    /// Photos of a sinusoid in each of two directions
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = count::<usize>)]
    phases: usize,
    /// Photos of random patterns or of the capture, beside the white one [default: 40, or the budget of the run that is
    /// SOURCE]; of codes 4, 8, 16 and so on [default: 16]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    photos: Option<usize>,
    /// The second bounce, and three and more, as images (scenes only)
    #[arg(long)]
    bounces: bool,
    /// Near indirect light is weighted by exp(−d²/2σ²) of the distance d in pixels [default: a sixteenth of the width]
    #[arg(long, value_name = "σ", value_parser = number::<f64>)]
    sigma: Option<f64>,
    /// Photos of random patterns that tell near from far indirect light; 0 leaves it out [default: 100 on scenes, 0 on
    /// rigs]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    probes: Option<usize>,
    /// All methods at several photo counts against the exact first bounce (scenes only)
    #[arg(long)]
    compare: bool,
    /// Exit status 1 if the direct light differs from the exact first bounce by more than this share of it (scenes only)
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    max_error: Option<f64>,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    check: CheckArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ByArg {
    /// What the simulator knows of each bounce
    Exact,
    /// Nayar's shifted checkerboards
    Checkerboards,
    /// Shifted sinusoids
    Sinusoids,
    /// Patterns in which pixels near to each other have different codes, so that light from near by does not count as direct. For devices in
    /// focus
    Codes,
    /// The diagonal of the matrix from patterns of random signs
    Random,
    /// The same from the photos of a Krylov capture
    Capture,
}

impl Args {
    fn photos(&self, lab: &Lab) -> usize {
        self.photos.or(lab.photos_of_run()).unwrap_or(40)
    }

    fn request(&self, lab: &Lab) -> SeparateRequest {
        let is_scene = lab.kind() == SourceKind::Scene;
        let photos = self.photos(lab);
        let default = if is_scene { ByArg::Exact } else { ByArg::Checkerboards };
        let by = match self.by.unwrap_or(default) {
            ByArg::Exact => None,
            ByArg::Checkerboards => {
                Some(SeparateBy::Checkerboards { square: self.square, shifts: self.shifts })
            }
            ByArg::Sinusoids => Some(SeparateBy::Sinusoids { period: self.period, phases: self.phases }),
            ByArg::Codes => Some(SeparateBy::Codes { photos: self.photos.unwrap_or(CODES) }),
            ByArg::Random => Some(SeparateBy::Random { photos }),
            ByArg::Capture => Some(SeparateBy::Capture { photos }),
        };
        let near_far = NearFarOptions {
            sigma: self.sigma.unwrap_or_else(|| default_sigma(lab.resolution())),
            photos: self.probes.unwrap_or(if is_scene { 100 } else { 0 }),
            seed: lab.seed(),
        };
        SeparateRequest {
            by,
            bounces: self.bounces,
            near_far: Some(near_far),
            compare: self.compare.then_some(self.period),
            max_error: self.max_error,
        }
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let opening = Opening {
        split_bounces: args.bounces,
        ..Opening::new(&args.source, &args.trace).operator(&args.operator).channels(args.channels)
    };
    let mut lab = opening.open_shown(&args.live, console)?;
    let request = args.request(&lab);
    request.check(lab.kind() == SourceKind::Scene)?;
    in_run(&mut lab, &args.run, "separate", |lab| answer(args, &request, lab, console))
}

fn answer(args: &Args, request: &SeparateRequest, lab: &mut Lab, console: &Console) -> Result<Outcome> {
    lab.allow_photos(args.photos(lab));
    let found = lab.separate(request)?;
    console.go_on()?;
    say(&found, console)?;
    if args.check.is_on() {
        lab.verify_separation(&found)?;
    }
    let near_far = found.near_far.as_ref();
    let summary = json!({
        "method": found.name,
        "photos": found.photos,
        "photos_near_far": near_far.map_or(0, |near_far| near_far.photos),
        "relative_error": found.error(),
        "near_indirect_noise": near_far.map(|near_far| near_far.noise),
        "near_indirect_error": near_far.and_then(|near_far| near_far.error),
        "comparison": found.comparison,
    });
    let ending = Ending { run: &args.run, demands: Vec::new(), summary, kept: Kept::default() };
    let (_, outcome) = finish(lab, console, &found, ending)?;
    if let (Outcome::NotGoodEnough, Some(error), Some(most)) = (outcome, found.error(), args.max_error) {
        console.note(format_args!("the error of the direct light, {}, is above {most}", decimal(error, 5)));
    }
    Ok(outcome)
}

fn say(found: &Separated, console: &Console) -> Result<()> {
    console.say(format_args!("photos    {}: {}", found.photos, found.method))?;
    if let Some(error) = found.error() {
        console.say(format_args!("direct    within {} % of the exact first bounce", percent(error)))?;
    }
    if let Some(near_far) = &found.near_far {
        console.say(format_args!(
            "near      σ {} px, {} photos: noise {} %{}",
            near_far.sigma,
            near_far.photos,
            percent(near_far.noise),
            near_far.error.map(|error| format!(", error {} %", percent(error))).unwrap_or_default()
        ))?;
    }
    for row in &found.comparison {
        console.say(format_args!(
            "compared  {:>6} % with {:>3} photos: {}",
            percent(row.error),
            row.photos,
            row.setting
        ))?;
    }
    Ok(())
}
