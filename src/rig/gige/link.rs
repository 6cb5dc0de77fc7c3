//! A session with a camera: from its address to its frames.

use std::time::{Duration, Instant};

use viva_genicam::gige::GigeError;
use viva_genicam::{Camera, FrameStream, GenicamError, GigeRegisterIo, Roi, StreamOptions, blocking};

use super::fault;
use super::spec::GigeSpec;
use crate::error::{Error, Result};

/// How long a camera that is off, or still held by a session that ended abruptly (its heartbeat lasts 3 s), is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// The status of GigE Vision for what is somebody else's.
const ACCESS_DENIED: u16 = 0x8006;

/// How long one question takes at most.
pub(super) const ANSWER: Duration = Duration::from_millis(500);

/// An open camera, set up and waiting for its trigger. Dropped, it is released.
pub(super) struct Link {
    pub(super) camera: Camera<GigeRegisterIo>,
    pub(super) stream: FrameStream,
}

impl Link {
    /// Opens the camera, sets it up, and starts its stream.
    pub(super) fn open(spec: &GigeSpec) -> Result<Self> {
        let mut camera = connect(spec)?;
        set_up(&mut camera, spec)?;
        let mut options = StreamOptions::new();
        if let Some(size) = spec.packet_size {
            options = options.packet_size(size);
        }
        let stream = camera.open_stream(options).map_err(|why| said(spec, "open its stream", &why))?;
        camera.acquisition_start().map_err(|why| said(spec, "start", &why))?;
        Ok(Self { camera, stream })
    }

    /// Sets the exposure in seconds; what was really set.
    pub(super) fn configure(&mut self, spec: &GigeSpec, exposure: f64) -> Result<f64> {
        let failed = |why: GenicamError| said(spec, &format!("set an exposure of {exposure} s"), &why);
        self.camera.set_exposure_time(1e6 * exposure).map_err(failed)?;
        let set = self.camera.exposure_time().map_err(failed)?;
        Ok(set / 1e6)
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        // The camera may be gone; it stops by itself then.
        let _ = self.camera.acquisition_stop();
    }
}

fn connect(spec: &GigeSpec) -> Result<Camera<GigeRegisterIo>> {
    let began = Instant::now();
    loop {
        let found = blocking::discover_ip(spec.address, ANSWER);
        let why = match found.map_err(|why| said(spec, "answer", &why))? {
            None => fault(
                format!("no GigE Vision camera answers at {}", spec.address),
                "check its power, its cable and its address; the network must be the computer's own",
            ),
            Some(device) => match blocking::connect(&device) {
                Ok(camera) => return Ok(camera),
                Err(why) if is_denied(&why) => fault(
                    format!("the camera at {} is held by another program", spec.address),
                    "end that program; after a crash the camera is free again in a few seconds",
                ),
                Err(why) => said(spec, "be opened", &why),
            },
        };
        if began.elapsed() >= PATIENCE {
            return Err(why);
        }
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn is_denied(why: &GenicamError) -> bool {
    matches!(why, GenicamError::Gige { source: GigeError::Status(status), .. } if status.to_raw() == ACCESS_DENIED)
}

/// Brings the camera to one frame for each software trigger, with nothing automatic.
fn set_up(camera: &mut Camera<GigeRegisterIo>, spec: &GigeSpec) -> Result<()> {
    let failed = |doing: &str, why: &GenicamError| said(spec, doing, why);
    // A session that ended abruptly leaves it running.
    let _ = camera.acquisition_stop();
    for automatic in ["ExposureAuto", "GainAuto", "BalanceWhiteAuto"] {
        if camera.get_enum(automatic).is_ok_and(|value| value != "Off") {
            camera
                .set_enum(automatic, "Off")
                .map_err(|why| failed(&format!("switch {automatic} off"), &why))?;
        }
    }
    let format = spec.pixel_format.name();
    camera.set_enum("PixelFormat", format).map_err(|why| {
        let known = camera.enum_entries("PixelFormat").map(|known| known.join(", ")).unwrap_or_default();
        fault(
            format!("the camera at {} has no pixel format {format}: {why}", spec.address),
            format!("give another pixel_format in [camera]; it has {known}"),
        )
    })?;
    let [[width, height], [x, y]] = [spec.size, spec.offset].map(|pair| pair.map(|side| side as i64));
    camera.set_roi(Roi { x, y, width, height }).map_err(|why| {
        fault(
            format!(
                "the camera at {} has no region of {width}x{height} pixels at ({x}, {y}): {why}",
                spec.address
            ),
            "correct size or offset in [camera]",
        )
    })?;
    camera.set_acquisition_mode("Continuous").map_err(|why| failed("take frames one after another", &why))?;
    camera
        .enable_trigger("FrameStart", "Software")
        .map_err(|why| failed("wait for a software trigger", &why))?;
    if let Some(gain) = spec.gain {
        camera.set_gain(gain).map_err(|why| failed(&format!("set a gain of {gain}"), &why))?;
    }
    check_exposures(camera, spec)
}

/// That the camera does all exposures that the rig file promises.
fn check_exposures(camera: &Camera<GigeRegisterIo>, spec: &GigeSpec) -> Result<()> {
    let known = ["ExposureTime", "ExposureTimeAbs"];
    let states = known.iter().filter_map(|name| camera.feature_state(name).ok());
    let Some(state) = states.into_iter().next() else {
        return Err(fault(
            format!("the camera at {} does not say its exposure in microseconds", spec.address),
            "use a camera with the feature ExposureTime",
        ));
    };
    let Some(range) = state.range else { return Ok(()) };
    let [least, most] = [range.min, range.max];
    let [shortest, longest] = spec.exposures;
    // Microseconds are whole numbers in many cameras.
    if 1e6 * shortest < least - 1.0 || 1e6 * longest > most + 1.0 {
        return Err(fault(
            format!(
                "the camera at {} does exposures from {} to {} s, but the rig file says {shortest} to {longest} s",
                spec.address,
                least / 1e6,
                most / 1e6
            ),
            "correct exposures in [camera]",
        ));
    }
    Ok(())
}

/// An error of the camera, as its protocol says it.
fn said(spec: &GigeSpec, doing: &str, why: &GenicamError) -> Error {
    fault(
        format!("the camera at {} did not {doing}: {why}", spec.address),
        "check its cable and power, and that its network is the computer's own; go on with --resume",
    )
}
