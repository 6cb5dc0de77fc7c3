//! `krylux matrix`: the light transport matrix itself, as a file.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::ValueEnum;
use serde_json::json;

use super::console::Console;
use super::live::{Live, LiveArgs};
use super::measured::{self, Measured};
use super::options::{ChannelsArg, KeepArgs, OutputArgs, SourceArgs};
use super::run_folder::RunFolder;
use super::simulation::Simulation;
use super::source::Source;
use super::trace::TraceArgs;
use super::{Outcome, brute_force};
use crate::error::Error;
use crate::image::Resolution;
use crate::io::{manifest, sparse};
use crate::sparse::Csr;
use crate::transport::{Bounces, Channels, Part, TransportMatrix};

/// Write the light transport matrix as a sparse matrix: a scene's is traced once, a rig's photographed pixel by pixel
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// Which light: all of it, one bounce (a diagonal), or two bounces and more
    #[arg(long, value_enum, default_value = "full")]
    part: PartArg,
    /// Write three matrices, which add up to the whole: FILE_direct, FILE_second (bounce) and FILE_rest
    #[arg(long, conflicts_with = "part")]
    split_bounces: bool,
    /// Photos that a rig may take: one for each of its projector's pixels, and a few more [default: 4096]
    #[arg(long, value_name = "N")]
    photos: Option<usize>,
    /// One matrix weighted by luminance, or three, in files named FILE.r, FILE.g and FILE.b
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    /// Where it goes: .npz (scipy.sparse.load_npz) or .mtx (Matrix Market)
    #[arg(short = 'o', long = "output", value_name = "FILE", default_value = "matrix.npz")]
    file: PathBuf,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum PartArg {
    Full,
    Direct,
    Global,
}

