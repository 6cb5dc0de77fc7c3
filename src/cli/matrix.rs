//! `krylux matrix`: the light transport matrix itself, as a file.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Subcommand;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::Outcome;
use super::console::Console;
use super::opening::{builder, in_journal, open_shown, settings, tell};
use super::options::{KeepArgs, OperatorArgs, ViewArgs, free_file};
use super::tev::LiveArgs;
use super::trace::{CacheArgs, TraceArgs};
use crate::error::Result;
use crate::io::sparse;
use crate::lab::{Settings, SharedObserver};
use crate::transport::Backend;
use crate::verbs::matrix::{JoinShards, WriteMatrix};

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
    /// Where a scene's matrix is assembled (the same, to the rounding of sums); auto: on a GPU that has f64 and room for it, else on the processor,
    /// which alone gives the bits of joined shards
    #[arg(long, value_name = "PRODUCTS", value_parser = auto_or_cpu(), default_value = "auto")]
    products: Backend,
    #[command(flatten)]
    request: WriteMatrix,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    live: LiveArgs,
}

/// The places where a matrix is assembled. Without products there is no other choice.
fn auto_or_cpu() -> impl TypedValueParser<Value = Backend> {
    let backend = |name: String| if name == "cpu" { Backend::Cpu } else { Backend::Auto };
    PossibleValuesParser::new(["auto", "cpu"]).map(backend)
}

const EXAMPLES: &str = "Examples:
  krylux matrix scene.glb --size 32 --spp 1024 -o matrix.npz
  krylux matrix scene.glb --size 512 --spp 4096 --shard 3/16 -o shard-3.krylux # on any machine; then: krylux matrix join";

#[derive(Subcommand)]
enum Action {
    Join(super::asked::Asked<JoinShards, (), CacheArgs>),
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    match (&args.action, &args.source) {
        (Some(Action::Join(args)), _) => {
            let file = checked(args.request.file.as_ref())?;
            let observer = SharedObserver(Arc::new(console.clone()));
            let content = args.request.ask(&args.after.choice(), &observer, &file)?;
            tell("matrix join", &content, true, console)
        }
        (None, Some(source)) => write_matrix(args, source, console),
        // The parser requires a source or a subcommand.
        (None, None) => Ok(Outcome::Done),
    }
}

/// The named file, or else an unused file name. Fails if the file cannot be written.
fn checked(named: Option<&PathBuf>) -> Result<PathBuf> {
    let file = named.cloned().unwrap_or_else(|| free_file("matrix", "npz"));
    sparse::check_writable(&file).map(|()| file)
}

fn write_matrix(args: &Args, source: &Path, console: &Console) -> Result<Outcome> {
    let request = &args.request;
    let settings = Settings {
        operator: OperatorArgs { backend: args.products, ..OperatorArgs::default() },
        channels: request.channels.into(),
        split_bounces: request.split_bounces,
        ..settings(&args.view, &args.trace)
    };
    let builder = builder(source, settings, console);
    if let (Some(shard), Some(file)) = (request.shard, &request.file) {
        return tell("matrix", &shard.ask(&mut builder.open()?, file)?, true, console);
    }
    let file = checked(request.file.as_ref())?;
    let mut lab = open_shown(builder, &args.live, console)?;
    in_journal(&mut lab, &args.keep, "matrix", |lab| {
        let (content, is_good) = request.ask(lab, &file)?;
        tell("matrix", &content, is_good, console)
    })
}
