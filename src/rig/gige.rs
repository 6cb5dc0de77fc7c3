//! A machine vision camera on the network: GigE Vision (feature `gige`). Lost packets are sent again. [`super::genicam`] contains the
//! functions shared with USB3 Vision.

use std::net::Ipv4Addr;
use std::time::{Duration, Instant};

use serde_json::json;
use viva_genicam::gige::{DiscoveryOptions, GigeError};
use viva_genicam::{
    Access, Camera as Described, Frame, FrameStream, GenicamError, GigeRegisterIo, StreamOptions, blocking,
};

use super::genicam::{Answered, TransportLayer, Triggered, said};
use super::hardware::{causes, in_use};
use super::{Abilities, AttachedCamera, CameraKind, GenicamSpec, Losses, WallClock, camera_fault};
use crate::error::{Error, Result};

/// The longest wait for a camera that does not answer or that another program holds. After a session that ended abruptly, the camera is
/// free once its heartbeat timeout of 3 s has passed.
const PATIENCE: Duration = Duration::from_secs(5);

/// The GigE Vision status of a camera that another program holds.
const ACCESS_DENIED: u16 = 0x8006;

/// The longest wait for the answer to one request.
pub(crate) const ANSWER: Duration = Duration::from_millis(500);

/// A GigE Vision camera.
pub type GigeVision = Triggered<OnNetwork>;

impl GigeVision {
    /// Opens the camera. The times of frames are read from `clock`, and their numbers begin at `after + 1`.
    ///
    /// # Errors
    /// [`Error::Rig`] when no camera answers at the address, when another program holds the camera, or when the camera
    /// cannot do what `spec` says.
    pub fn open(spec: &GenicamSpec, clock: WallClock, after: u64) -> Result<Self> {
        let address =
            spec.address.ok_or_else(|| camera_fault("it has no address", "give address in [camera]"))?;
        Self::start(OnNetwork { address, packet_size: spec.packet_size }, spec, clock, after)
    }
}

/// The GigE Vision protocol with the camera at an address.
pub struct OnNetwork {
    address: Ipv4Addr,
    packet_size: Option<u32>,
}

impl TransportLayer for OnNetwork {
    type Registers = GigeRegisterIo;
    type Stream = FrameStream;

    fn place(&self) -> String {
        format!("at {}", self.address)
    }

    fn connect(&self) -> Result<Described<GigeRegisterIo>> {
        let began = Instant::now();
        loop {
            let found = blocking::discover_ip(self.address, ANSWER);
            let why = match found.map_err(|why| said(&self.place(), "answer", &why))? {
                None => silent(self.address),
                Some(device) => match blocking::connect(&device) {
                    Ok(camera) => return Ok(camera),
                    Err(why) if is_denied(&why) => in_use(&self.place()),
                    Err(why) => said(&self.place(), "be opened", &why),
                },
            };
            if began.elapsed() >= PATIENCE {
                return Err(why);
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    fn stream(&self, camera: &mut Described<GigeRegisterIo>) -> Answered<FrameStream> {
        let options = StreamOptions::new();
        camera.open_stream(match self.packet_size {
            Some(size) => options.packet_size(size),
            None => options,
        })
    }

    fn next(stream: &mut FrameStream, patience: Duration) -> Answered<Option<Frame>> {
        stream.next_frame_blocking(patience)
    }

    fn number(frame: &Frame) -> u64 {
        frame.block_id
    }

    fn losses(stream: &FrameStream) -> Losses {
        let stats = stream.stats();
        Losses {
            resent: stats.resend_recovered,
            incomplete: stats.frames_incomplete,
            missing: stats.packets_missing,
        }
    }
}

/// Whether the error means that another program controls the camera. A camera that is controlled exclusively also refuses to be read, for
/// example when its description is requested.
pub(crate) fn is_denied(why: &GenicamError) -> bool {
    causes(why).any(|why| {
        matches!(why.downcast_ref(), Some(GigeError::Status(status)) if status.to_raw() == ACCESS_DENIED)
    })
}

fn silent(address: Ipv4Addr) -> Error {
    camera_fault(
        format!("no GigE Vision camera answers at {address}"),
        "check its power, its cable and its address; the network must be the computer's own",
    )
}

/// Finds the GigE Vision cameras that answer on the computer's networks or at `address`.
pub(crate) fn cameras(address: Option<Ipv4Addr>) -> Result<Vec<AttachedCamera>> {
    let failed = |why: GenicamError| {
        camera_fault(
            format!("cameras cannot be searched for: {why}"),
            "check that the computer has a network",
        )
    };
    let mut found =
        blocking::discover_with(ANSWER, &DiscoveryOptions::new().include_loopback(true)).map_err(failed)?;
    if let Some(address) = address.filter(|address| found.iter().all(|device| device.ip != *address)) {
        found.extend(blocking::discover_ip(address, ANSWER).map_err(failed)?);
    }
    let camera = |device: viva_genicam::gige::DeviceInfo| {
        let place = device.ip.to_string();
        let names = [device.manufacturer, device.model, device.serial];
        let [maker, model, serial] = names.each_ref().map(|name| name.as_deref().unwrap_or("?"));
        let line = format!("{place}: {maker} {model}, serial number {serial}");
        let facts = json!({ "address": device.ip, "maker": names[0], "model": names[1], "serial": names[2] });
        AttachedCamera::new(CameraKind::Gige, Some(place), line, facts)
    };
    Ok(found.into_iter().map(camera).collect())
}

/// Reads the abilities of the camera at an address. If another program controls the camera, it keeps control.
///
/// # Errors
/// [`Error::Rig`] when the camera does not answer, or cannot be read while another program holds it.
pub fn gige_camera_abilities(address: Ipv4Addr) -> Result<Abilities> {
    let failed = |why: GenicamError| match is_denied(&why) {
        true => in_use(&format!("at {address}")),
        false => camera_fault(
            format!("the camera at {address} does not say what it can do: {why}"),
            "check its cable and address, and end any other program that uses it",
        ),
    };
    let Some(device) = blocking::discover_ip(address, ANSWER).map_err(failed)? else {
        return Err(silent(address));
    };
    let (camera, _) = blocking::connect_as(&device, Access::Monitor).map_err(failed)?;
    Ok(Abilities::of(&camera))
}
