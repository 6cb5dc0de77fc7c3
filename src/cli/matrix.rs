//! `krylux matrix`: the light transport matrix itself, as a file.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::ValueEnum;
use serde_json::json;

use super::console::Console;
use super::options::{ChannelsArg, OutputArgs, SourceArgs, TraceArgs};
use super::{Outcome, simulation};
use crate::report::sparse;
use crate::transport::{Channels, Part};

/// Write the light transport matrix, traced once, as a sparse matrix
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// Which light: all of it, one bounce (a diagonal), or two bounces and more
    #[arg(long, value_enum, default_value = "full")]
    part: PartArg,
    /// One matrix weighted by luminance, or three, in files named FILE.r, FILE.g and FILE.b
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    /// Where it goes: .npz (scipy.sparse.load_npz) or .mtx (Matrix Market)
    #[arg(short = 'o', long = "output", value_name = "FILE", default_value = "matrix.npz")]
    file: PathBuf,
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
    let scene = simulation::load(&args.source, console)?;
    let mut tracer = simulation::open(&scene, &args.trace, console)?;
    let channels = args.channels.into();
    let traced = simulation::assemble(&mut tracer, &args.trace, channels, console)?;
    let files: Vec<PathBuf> = match channels {
        Channels::Luma => vec![args.file.clone()],
        Channels::Rgb => ["r", "g", "b"].map(|name| with_channel(&args.file, name)).to_vec(),
    };
    let mut nonzeros = Vec::new();
    for (channel, file) in files.iter().enumerate() {
        let csr = traced.matrix.to_csr(args.part.into(), channel)?;
        sparse::write(file, &csr)?;
        nonzeros.push(csr.weights().len());
        console.say(format_args!("wrote     {}", file.display()))?;
    }
    console.summary(&json!({
        "verb": "matrix",
        "files": files,
        "resolution": traced.matrix.resolution(),
        "rows": traced.matrix.resolution().pixels(),
        "nonzeros": nonzeros,
        "paths": traced.summary.paths,
    }))?;
    Ok(Outcome::Done)
}

/// `a/matrix.npz` as `a/matrix.r.npz`.
fn with_channel(file: &Path, channel: &str) -> PathBuf {
    let extension = file.extension().unwrap_or_default().to_string_lossy();
    file.with_extension(format!("{channel}.{extension}"))
}
