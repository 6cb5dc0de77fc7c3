//! Options that several verbs share.

use std::path::PathBuf;

use clap::Args;

pub(super) use crate::lab::{OperatorSettings as OperatorArgs, View as ViewArgs};
pub(super) use crate::transport::Channels as ChannelsArg;
pub(super) use crate::verbs::options::{count, number, time};

/// Which source of photos.
#[derive(Args, Clone)]
pub(super) struct SourceArgs {
    /// A scene (.glb or .gltf with a camera, or .obj with a file of its rig), a rig (.toml), or a run's folder, whose photos are asked anew
    #[arg(value_name = "SOURCE")]
    pub(super) source: PathBuf,
    #[command(flatten)]
    pub(super) view: ViewArgs,
}

/// The place of a run's folder.
#[derive(Args)]
pub(super) struct RunArgs {
    /// Where the run goes [default: out/SOURCE-VERB]
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    pub(super) folder: Option<PathBuf>,
    /// Write into a folder that holds an earlier run, whose photos are thrown away when the new run is whole
    #[arg(long)]
    pub(super) overwrite: bool,
    /// Open the report when it is written
    #[arg(long)]
    pub(super) open: bool,
    /// Also write paint.html: a page with the matrix in it, on which patterns are painted (scenes and matrices only)
    #[arg(long)]
    pub(super) paint: bool,
    /// Go on with the run in the folder: no photo that is in its journal is taken again
    #[arg(long, conflicts_with = "overwrite")]
    pub(super) resume: bool,
}

/// Whether an answer is checked.
#[derive(Args)]
pub(super) struct CheckArgs {
    /// Do not check the answer. Without this, the photos that it predicts are compared with independent ones: of a scene by light paths
    /// of another seed, which takes as long as tracing it once more, and less for eigenvectors; of a rig by one more photo
    #[arg(long = "no-check")]
    is_off: bool,
}

impl CheckArgs {
    /// Whether to check.
    pub(super) fn is_on(&self) -> bool {
        !self.is_off
    }
}

/// The place where a verb that leaves single files keeps the photos of a rig.
#[derive(Args)]
pub(super) struct KeepArgs {
    /// Keep a rig's photos in this folder, as other verbs do in theirs: each is on disk before it is used, and the folder can be
    /// given as SOURCE afterwards
    #[arg(long = "journal", value_name = "DIR")]
    folder: Option<PathBuf>,
    /// Start --journal anew where it holds an earlier run, whose photos are thrown away when the new run is whole
    #[arg(long, requires = "folder")]
    overwrite: bool,
    /// Go on with the run in --journal: no photo that is there is taken again
    #[arg(long, requires = "folder", conflicts_with = "overwrite")]
    resume: bool,
}

impl KeepArgs {
    /// The options of a run in this folder, if a folder is given.
    pub(super) fn run(&self) -> Option<RunArgs> {
        let Self { folder, overwrite, resume } = self;
        folder.as_ref().map(|folder| RunArgs {
            folder: Some(folder.clone()),
            overwrite: *overwrite,
            open: false,
            paint: false,
            resume: *resume,
        })
    }
}

/// The options that every verb has, before it as well as after it.
#[derive(Args)]
pub(super) struct GlobalArgs {
    /// Print a machine-readable summary on stdout, and nothing else there; an error is one JSON object on stderr
    #[arg(long, global = true, display_order = 900)]
    pub(super) json: bool,
    /// Print nothing but errors (and --json's summary)
    #[arg(short, long, global = true, display_order = 901, conflicts_with = "verbose")]
    pub(super) quiet: bool,
    /// Print details on stderr
    #[arg(short, long, global = true, display_order = 902)]
    pub(super) verbose: bool,
    /// Run the programs that a rig file names, though the file is not in your own folder ($XDG_CONFIG_HOME/krylux): the author of a rig file
    /// chooses what is run
    #[arg(long, global = true, display_order = 903)]
    pub(super) allow_programs: bool,
}

/// The file that a verb writes without `-o`: the first unused name of `NAME.EXTENSION`, `NAME-2.EXTENSION`, `NAME-3.EXTENSION`, … A file is
/// replaced only if the user names it. Files such as `NAME.r.EXTENSION` belong to `NAME.EXTENSION`.
pub(super) fn free_file(name: &str, extension: &str) -> PathBuf {
    let names = std::fs::read_dir(".").into_iter().flatten().filter_map(|item| Some(item.ok()?.file_name()));
    let names: Vec<String> = names.filter_map(|name| name.into_string().ok()).collect();
    let ending = format!(".{extension}");
    let is_free = |stem: &String| {
        let is_of_stem = |name: &String| name.starts_with(&format!("{stem}.")) && name.ends_with(&ending);
        !names.iter().any(is_of_stem)
    };
    let stems = (1..=names.len() + 1).map(|number| match number {
        1 => name.to_owned(),
        _ => format!("{name}-{number}"),
    });
    // There is one more stem than there are files, so one stem is unused.
    let stem = stems.into_iter().find(is_free).unwrap_or_else(|| name.to_owned());
    PathBuf::from(stem + &ending)
}
