//! `krylux compensate`: what to project, so that the scene looks like a target.

use std::path::PathBuf;

use anyhow::Result;
use clap::ValueEnum;
use serde_json::json;

use super::console::Console;
use super::operator::OperatorArgs;
use super::options::{ChannelsArg, OutputArgs, RunArgs, SourceArgs, method};
use super::run_folder::RunFolder;
use super::source::Source;
use super::trace::TraceArgs;
use super::{Outcome, pattern};
use crate::analysis::compensate::compensate;
use crate::analysis::{CompensateOptions, Compensation, Precondition, Wish};
use crate::error::Error;
use crate::image::{Image, Resolution};
use crate::krylov::Method;
use crate::report::compensation::CompensationRun;
use crate::transport::{Channels, Part};

/// Find what to project so that the scene looks like a target image
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    question: Question,
    /// The radiance that 1 in the target stands for, in W/(m² sr), or in DN/s on a rig [default: half the median of the white photo]
    #[arg(long, value_name = "L")]
    peak: Option<f64>,
    #[command(flatten)]
    trace: TraceArgs,
    /// One gray system, or red, green and blue as three
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

/// What is asked, of whatever source.
#[derive(clap::Args)]
pub(super) struct Question {
    /// What is to be seen: a .npy, .exr or .png file of values in [0, 1], as large as --size
    #[arg(long, value_name = "FILE")]
    target: PathBuf,
    /// How: inside the projector's range: krylov-box, fista, jacobi; not negative: mrnsd, multiplicative; clipped
    /// afterwards: minres, gmres, fgmres, cg, cgs, bicgstab, lsqr, lsmr
    #[arg(long, value_name = "NAME", default_value = "krylov-box", value_parser = method)]
    method: Method,
    /// Photos that the method may take, beside the white one
    #[arg(long, value_name = "N", default_value_t = 20)]
    photos: usize,
    /// Done when what is seen differs from the target by at most this share of it
    #[arg(long, value_name = "X", default_value_t = 1e-3)]
    rtol: f64,
    /// The least that is projected: the box is [α, 1]
    #[arg(long, value_name = "α", default_value_t = 0.0)]
    floor: f64,
    /// What speeds up methods without a box [default: diagonal]
    #[arg(long, value_enum)]
    precondition: Option<PreconditionArg>,
}

#[derive(Clone, Copy, ValueEnum)]
enum PreconditionArg {
    None,
    /// Division by the white photo
    Diagonal,
    /// That, and a gain for each scale, measured by one photo more
    Multiscale,
}

impl Question {
    /// As the library has it.
    pub(super) fn options(&self) -> CompensateOptions {
        CompensateOptions {
            method: self.method,
            photos: self.photos,
            rtol: self.rtol,
            floor: self.floor,
            precondition: self.precondition.map(|argument| match argument {
                PreconditionArg::None => Precondition::None,
                PreconditionArg::Diagonal => Precondition::Diagonal,
                PreconditionArg::Multiscale => Precondition::Multiscale,
            }),
            ..CompensateOptions::default()
        }
    }

    /// The target, of the right size and with values that make sense.
    pub(super) fn target(&self, resolution: Resolution, channels: Channels) -> Result<Image> {
        let image = pattern::read_sized(&self.target, resolution)?;
        let unusable =
            |fault: String, help: &str| Error::Data { path: self.target.clone(), fault, help: help.into() };
        if image.channels() > channels.count() {
            let fault = format!("it has {} channels, but --channels luma has 1", image.channels());
            return Err(unusable(fault, "give a gray image, or --channels rgb").into());
        }
        let range = |(low, high): (f32, f32), &value: &f32| (low.min(value), high.max(value));
        let (low, high) = image.samples().iter().fold((f32::INFINITY, f32::NEG_INFINITY), range);
        if low < 0.0 || high > 1.0 {
            let fault = format!("its values are from {low} to {high}, but a target's are from 0 to 1");
            return Err(unusable(fault, "scale it, and say by --peak what 1 stands for").into());
        }
        if high == 0.0 {
            return Err(unusable("it is black".into(), "give an image with light in it").into());
        }
        Ok(image)
    }
}

