//! `krylux describe-camera`: the process in which the description of a camera is read. It is started by krylux itself.

use super::super::Outcome;
use super::super::console::Console;
use crate::error::{Error, Result};
use crate::rig::{self, Abilities};

/// Print what a camera can do, as JSON; krylux starts this itself
#[derive(clap::Args)]
pub(in super::super) struct Args {
    /// The kind of camera: gige or usb3
    kind: String,
    /// The address or the serial number; of USB cameras the only one, where it is left out
    place: Option<String>,
}

/// The process that reads a description.
pub(in super::super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let place = args.place.as_deref();
    let abilities = abilities(&args.kind, place)?;
    console.summary(&serde_json::json!(abilities))?;
    Ok(Outcome::Done)
}

fn abilities(kind: &str, place: Option<&str>) -> Result<Abilities> {
    match kind {
        #[cfg(feature = "gige")]
        "gige" => match place.and_then(|place| place.parse().ok()) {
            Some(address) => rig::gige_camera_abilities(address),
            None => Err(unknown(kind)),
        },
        #[cfg(feature = "usb3")]
        "usb3" => rig::usb_camera_abilities(place),
        _ => Err(unknown(kind)),
    }
}

fn unknown(kind: &str) -> Error {
    Error::option("KIND", format!("a camera of kind {kind} has no description, or no address is given"))
        .help("give gige and an address, or usb3 and a serial number")
}
