//! `krylux matrix join`: the matrix of all shards.

use std::path::PathBuf;
use std::sync::Arc;

use super::super::opening::merge;
use super::super::operator::CacheArgs;
use super::*;
use crate::lab::{SharedObserver, join_shards};

/// Join all parts that `krylux matrix SOURCE --shard K/N` traced to the matrix, with the bits of a single run
#[derive(clap::Args)]
#[command(after_help = EXAMPLE)]
pub(super) struct Args {
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

const EXAMPLE: &str = "Example:
  krylux matrix join shard-*.krylux -o matrix.npz # later verbs on this scene find it in the cache, too";

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
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
