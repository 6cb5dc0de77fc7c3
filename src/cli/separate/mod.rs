//! `krylux separate`: direct and global light.

mod comparison;
mod photos;
mod planes;

use anyhow::Result;
use clap::ValueEnum;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::light::Light;
use super::live::{Live, LiveArgs};
use super::noise::percent;
use super::operator::OperatorArgs;
use super::options::{ChannelsArg, OutputArgs, RunArgs, SourceArgs};
use super::run_folder::RunFolder;
use super::source::Source;
use super::trace::TraceArgs;
use crate::analysis::separate::{SeparateBy, Separation};
use crate::error::Error;
use crate::report::separation::{Planes, SeparationRun, relative_error};
use crate::transport::Channels;
use comparison::compare;
pub(super) use photos::weigh;
use photos::{bounces, exact, measured, reach};

/// Separate direct and global light, and the global light by bounces and by how far it went
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// One gray system, or red, green and blue as three
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    /// How [default: exact on scenes, checkerboards on rigs]
    #[arg(long, value_enum, value_name = "NAME")]
    by: Option<ByArg>,
    /// Pixels of a checkerboard's squares
    #[arg(long, value_name = "N", default_value_t = 2)]
    square: usize,
    /// Places that checkerboards are shifted to in each direction: as many photos squared
    #[arg(long, value_name = "N", default_value_t = 4)]
    shifts: usize,
    /// Pixels of a sinusoid's wave
    #[arg(long, value_name = "X", default_value_t = 4.0)]
    period: f64,
    /// Photos of a sinusoid in each of two directions
    #[arg(long, value_name = "N", default_value_t = 3)]
    phases: usize,
    /// Photos of random patterns or of the capture, beside the white one [default: 40, or as many as the run that is SOURCE might
    /// take]
    #[arg(long, value_name = "N")]
    photos: Option<usize>,
    /// The second bounce, and three and more, as images of their own (scenes only)
    #[arg(long)]
    bounces: bool,
    /// Near indirect light is weighed by exp(−d²/2σ²) of the distance d in pixels [default: a sixteenth of the width]
    #[arg(long, value_name = "σ")]
    sigma: Option<f64>,
    /// Photos of random patterns that tell near from far indirect light; 0 leaves it out [default: 100 on scenes, 0 on
    /// rigs]
    #[arg(long, value_name = "N")]
    probes: Option<usize>,
    /// All methods at several photo counts against the exact first bounce (scenes only)
    #[arg(long)]
    compare: bool,
    /// Exit status 1 if the direct light differs from the exact first bounce by more than this share of it (scenes only)
    #[arg(long, value_name = "X")]
    max_error: Option<f64>,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ByArg {
    /// What the simulator knows of each bounce
    Exact,
    /// Nayar's shifted checkerboards
    Checkerboards,
    /// Shifted sinusoids
    Sinusoids,
    /// The diagonal of the matrix from patterns of random signs
    Random,
    /// The same from the photos of a Krylov capture
    Capture,
}

impl Args {
    /// The method, if it takes photos.
    fn by(&self, is_scene: bool, held: Option<usize>) -> Option<SeparateBy> {
        let photos = self.photos.or(held).unwrap_or(40);
        Some(match self.by.unwrap_or(if is_scene { ByArg::Exact } else { ByArg::Checkerboards }) {
            ByArg::Exact => return None,
            ByArg::Checkerboards => SeparateBy::Checkerboards { square: self.square, shifts: self.shifts },
            ByArg::Sinusoids => SeparateBy::Sinusoids { period: self.period, phases: self.phases },
            ByArg::Random => SeparateBy::Random { photos },
            ByArg::Capture => SeparateBy::Capture { photos },
        })
    }

