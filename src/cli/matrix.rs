//! `krylux matrix`: the light transport matrix itself, as a file.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use clap::Subcommand;
use serde_json::{Value, json};

use super::Outcome;
use super::console::Console;
use super::opening::{Opening, channel_suffixes, in_journal, merge};
use super::options::{ChannelsArg, KeepArgs, ViewArgs, count, free_file};
use super::tev::LiveArgs;
use super::trace::{CacheArgs, TraceArgs};
use crate::error::Result;
use crate::finding::Grade;
use crate::image::Resolution;
use crate::io::name::Name;
use crate::io::{manifest, sparse};
use crate::lab::{Lab, MatrixRequest, SharedObserver, SourceKind, TracedShard, join_shards, text};
use crate::sparse::Csr;
use crate::transport::{Channels, MOST_PARTS, Noise};
use crate::verbs::options::LightPart;

/// Write the light transport matrix as a sparse matrix: a scene's is traced once, a rig's photographed pixel by pixel
#[derive(clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true, after_help = EXAMPLES)]
pub(super) struct Args {
    #[command(subcommand)]
    action: Option<Action>,
    /// A scene (.glb or .gltf with a camera, or .obj with a file of its rig), a rig (.toml), or a run's folder, whose photos are asked anew
    // A subcommand needs no source.
    #[arg(value_name = "SOURCE", required = true)]
    source: Option<PathBuf>,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// Which light: all of it, one bounce (a diagonal), or two bounces and more
    #[arg(long, value_enum, default_value = "full")]
    part: LightPart,
    /// Write three matrices, which add up to the whole: FILE_direct, FILE_second (bounce) and FILE_rest
    #[arg(long, conflicts_with = "part")]
    split_bounces: bool,
    /// Trace only part K of N (from 1 to N) of a scene's light paths into the file -o, for `krylux matrix join`. Where the file has this part
    /// already, nothing is done; another shard in it is replaced
    #[arg(long, value_name = "K/N", requires = "file", conflicts_with_all = ["part", "photos", "folder"])]
    shard: Option<ShardArg>,
    /// Photos that a rig may take: one for each of its projector's pixels, and a few more [default: 4096]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    photos: Option<usize>,
    /// One matrix weighted by luminance, or three, in files named FILE.r, FILE.g and FILE.b
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    /// Where it goes: .npz (scipy.sparse.load_npz) or .mtx (Matrix Market); with --shard any name
    /// [default: matrix.npz, or the first free one of matrix-2.npz, matrix-3.npz, …]
    #[arg(short = 'o', long = "output", value_name = "FILE")]
    file: Option<PathBuf>,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    live: LiveArgs,
}

const EXAMPLES: &str = "Examples:
  krylux matrix scene.glb --size 32 --spp 1024 -o matrix.npz
  krylux matrix scene.glb --size 512 --spp 4096 --shard 3/16 -o shard-3.krylux # on any machine; then: krylux matrix join";

#[derive(Subcommand)]
enum Action {
    Join(JoinArgs),
}

/// `--shard`: part `K` of `N`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ShardArg(usize, usize);

impl FromStr for ShardArg {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let number = |digits: &str| digits.parse::<usize>().ok();
        let numbers = text.split_once('/').and_then(|(part, parts)| Some((number(part)?, number(parts)?)));
        match numbers {
            Some((part, parts)) if (1..=parts).contains(&part) && parts <= MOST_PARTS => {
                Ok(Self(part, parts))
            }
            _ => Err(format!(
                "`{text}` is not a part and the number of parts: write 1/16 to 16/16, with at most {MOST_PARTS} parts"
            )),
        }
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    match (&args.action, &args.source) {
        (Some(Action::Join(args)), _) => join(args, console),
        (None, Some(source)) => write_matrix(args, source, console),
        // The parser requires one of them.
        (None, None) => Ok(Outcome::Done),
    }
}

fn write_matrix(args: &Args, source: &Path, console: &Console) -> Result<Outcome> {
    let opening = Opening {
        source,
        view: &args.view,
        trace: &args.trace,
        operator: None,
        channels: args.channels.into(),
        split_bounces: args.split_bounces,
    };
    if let (Some(ShardArg(part, parts)), Some(file)) = (args.shard, &args.file) {
        return write_shard(&mut opening.open(console)?, (part, parts), file, console);
    }
    let file = args.file.clone().unwrap_or_else(|| free_file("matrix", "npz"));
    sparse::check_writable(&file)?;
    let mut lab = opening.open_shown(&args.live, console)?;
    let request =
        MatrixRequest { part: args.part.into(), split_bounces: args.split_bounces, photos: args.photos };
    in_journal(&mut lab, &args.keep, "matrix", |lab| {
        let matrices = lab.matrices(&request)?;
        let more = if lab.kind() == SourceKind::Scene {
            of_paths(lab.trace_summary()?.map(|summary| summary.paths), lab.noise()?.as_ref())
        } else {
            json!({ "rig": lab.costs()? })
        };
        let shape = (lab.channels(), lab.resolution(), lab.projector_resolution());
        write(&file, &matrices, shape, more, console)?;
        let photos = lab.resolution().pixels() * lab.channels().count();
        lab.end_run(photos, "every column photographed")?;
        for finding in lab.findings().iter().filter(|finding| finding.grade != Grade::Ok) {
            console.say(format_args!("finding   {finding}"))?;
        }
        Ok(Outcome::of(lab.findings()))
    })
}