impl From<PartArg> for Part {
    fn from(argument: PartArg) -> Self {
        match argument {
            PartArg::Full => Self::Full,
            PartArg::Direct => Self::Direct,
            PartArg::Global => Self::Global,
        }
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    sparse::check_writable(&args.file)?;
    let mut source = Source::open(&args.source, &args.trace, console)?;
    let (resolution, channels) = (source.resolution(), Channels::from(args.channels));
    let live = Live::new(&args.live, &source, channels, console);
    match &mut source {
        Source::Scene(simulation) => {
            args.keep.refuse()?;
            of_scene(args, simulation, console)
        }
        Source::Rig(rig) => {
            check_rig(args, resolution)?;
            let Some(wanted) = args.keep.run() else {
                return of_devices(args, &mut rig.measured(Some(channels), None, console)?, &live, console);
            };
            let mut folder = RunFolder::create(&wanted, "matrix", console)?;
            rig.describe(&mut folder.manifest);
            let measured = rig
                .journal(&folder, channels, console)
                .and_then(|journal| rig.measured(Some(channels), Some(journal), console));
            let outcome = measured.and_then(|mut measured| {
                let outcome = of_devices(args, &mut measured, &live, console);
                folder.manifest.rig = Some(measured.record(outcome.is_ok())?);
                outcome
            });
            folder.manifest.photos = (resolution.pixels() * channels.count()) as u64;
            folder.close(outcome.map(|outcome| (outcome, "every column photographed".to_owned())))
        }
        Source::Run(run) => {
            args.keep.refuse()?;
            check_rig(args, resolution)?;
            of_devices(args, &mut run.measured(Some(channels), console)?, &live, console)
        }
    }
}

fn of_scene(args: &Args, simulation: &mut Simulation, console: &Console) -> Result<Outcome> {
    let channels = args.channels.into();
    if args.photos.is_some() {
        return Err(Error::Option {
            option: "--photos".into(),
            fault: "a scene's matrix is traced, not photographed".into(),
            help: "leave it out; --spp says how many light paths are traced".into(),
        }
        .into());
    }
    let traced = simulation.assemble_layers(channels, args.split_bounces, console)?;
    let (mut files, mut nonzeros) = (Vec::new(), Vec::new());
    for (channel, name) in names(channels).iter().enumerate() {
        for (bounces, csr) in matrices(args, &traced.matrix, channel)? {
            let file = with_suffix(&args.file, &format!("{bounces}{name}"));
            sparse::write(&file, &csr)?;
            nonzeros.push(csr.weights().len());
            console.say(format_args!("wrote     {}", file.display()))?;
            files.push(file);
        }
    }
    console.summary(&json!({
        "verb": "matrix",
        "files": files,
        "resolution": traced.matrix.resolution(),
        "projector_resolution": traced.matrix.projector_resolution(),
        "rows": traced.matrix.resolution().pixels(),
        "columns": traced.matrix.projector_resolution().pixels(),
        "nonzeros": nonzeros,
        "paths": traced.summary.paths,
        "noise": traced.noise.as_ref().map(manifest::Noise::from),
    }))?;
    Ok(Outcome::Done)
}

/// What a rig cannot tell, or not in so many photos.
fn check_rig(args: &Args, resolution: Resolution) -> Result<()> {
    if args.split_bounces {
        return Err(Error::Option {
            option: "--split-bounces".into(),
            fault: "a photo does not tell how often its light has bounced".into(),
            help: "give --part direct or --part global, which are told apart by shifted patterns".into(),
        }
        .into());
    }
    Ok(brute_force::check(resolution, args.channels.into(), args.photos)?)
}

/// Column by column, by the devices of a rig or by the photos that a run took of it.
fn of_devices(args: &Args, measured: &mut Measured, live: &Live, console: &Console) -> Result<Outcome> {
    let (channels, resolution) = (Channels::from(args.channels), live.resolution());
    live.expect(resolution.pixels());
    let (mut files, mut nonzeros) = (Vec::new(), Vec::new());
    for (channel, name) in names(channels).iter().enumerate() {
        let mut operator = measured.measurement.operator(args.part.into(), channel);
        let csr = brute_force::columns(&mut live.watch(channel, &mut operator))?;
        let file = with_suffix(&args.file, name);
        sparse::write(&file, &csr)?;
        nonzeros.push(csr.weights().len());
        console.say(format_args!("wrote     {}", file.display()))?;
        files.push(file);
    }
    live.pause();
    let record = measured.record(true)?;
    measured::say(&record, console)?;
    console.summary(&json!({
        "verb": "matrix",
        "files": files,
        "resolution": resolution,
        "projector_resolution": resolution,
        "rows": resolution.pixels(),
        "columns": resolution.pixels(),
        "nonzeros": nonzeros,
        "rig": record,
    }))?;
    Ok(Outcome::Done)
}

/// What the files of a matrix's channels are called beside its name.
fn names(channels: Channels) -> &'static [&'static str] {
    match channels {
        Channels::Luma => &[""],
        Channels::Rgb => &[".r", ".g", ".b"],
    }
}

/// What is to be written of a channel, each with what its file's name gets.
fn matrices(args: &Args, matrix: &TransportMatrix, channel: usize) -> Result<Vec<(&'static str, Csr)>> {
    if !args.split_bounces {
        return Ok(vec![("", matrix.to_csr(args.part.into(), channel)?)]);
    }
    let mut matrices = vec![("_direct", matrix.to_csr(Part::Direct, channel)?)];
    for layer in matrix.layers() {
        match layer.bounces() {
            // It is in the direct part already.
            Bounces::One => {}
            Bounces::Two => matrices.push(("_second", layer.to_csr(channel)?)),
            Bounces::Rest | Bounces::Global => matrices.push(("_rest", layer.to_csr(channel)?)),
        }
    }
    Ok(matrices)
}

/// `a/matrix.npz` as `a/matrix_direct.r.npz`.
fn with_suffix(file: &Path, suffix: &str) -> PathBuf {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let extension = file.extension().unwrap_or_default().to_string_lossy();
    file.with_file_name(format!("{stem}{suffix}.{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suffixes_stand_before_the_extension() {
        let name = |suffix| with_suffix(Path::new("a/b.c.npz"), suffix).display().to_string();
        assert_eq!([name(""), name("_rest.g")], ["a/b.c.npz", "a/b.c_rest.g.npz"]);
    }
}
