//! `krylux rig flat-field`: the uneven brightness of projector and camera, by a matte sheet.

use serde_json::json;

use super::super::Outcome;
use super::super::console::Console;
use super::super::opening::Opening;
use super::super::options::SourceArgs;
use super::super::trace::TraceArgs;
use super::bench::require_rig;
use crate::error::{Error, Result};
use crate::io::name::Name;

/// Measure how uneven projector and camera are, by one photo of a matte sheet; added to the rig's calibration
///
/// Stand a matte sheet of one colour square to the camera, so that it fills the view, and keep other light away. A virtual rig
/// gets such a sheet in place of its scene. Calibrate the rig first. From then on patterns are divided by the projector's brightness
/// and photos by the camera's. Runs that were begun before cannot be continued.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux rig flat-field rig.toml")]
pub(in super::super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    require_rig(&args.source.source, "SOURCE")?;
    let lab = Opening::new(&args.source, &args.trace).builder(console).open()?;
    // Anything but a rig was refused above.
    let (flat, folder) = lab.rig().ok_or(Error::Interrupted)?.add_flat_field()?;
    let darkest = |values: &[f64]| {
        let [least, most] =
            [f64::min, f64::max].map(|choose| values.iter().copied().reduce(choose).unwrap_or(1.0));
        least / most
    };
    let [projector, camera] = [darkest(&flat.projector), darkest(&flat.camera)];
    console
        .say(format_args!("projector its darkest pixel has {projector:.3} of the light of its brightest"))?;
    console.say(format_args!("camera    its darkest pixel has {camera:.3} of the light of its brightest"))?;
    console.say(format_args!("wrote     {}", folder.display()))?;
    console.summary(&json!({
        "verb": "rig flat-field",
        "folder": Name::from(&folder),
        "projector": projector,
        "camera": camera,
    }))?;
    Ok(Outcome::Done)
}
