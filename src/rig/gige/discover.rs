//! The search for cameras.

use std::net::Ipv4Addr;
use std::time::Duration;

use viva_genicam::gige::DiscoveryOptions;
use viva_genicam::{Access, GenicamError, blocking};

use super::link::is_denied;
use crate::error::Result;
use crate::rig::busy::in_use;
use crate::rig::camera_fault;
use crate::rig::genicam::Abilities;

/// How long cameras may take to answer.
const ANSWER: Duration = Duration::from_millis(500);

/// A GigE Vision camera that answered.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FoundGigeCamera {
    /// The camera's address.
    pub address: Ipv4Addr,
    /// The maker, if the camera says.
    pub maker: Option<String>,
    /// The model, if the camera says.
    pub model: Option<String>,
    /// The serial number, if the camera says.
    pub serial: Option<String>,
}

/// Finds the GigE Vision cameras that answer on the computer's own networks, and those at `addresses`.
///
/// # Errors
/// [`Error::Rig`](crate::Error::Rig) when no request can be sent.
pub fn cameras(addresses: &[Ipv4Addr]) -> Result<Vec<FoundGigeCamera>> {
    let failed = |why: GenicamError| {
        camera_fault(
            format!("cameras cannot be searched for: {why}"),
            "check that the computer has a network",
        )
    };
    let mut found =
        blocking::discover_with(ANSWER, &DiscoveryOptions::new().include_loopback(true)).map_err(failed)?;
    for &address in addresses {
        if found.iter().all(|device| device.ip != address) {
            found.extend(blocking::discover_ip(address, ANSWER).map_err(failed)?);
        }
    }
    let camera = |device: viva_genicam::gige::DeviceInfo| FoundGigeCamera {
        address: device.ip,
        maker: device.manufacturer,
        model: device.model,
        serial: device.serial,
    };
    Ok(found.into_iter().map(camera).collect())
}

/// Reads what the camera at an address can do. A program that holds the camera keeps it.
///
/// # Errors
/// [`Error::Rig`](crate::Error::Rig) when it does not answer, or cannot be read while another program holds it.
pub fn gige_camera_abilities(address: Ipv4Addr) -> Result<Abilities> {
    let failed = |why: GenicamError| match is_denied(&why) {
        true => in_use(&format!("at {address}")),
        false => camera_fault(
            format!("the camera at {address} does not say what it can do: {why}"),
            "check its cable and address, and end any other program that uses it",
        ),
    };
    let Some(device) = blocking::discover_ip(address, ANSWER).map_err(failed)? else {
        return Err(camera_fault(
            format!("no GigE Vision camera answers at {address}"),
            "check its power, its cable and its address; the network must be the computer's own",
        ));
    };
    let (camera, _) = blocking::connect_as(&device, Access::Monitor).map_err(failed)?;
    Ok(Abilities::of(&camera))
}
