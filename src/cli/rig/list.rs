//! `krylux rig list`: the monitors and cameras that a rig file may name.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::super::Outcome;
use super::super::console::Console;
use crate::error::Result;
use crate::measure::{RigFile, RigKind};
use crate::rig::{AttachedCamera, AttachedDevices, MonitorInfo};

/// List the monitors and cameras that a rig file may name; no camera is opened but that of the rig file
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux rig list --abilities")]
pub(in super::super) struct Args {
    /// A rig file; its X server and its camera are queried, too
    #[arg(value_name = "RIG")]
    file: Option<PathBuf>,
    /// The X server [default: that of the rig file, or of DISPLAY]
    #[arg(long, value_name = ":N")]
    display: Option<String>,
    /// Open every camera that answers, and say what it can do, as for that of the rig file. What it can do is a description that the camera
    /// sends: a separate process reads it
    #[arg(long)]
    abilities: bool,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let file = args.file.as_deref().map(RigFile::load).transpose()?;
    let hardware = match file.as_ref().map(|file| &file.kind) {
        Some(RigKind::Hardware(rig)) => Some(rig),
        _ => None,
    };
    if let Some(file) = file.as_ref().filter(|_| hardware.is_none()) {
        say_virtual(file, console)?;
    }
    let mut note = |why: &crate::Error| console.note(format_args!("note: {why}"));
    let found = AttachedDevices::find(args.display.as_deref(), hardware, args.abilities, &mut note);
    found.monitors.iter().enumerate().try_for_each(|(at, monitor)| say_monitor(at, monitor, console))?;
    if found.cameras.is_empty() {
        console.say("camera    none answers")?;
    }
    let is_virtual = file.is_some() && hardware.is_none();
    let is_found = is_virtual || !found.monitors.is_empty() || !found.cameras.is_empty();
    if !is_found {
        console.note("nothing was found: connect and switch on a projector or a camera, or name the X server by --display");
    }
    found.cameras.iter().try_for_each(|camera| say_camera(camera, console))?;
    let cameras: Vec<&Value> = found.cameras.iter().map(|camera| &camera.described).collect();
    let simulated = file
        .as_ref()
        .filter(|_| hardware.is_none())
        .map(|file| json!({ "projector": file.kind.projector_info(), "camera": file.kind.camera_info() }));
    console.summary(
        &json!({ "verb": "rig list", "monitors": found.monitors, "cameras": cameras, "virtual": simulated }),
    )?;
    Ok(if is_found { Outcome::Done } else { Outcome::NotGoodEnough })
}

/// The devices that a virtual rig's file describes.
fn say_virtual(file: &RigFile, console: &Console) -> Result<()> {
    let (projector, camera) = (file.kind.projector_info(), file.kind.camera_info());
    console.say(format_args!(
        "virtual   projector: {} pixels, {} bits, frame_time = {}",
        projector.resolution, projector.bits, projector.frame_time
    ))?;
    let [shortest, longest] = camera.exposures;
    console.say(format_args!(
        "virtual   camera: {} pixels, {} bits, exposures {shortest} to {longest} s",
        camera.resolution, camera.bits
    ))
}

fn say_monitor(at: usize, monitor: &MonitorInfo, console: &Console) -> Result<()> {
    let [x, y] = monitor.place;
    let refresh = monitor.frame_time.map_or_else(String::new, |time| format!(", frame_time = {time:.5}"));
    let primary = if monitor.is_primary { ", the desktop's first" } else { "" };
    console.say(format_args!(
        "monitor   {at} \"{}\": {} pixels at ({x}, {y}){refresh}{primary}",
        monitor.name, monitor.resolution
    ))
}

fn say_camera(camera: &AttachedCamera, console: &Console) -> Result<()> {
    for (at, line) in camera.lines.iter().enumerate() {
        console.say(format_args!("{:<9} {line}", if at == 0 { "camera" } else { "" }))?;
    }
    if let Some(why) = &camera.unknown {
        console.note(format_args!("note: {why}"));
    }
    Ok(())
}
