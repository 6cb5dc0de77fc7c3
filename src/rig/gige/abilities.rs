//! What a camera can do, read from its own description without taking it from whoever holds it.

use std::net::Ipv4Addr;

use viva_genicam::{Access, GenicamError, blocking};

use super::fault;
use super::link::ANSWER;
use crate::error::Result;

/// What a camera says it can do, as far as it answers.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Abilities {
    /// Width and height of its sensor, in pixels.
    pub sensor: Option<[usize; 2]>,
    /// The formats of its pixels, as it calls them.
    pub pixel_formats: Vec<String>,
    /// The shortest and the longest exposure, in seconds.
    pub exposures: Option<[f64; 2]>,
    /// The lowest and the highest gain, in its own unit.
    pub gains: Option<[f64; 2]>,
}

/// Asks the camera at an address.
///
/// # Errors
/// [`Error::Rig`](crate::Error::Rig) when it does not answer, or lets nobody read while it is held.
pub fn abilities(address: Ipv4Addr) -> Result<Abilities> {
    let failed = |why: GenicamError| {
        fault(
            format!("the camera at {address} does not say what it can do: {why}"),
            "end the program that holds it, and check its cable and address",
        )
    };
    let Some(device) = blocking::discover_ip(address, ANSWER).map_err(failed)? else {
        return Err(fault(
            format!("no GigE Vision camera answers at {address}"),
            "check its power, its cable and its address; the network must be the computer's own",
        ));
    };
    let (camera, _) = blocking::connect_as(&device, Access::Monitor).map_err(failed)?;
    let range = |names: &[&str]| {
        let mut states = names.iter().filter_map(|name| camera.feature_state(name).ok());
        states.find_map(|state| state.range).map(|range| [range.min, range.max])
    };
    let whole = |names: &[&str]| {
        let number = names.iter().find_map(|name| camera.get_integer(name).ok());
        number.and_then(|number| usize::try_from(number).ok()).filter(|&number| number > 0)
    };
    // What is read now may be a part of the sensor: the most that it could be is asked for.
    let sides = [whole(&["WidthMax", "SensorWidth"]), whole(&["HeightMax", "SensorHeight"])];
    Ok(Abilities {
        sensor: sides[0].zip(sides[1]).map(|(width, height)| [width, height]),
        pixel_formats: camera.enum_entries("PixelFormat").unwrap_or_default(),
        // In microseconds.
        exposures: range(&["ExposureTime", "ExposureTimeAbs"]).map(|range| range.map(|time| time / 1e6)),
        gains: range(&["Gain"]),
    })
}
