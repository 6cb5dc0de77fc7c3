//! `krylux labels`: the true region of each pixel.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::Opening;
use super::options::{SourceArgs, named_or_free};
use super::trace::TraceArgs;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::io::name::Name;
use crate::io::{npy, picture};
use crate::lab;
use crate::report::palette;

/// Write which region of the scene each pixel sees: the truth that a segmentation is measured against
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux labels scene.glb --size 128 -o labels.png")]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    /// Pixels of the camera, and of the projector where that has no --projector-size: 128, or 128x96 [default: 128]
    #[arg(long, value_name = "N|WxH", value_parser = lab::size)]
    size: Option<Resolution>,
    /// The graphics adapter whose name contains this; `krylux info` lists them
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Where they go: .npy keeps the numbers (255 is a pixel that sees nothing), .png shows them; may be given several times
    /// [default: labels.png, or the first free one of labels-2.png, labels-3.png, …]
    #[arg(short = 'o', long = "output", value_name = "FILE")]
    files: Vec<PathBuf>,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let files = named_or_free(&args.files, "labels", "png");
    files.iter().try_for_each(|file| picture::check_writable(file))?;
    let trace = TraceArgs::for_looking(args.size, args.adapter.clone());
    let lab = Opening::new(&args.source, &trace).open(console)?;
    let (resolution, labels) = (lab.resolution(), lab.labels()?);
    let regions = &lab.scene()?.regions;
    for file in &files {
        write(file, resolution, &labels)?;
        console.say(format_args!("wrote     {}", file.display()))?;
    }
    let counts = |region: u8| labels.iter().filter(|&&label| label == region).count();
    for (index, name) in regions.iter().enumerate() {
        let share = 100.0 * counts(index as u8) as f64 / labels.len() as f64;
        console.say(format_args!("region    {index}: {share:5.1} %  {name}"))?;
    }
    console.summary(&json!({
        "verb": "labels",
        "files": files.iter().map(Name::from).collect::<Vec<_>>(),
        "resolution": resolution,
        "regions": regions,
        "pixels": (0..regions.len()).map(|index| counts(index as u8)).collect::<Vec<_>>(),
    }))?;
    Ok(Outcome::Done)
}

fn write(file: &Path, resolution: Resolution, labels: &[u8]) -> Result<()> {
    let extension = file.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("npy") => npy::write_npy(file, &[resolution.height, resolution.width], labels),
        Some("png") => palette::paint_labels(resolution, labels).write_png(file),
        _ => {
            Err(Error::data(file, "labels are written as numbers or as a picture")
                .help("name it .npy or .png"))
        }
    }
}
