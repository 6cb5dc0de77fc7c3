//! `krylux probe`: a photo of which only some light paths are let through.

use clap::ValueEnum;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::{Ending, Opening, finish, in_run};
use super::options::{ChannelsArg, OperatorArgs, RunArgs, SourceArgs, count, number};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::analysis::Probing;
use crate::analysis::probe::default_sigma;
use crate::error::Result;
use crate::lab::{Lab, text::percent};
use crate::paint::page::Kept;

/// Probe light transport: a photo of which only direct, indirect, near or far light paths are let through
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux probe scene.glb --paths indirect -o out/probed")]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// One gray system, or red, green and blue as three
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    /// Which paths are let through, by how far from its own pixel light comes back
    #[arg(long, value_enum, value_name = "NAME", default_value = "indirect")]
    paths: PathsArg,
    /// Near light is weighted by exp(−d²/2σ²) of the distance d in pixels [default: a sixteenth of the width]
    #[arg(long, value_name = "σ", value_parser = number::<f64>)]
    sigma: Option<f64>,
    /// Random patterns; near-indirect takes two photos for each, and indirect and far a white one more [default: 100, or the
    /// budget of the run that is SOURCE]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    photos: Option<usize>,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum PathsArg {
    /// Back to the pixel that they started from
    Direct,
    /// All others
    Indirect,
    /// Back near to where they started, direct light among them
    Near,
    /// All others
    Far,
    /// Near, without direct light
    NearIndirect,
}

impl Args {
    fn probing(&self, lab: &Lab) -> Probing {
        let sigma = self.sigma.unwrap_or_else(|| default_sigma(lab.resolution()));
        match self.paths {
            PathsArg::Direct => Probing::Direct,
            PathsArg::Indirect => Probing::Indirect,
            PathsArg::Near => Probing::Near { sigma },
            PathsArg::Far => Probing::Far { sigma },
            PathsArg::NearIndirect => Probing::NearIndirect { sigma },
        }
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let opening = Opening::new(&args.source, &args.trace).operator(&args.operator).channels(args.channels);
    let mut lab = opening.open_shown(&args.live, console)?;
    let probing = args.probing(&lab);
    probing.check()?;
    in_run(&mut lab, &args.run, "probe", |lab| answer(args, probing, lab, console))
}

fn answer(args: &Args, probing: Probing, lab: &mut Lab, console: &Console) -> Result<Outcome> {
    let photos = args.photos.or(lab.photos_of_run()).unwrap_or(100);
    let found = lab.probe(probing, photos)?;
    let (noise, error) = (found.noise(), found.error());
    console.say(format_args!("photos    {}, for {}", found.photos, probing.in_words()))?;
    console.say(format_args!("noise     {} % (standard error)", percent(noise)))?;
    if let Some(error) = error {
        console.say(format_args!("error     {} % of what the matrix itself says", percent(error)))?;
    }
    let summary = json!({
        "paths": probing.in_words(),
        "photos": found.photos,
        "relative_standard_error": noise,
        "relative_error": error,
    });
    Ok(finish(
        lab,
        console,
        &found,
        Ending { run: &args.run, demands: Vec::new(), summary, kept: Kept::default() },
    )?
    .1)
}
