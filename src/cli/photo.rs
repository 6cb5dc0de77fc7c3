//! `krylux photo` and `krylux labels`: single pictures of a source.

use std::path::PathBuf;

use super::Outcome;
use super::asked::Asked;
use super::console::Console;
use super::opening::{Traced, builder, in_journal, open_shown, settings, tell};
use super::options::{KeepArgs, SourceArgs, free_file};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::error::Result;
use crate::io::picture;
use crate::lab::{ChannelChoice, Settings};
use crate::verbs::photo::{TakePhoto, WriteLabels};

/// The places where photos are kept and shown.
#[derive(clap::Args)]
pub(super) struct Kept {
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    live: LiveArgs,
}

pub(super) fn run(args: &Asked<TakePhoto, Traced, Kept>, console: &Console) -> Result<Outcome> {
    let Asked { before, request, after } = args;
    let files = named_or_free(&request.files, "photo");
    files.iter().chain(&request.error).try_for_each(|file| picture::check_writable(file))?;
    let operator = request.operator(&before.source.source);
    let channels = request.channels.map_or(ChannelChoice::Native, Into::into);
    let settings = Settings { channels, operator, ..before.settings() };
    let builder = builder(&before.source.source, settings, console);
    let mut lab = open_shown(builder, &after.live, console)?;
    request.check_scale(lab.resolution())?;
    let pattern = request.pattern.image_for(&lab)?;
    in_journal(&mut lab, &after.keep, "photo", |lab| {
        let taken = lab.single_photo(&pattern)?;
        for (channel, plane) in taken.photo.planes().iter().enumerate() {
            let shown = pattern.plane(channel.min(pattern.channels() - 1));
            let progress = console.progress();
            progress.show("pattern", pattern.resolution(), channel, &shown);
            progress.show("photo", taken.photo.resolution(), channel, plane);
        }
        let (content, is_good) = request.write(lab, &taken, &files)?;
        tell("photo", &content, is_good, console)
    })
}

pub(super) fn labels(args: &Asked<WriteLabels, SourceArgs, ()>, console: &Console) -> Result<Outcome> {
    let WriteLabels { size, adapter, files } = &args.request;
    let files = named_or_free(files, "labels");
    files.iter().try_for_each(|file| picture::check_writable(file))?;
    let trace = TraceArgs::for_looking(*size, adapter.clone());
    let settings = settings(&args.before.view, &trace);
    let lab = builder(&args.before.source, settings, console).open()?;
    tell("labels", &WriteLabels::ask(&lab, &files)?, true, console)
}

/// The files that `-o` names, or else an unused name for a `.png` file.
fn named_or_free(files: &[PathBuf], name: &str) -> Vec<PathBuf> {
    if files.is_empty() { vec![free_file(name, "png")] } else { files.to_vec() }
}