/// Traces a shard, or finds it in its file.
fn write_shard(
    lab: &mut Lab,
    (part, parts): (usize, usize),
    file: &Path,
    console: &Console,
) -> Result<Outcome> {
    let TracedShard { record, bytes, is_new } = lab.trace_shard((part, parts), file)?;
    let what = format!("part {part} of {parts}, {}", text::bytes(bytes));
    let name = file.display();
    match is_new {
        true => console.say(format_args!("wrote     {name}: {what}"))?,
        false => console.say(format_args!("there     {name}: {what}; nothing is traced"))?,
    }
    console.summary(&json!({
        "verb": "matrix",
        "files": [file],
        "shard": { "part": part, "parts": parts, "is_new": is_new, "bytes": bytes },
        "resolution": lab.resolution(),
        "projector_resolution": lab.projector_resolution(),
        "paths": record.summary.paths,
        "seconds_of_tracing": record.summary.tracing.as_secs_f64(),
    }))?;
    Ok(Outcome::Done)
}

/// Join all parts that `krylux matrix SOURCE --shard K/N` traced to the matrix, with the bits of a single run
#[derive(clap::Args)]
#[command(after_help = EXAMPLE_OF_JOIN)]
struct JoinArgs {
    /// The files of all parts, in any order
    #[arg(value_name = "SHARDS", required = true)]
    shards: Vec<PathBuf>,
    /// Which light: all of it, one bounce (a diagonal), or two bounces and more [default: full, or three matrices if the shards were
    /// traced with --split-bounces]
    #[arg(long, value_enum)]
    part: Option<LightPart>,
    /// Where it goes: .npz (scipy.sparse.load_npz) or .mtx (Matrix Market)
    /// [default: matrix.npz, or the first free one of matrix-2.npz, matrix-3.npz, …]
    #[arg(short = 'o', long = "output", value_name = "FILE")]
    file: Option<PathBuf>,
    #[command(flatten)]
    cache: CacheArgs,
}

const EXAMPLE_OF_JOIN: &str = "Example:
  krylux matrix join shard-*.krylux -o matrix.npz # later verbs on this scene find it in the cache, too";

fn join(args: &JoinArgs, console: &Console) -> Result<Outcome> {
    let file = args.file.clone().unwrap_or_else(|| free_file("matrix", "npz"));
    sparse::check_writable(&file)?;
    let observer = SharedObserver(Arc::new(console.clone()));
    let joined = join_shards(&args.shards, &args.cache.choice(), &observer)?;
    let matrices = joined.matrices(args.part.map(Into::into))?;
    let traced = &joined.traced;
    let shape = (traced.matrix.channels(), traced.matrix.resolution(), traced.matrix.projector_resolution());
    let mut more = of_paths(Some(traced.summary.paths), traced.noise.as_ref());
    merge(&mut more, json!({ "verb": "matrix join", "shards": args.shards.len() }));
    write(&file, &matrices, shape, more, console)?;
    Ok(Outcome::Done)
}

/// Writes the matrices of each channel, says where, and prints the summary with `more` in it.
fn write(
    named: &Path,
    matrices: &[Vec<(&'static str, Csr)>],
    (channels, resolution, projector): (Channels, Resolution, Resolution),
    more: Value,
    console: &Console,
) -> Result<()> {
    let (mut files, mut nonzeros) = (Vec::new(), Vec::new());
    for (channel, suffix) in matrices.iter().zip(channel_suffixes(channels)) {
        for (bounces, matrix) in channel {
            let file = with_suffix(named, &format!("{bounces}{suffix}"));
            sparse::write(&file, matrix)?;
            nonzeros.push(matrix.weights().len());
            console.say(format_args!("wrote     {}", file.display()))?;
            files.push(file);
        }
    }
    let mut summary = json!({
        "verb": "matrix",
        "files": files.iter().map(Name::from).collect::<Vec<_>>(),
        "resolution": resolution,
        "projector_resolution": projector,
        "rows": resolution.pixels(),
        "columns": projector.pixels(),
        "nonzeros": nonzeros,
    });
    merge(&mut summary, more);
    console.summary(&summary)
}

/// The facts of the summary about the light paths.
fn of_paths(paths: Option<u64>, noise: Option<&Noise>) -> Value {
    json!({ "paths": paths, "noise": noise.map(manifest::Noise::from) })
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
    fn parts_count_from_one() {
        assert_eq!("3/16".parse(), Ok(ShardArg(3, 16)));
        assert_eq!("1/1".parse(), Ok(ShardArg(1, 1)));
        for wrong in ["", "0/16", "17/16", "3", "3/", "/3", "-1/3", "1/65537", "1/99999999999999999999"] {
            assert!(wrong.parse::<ShardArg>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn suffixes_stand_before_the_extension() {
        let name = |suffix| with_suffix(Path::new("a/b.c.npz"), suffix).display().to_string();
        assert_eq!([name(""), name("_rest.g")], ["a/b.c.npz", "a/b.c_rest.g.npz"]);
    }
}