    /// What only a simulator knows must not be asked of a rig.
    fn check(&self, is_scene: bool) -> Result<()> {
        let asked = [
            (self.by == Some(ByArg::Exact), "--by exact"),
            (self.bounces, "--bounces"),
            (self.compare, "--compare"),
            (self.max_error.is_some(), "--max-error"),
        ];
        match asked.into_iter().find(|(asked, _)| *asked && !is_scene) {
            Some((_, option)) => Err(Error::Option {
                option: option.into(),
                fault: "a rig does not know the exact bounces of its light".into(),
                help: "leave it out, or give a scene".into(),
            }
            .into()),
            None => Ok(()),
        }
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let mut source = Source::open(&args.source, &args.trace, console)?;
    let is_scene = matches!(source, Source::Scene(_));
    args.check(is_scene)?;
    let mut folder = RunFolder::create(&args.run, &format!("{}-separate", source.name()), console)?;
    source.describe(&mut folder.manifest, args.channels.into());
    let outcome = answer(args, console, is_scene, &mut source, &mut folder);
    folder.close(outcome)
}

fn answer(
    args: &Args,
    console: &Console,
    is_scene: bool,
    source: &mut Source,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let (name, resolution) = (source.name(), source.resolution());
    let channels: Channels = args.channels.into();
    let (preparation, unit) = (source.preparation(), source.unit());
    let by = args.by(is_scene, source.held());
    folder.manifest.photos_allowed = Some(args.photos.or(source.held()).unwrap_or(40));
    let live = Live::new(&args.live, source, channels, console);
    let mut light = folder.timed(preparation, |folder| match args.bounces {
        // Bounces are layers of a matrix. A simulator is also asked for the truth, hundreds of times: that is no journal's business.
        true => {
            let simulation = source.simulation()?;
            let traced = simulation.assemble_layers(channels, true, console)?;
            Light::replayed(simulation, traced, &args.operator, console)
        }
        false => source.light(&args.operator, channels, (!is_scene).then_some(&*folder), console),
    })?;
    folder.describe_light(&light);
    let seed = args.trace.seed();

    let exact = match is_scene {
        true => Some(folder.timed("exact bounces", |_| exact(&mut light, console))?),
        false => None,
    };
    let measured = match by {
        Some(by) => {
            live.expect(by.photos());
            let found =
                folder.timed("photos", |_| measured(&mut light, resolution, by, seed, Some(&live), console));
            Some((by, folder.record_rig(&mut light, found, console)?))
        }
        None => None,
    };
    let bounces = if args.bounces { Some(bounces(&light)?) } else { None };
    let (method, photos, direct, global, standard_error, truth) = match (&measured, exact.clone()) {
        (Some((by, found)), exact) => {
            let errors: Option<Planes> = found.iter().map(|found| found.standard_error.clone()).collect();
            let of = |part: fn(&Separation) -> &Vec<f64>| found.iter().map(|f| part(f).clone()).collect();
            let truth = exact.map(|[direct, _]| direct);
            (by.in_words(), by.photos(), of(|f| &f.direct), of(|f| &f.global), errors, truth)
        }
        (None, Some([direct, global])) => ("the simulator".to_owned(), 0, direct, global, None, None),
        // `by` is none on scenes only, and there the exact bounces are known.
        (None, None) => return Err(Error::Interrupted.into()),
    };
    let reach = folder.timed("probing", |_| reach(args, is_scene, &mut light, &global, &live, console))?;
    live.pause();
    let comparison = match exact.filter(|_| args.compare) {
        Some(exact) => {
            folder.timed("comparison", |_| compare(args, &mut light, resolution, &exact, console))?
        }
        None => Vec::new(),
    };
    if console.check().is_break() {
        return Err(Error::Interrupted.into());
    }
    let taken = photos + reach.as_ref().map_or(0, |reach| reach.photos);
    folder.manifest.photos = taken as u64;

    let error = truth.as_ref().map(|truth| relative_error(&direct, truth));
    let good = match (args.max_error, error) {
        (Some(most), Some(error)) => error <= most,
        _ => true,
    };
    let run = SeparationRun {
        title: format!("{name} · direct and global light"),
        method,
        photos,
        resolution,
        unit,
        direct: &direct,
        global: &global,
        standard_error: standard_error.as_ref(),
        truth: truth.as_ref(),
        bounces: bounces.as_ref(),
        reach: reach.as_ref(),
        comparison: &comparison,
        good,
        strip: &live.strip(),
    };
    let seconds = folder.seconds();
    folder.manifest.outputs =
        folder.timed("files", |folder| run.write(&folder.path, &folder.manifest, seconds))?;
    let report = folder.path.join("report.html");
    say(&run, console)?;
    console.say(format_args!("report    {}", report.display()))?;
    console.summary(&json!({
        "verb": "separate",
        "folder": folder.path,
        "report": report,
        "method": by.map_or("exact", SeparateBy::name),
        "photos": photos,
        "photos_near_far": reach.as_ref().map_or(0, |reach| reach.photos),
        "relative_error": error,
        "near_indirect_noise": reach.as_ref().map(|reach| reach.noise),
        "near_indirect_error": reach.as_ref().and_then(|reach| reach.error),
        "comparison": comparison,
        "seconds": folder.seconds(),
    }))?;
    if let (false, Some(error), Some(most)) = (good, error, args.max_error) {
        console.note(format_args!("the error of the direct light, {error:.5}, is above {most}"));
    }
    Ok((if good { Outcome::Done } else { Outcome::NotGoodEnough }, run.sentence()))
}

fn say(run: &SeparationRun<'_>, console: &Console) -> Result<()> {
    console.say(format_args!("photos    {}: {}", run.photos, run.method))?;
    if let Some(error) = run.error() {
        console.say(format_args!("direct    within {} % of the exact first bounce", percent(error)))?;
    }
    if let Some(reach) = run.reach {
        console.say(format_args!(
            "near      σ {} px, {} photos: noise {} %{}",
            reach.sigma,
            reach.photos,
            percent(reach.noise),
            reach.error.map(|error| format!(", error {} %", percent(error))).unwrap_or_default()
        ))?;
    }
    for row in run.comparison {
        console.say(format_args!(
            "compared  {:>6} % with {:>3} photos: {}",
            percent(row.error),
            row.photos,
            row.setting
        ))?;
    }
    Ok(())
}