impl Args {
    /// A comparison with another method is for free where photos are products.
    fn options(&self, baseline: bool) -> CompensateOptions {
        CompensateOptions { peak: self.peak, baseline, ..self.question.options() }
    }

    fn channels(&self) -> Channels {
        self.channels.into()
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    // What is wrong with the options or the files should show before anything is written or traced.
    args.options(true).check()?;
    let mut source = Source::open(&args.source, &args.trace, console)?;
    let target = args.question.target(source.resolution(), args.channels())?;
    let mut folder = RunFolder::create(&args.run, &format!("{}-compensate", source.name()))?;
    source.describe(&mut folder.manifest, args.channels());
    let outcome = answer(args, console, &target, &mut source, &mut folder);
    folder.close(outcome)
}

fn answer(
    args: &Args,
    console: &Console,
    target: &Image,
    source: &mut Source,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let name = source.name();
    let mut light =
        folder.timed(source.preparation(), |_| source.light(&args.operator, args.channels(), console))?;
    folder.manifest.noise = light.noise().map(Into::into);
    let wish = Wish::new(target, &light.ambient(console)?)?;
    let options = args.options(light.is_simulated());
    let bar = console.bar("photos");
    let found = folder.timed("photos", |_| {
        light.with_channels(Part::Full, console, |channels| {
            compensate(channels, &wish, &options, &mut |step| {
                bar.at(step.products as u64, step.budget as u64)
            })
        })
    });
    drop(bar);
    let found = folder.record_rig(&mut light, found, console)?;
    if console.check().is_break() {
        return Err(Error::Interrupted.into());
    }
    folder.manifest.photos = (found.photos + found.preparation) as u64;
    let method = args.question.method.facts().name;
    say(&found, method, console)?;

    let title = format!("{name} · light transport compensation");
    let run = CompensationRun { title, found: &found, method, floor: args.question.floor };
    let seconds = folder.seconds();
    folder.manifest.outputs =
        folder.timed("files", |folder| run.write(&folder.path, &folder.manifest, seconds))?;
    let report = folder.path.join("report.html");
    console.say(format_args!("project   {}", folder.path.join("compensation.npy").display()))?;
    console.say(format_args!("report    {}", report.display()))?;
    console.summary(&json!({
        "verb": "compensate",
        "folder": folder.path,
        "report": report,
        "method": method,
        "photos": found.photos,
        "photos_before": found.preparation,
        "status": found.status.to_string(),
        "peak": found.peak,
        "relative_residual": found.residual,
        "relative_residual_unclipped": found.unclipped_residual,
        "relative_residual_uncompensated": found.uncompensated_residual,
        "relative_residual_jacobi": found.baseline.last().map(|row| row.residual),
        "clipped": found.unclipped.is_some(),
        "rig": folder.manifest.rig,
        "seconds": folder.seconds(),
    }))?;
    let outcome = if found.good { Outcome::Done } else { Outcome::NotGoodEnough };
    Ok((outcome, run.sentence()))
}

fn say(found: &Compensation, method: &str, console: &Console) -> Result<()> {
    console.say(format_args!(
        "photos    {} by {method}, {} before: {}",
        found.photos, found.preparation, found.status
    ))?;
    console.say(format_args!(
        "residual  {:.4} of the wish; {:.4} uncompensated",
        found.residual, found.uncompensated_residual
    ))?;
    if let Some(row) = found.baseline.last() {
        console.say(format_args!(
            "baseline  {:.4} by projected Jacobi with as many photos (not counted)",
            row.residual
        ))?;
    }
    if found.unclipped.is_some() {
        console.say(format_args!(
            "clipped   the answer leaves what can be projected; before clipping its residual was {:.4}",
            found.unclipped_residual
        ))?;
    }
    if found.residual >= found.uncompensated_residual {
        console.note("this is no better than projecting the target itself; use --method krylov-box");
    }
    Ok(())
}
