//! `krylux matrix`: the light transport matrix itself, as a file.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::{Opening, channel_suffixes, in_journal, merge};
use super::options::{ChannelsArg, KeepArgs, SourceArgs, count, free_file};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::error::Result;
use crate::io::{manifest, sparse};
use crate::lab::{Lab, MatrixRequest, SourceKind};
use crate::sparse::Csr;
use crate::transport::Part;

/// Write the light transport matrix as a sparse matrix: a scene's is traced once, a rig's photographed pixel by pixel
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux matrix scene.glb --size 32 --spp 1024 -o matrix.npz")]
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
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    photos: Option<usize>,
    /// One matrix weighted by luminance, or three, in files named FILE.r, FILE.g and FILE.b
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    /// Where it goes: .npz (scipy.sparse.load_npz) or .mtx (Matrix Market)
    /// [default: matrix.npz, or the first free one of matrix-2.npz, matrix-3.npz, …]
    #[arg(short = 'o', long = "output", value_name = "FILE")]
    file: Option<PathBuf>,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    live: LiveArgs,
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
    let file = args.file.clone().unwrap_or_else(|| free_file("matrix", "npz"));
    sparse::check_writable(&file)?;
    let opening = Opening {
        split_bounces: args.split_bounces,
        ..Opening::new(&args.source, &args.trace).channels(args.channels)
    };
    let mut lab = opening.open_shown(&args.live, console)?;
    let request =
        MatrixRequest { part: args.part.into(), split_bounces: args.split_bounces, photos: args.photos };
    in_journal(&mut lab, &args.keep, "matrix", |lab| {
        let matrices = lab.matrices(&request)?;
        let is_complete = write(&file, &matrices, lab, console)?;
        let photos = lab.resolution().pixels() * lab.channels().count();
        lab.end_run(photos, "every column photographed")?;
        Ok(is_complete)
    })
}

/// Writes the matrices of each channel, and says where.
fn write(
    named: &Path,
    matrices: &[Vec<(&'static str, Csr)>],
    lab: &mut Lab,
    console: &Console,
) -> Result<Outcome> {
    let (mut files, mut nonzeros) = (Vec::new(), Vec::new());
    for (channel, suffix) in matrices.iter().zip(channel_suffixes(lab.channels())) {
        for (bounces, matrix) in channel {
            let file = with_suffix(named, &format!("{bounces}{suffix}"));
            sparse::write(&file, matrix)?;
            nonzeros.push(matrix.weights().len());
            console.say(format_args!("wrote     {}", file.display()))?;
            files.push(file);
        }
    }
    let (resolution, projector) = (lab.resolution(), lab.projector_resolution());
    let mut summary = json!({
        "verb": "matrix",
        "files": files,
        "resolution": resolution,
        "projector_resolution": projector,
        "rows": resolution.pixels(),
        "columns": projector.pixels(),
        "nonzeros": nonzeros,
    });
    if lab.kind() == SourceKind::Scene {
        let noise = lab.noise()?;
        let more = json!({
            "paths": lab.trace_summary()?.map(|summary| summary.paths),
            "noise": noise.as_ref().map(manifest::Noise::from),
        });
        merge(&mut summary, more);
    } else {
        merge(&mut summary, json!({ "rig": lab.costs()? }));
    }
    console.summary(&summary)?;
    Ok(Outcome::Done)
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
