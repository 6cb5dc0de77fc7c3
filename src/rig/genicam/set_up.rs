//! The setup of a machine vision camera, and its abilities. The camera takes one frame for each software trigger, its automatic features
//! are off, and all values are within its limits.

use std::io::Read;
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;
use viva_genicam::genapi::{RegisterIo, ValueRange};
use viva_genicam::{Camera, GenicamError, StandardFeature};

use crate::error::{Error, Result};
use crate::rig::gphoto2::body::wait;
use crate::rig::hardware::{in_use, is_busy};
use crate::rig::sensor::Settings;
use crate::rig::{Helper, camera_fault};

/// The largest difference between the requested gain and the gain that was set, in the camera's unit (usually decibels). It is half of the
/// usual step of a tenth, with a margin.
const GAIN_TOLERANCE: f64 = 0.06;

/// Sets an open camera up. `place` is the camera's place in errors.
pub(crate) fn set_up<T: RegisterIo>(camera: &mut Camera<T>, settings: &Settings, place: &str) -> Result<()> {
    let failed = |doing: &str, why: &GenicamError| said(place, doing, why);
    // A session that ended abruptly leaves the acquisition running.
    let _ = camera.acquisition_stop();
    for automatic in ["ExposureAuto", "GainAuto", "BalanceWhiteAuto"] {
        if camera.get_enum(automatic).is_ok_and(|value| value != "Off") {
            camera
                .set_enum(automatic, "Off")
                .map_err(|why| failed(&format!("switch {automatic} off"), &why))?;
        }
    }
    // Gamma and look-up tables make counts nonlinear.
    for bent in ["GammaEnable", "LUTEnable"] {
        if camera.get_bool(bent).is_ok_and(|value| value) {
            camera.set_bool(bent, false).map_err(|why| failed(&format!("switch {bent} off"), &why))?;
        }
    }
    set_format(camera, settings, place)?;
    set_region(camera, settings, place)?;
    camera.set_acquisition_mode("Continuous").map_err(|why| failed("take frames one after another", &why))?;
    camera
        .enable_trigger("FrameStart", "Software")
        .map_err(|why| failed("wait for a software trigger", &why))?;
    if let Some(gain) = settings.gain {
        set_gain(camera, place, gain)?;
    }
    check_exposures(camera, settings, place)
}

fn set_format<T: RegisterIo>(camera: &mut Camera<T>, settings: &Settings, place: &str) -> Result<()> {
    let format = settings.pixel_format.name();
    camera.set_enum("PixelFormat", format).map_err(|why| {
        let known = camera.feature_state("PixelFormat").ok().and_then(|state| state.enum_entries);
        camera_fault(
            format!("the camera {place} has no pixel format {format}: {why}"),
            format!("give another pixel_format in [camera]; it has {}", known.unwrap_or_default().join(", ")),
        )
    })
}

/// Sets the part of the sensor that is read. Offsets are first set to their minimum, because the limits of sizes and offsets depend on each
/// other.
fn set_region<T: RegisterIo>(camera: &mut Camera<T>, settings: &Settings, place: &str) -> Result<()> {
    for name in ["OffsetX", "OffsetY"] {
        let least = limits(camera, name).map_or(0, |range| range.min as i64);
        if camera.get_integer(name).is_ok_and(|now| now != least) {
            camera
                .set_integer(name, least)
                .map_err(|why| said(place, &format!("set {name} to {least}"), &why))?;
        }
    }
    let [[width, height], [x, y]] = [settings.sensor.size, settings.sensor.offset];
    for (key, at, name, value) in [
        ("size", 0, "Width", width),
        ("size", 1, "Height", height),
        ("offset", 0, "OffsetX", x),
        ("offset", 1, "OffsetY", y),
    ] {
        let range = limits(camera, name);
        if let Some(range) = range.filter(|range| !allows(*range, value as f64)) {
            return Err(camera_fault(
                format!("camera.{key}[{at}] is {value}, but {name} of the camera {place} is {}", told(range)),
                match key {
                    "size" => "correct size in [camera]",
                    _ => "correct offset in [camera], or give a smaller size",
                },
            ));
        }
        // A camera without offsets always reads from its first pixel.
        if key == "offset" && value == 0 && camera.feature_state(name).is_err() {
            continue;
        }
        camera
            .set_integer(name, value as i64)
            .map_err(|why| said(place, &format!("set {name} to {value}"), &why))?;
    }
    Ok(())
}

fn set_gain<T: RegisterIo>(camera: &mut Camera<T>, place: &str, gain: f64) -> Result<()> {
    let failed = |why: GenicamError| said(place, &format!("set a gain of {gain}"), &why);
    let name = camera.resolve(StandardFeature::Gain).map_err(failed)?.name;
    if let Some(range) = limits(camera, name).filter(|range| !(range.min..=range.max).contains(&gain)) {
        return Err(camera_fault(
            format!("camera.gain is {gain}, but {name} of the camera {place} is {}", told(range)),
            "correct gain in [camera]",
        ));
    }
    camera.set_gain(gain).map_err(failed)?;
    let set = camera.gain().map_err(failed)?;
    if (set - gain).abs() > GAIN_TOLERANCE {
        return Err(camera_fault(
            format!("asked for a gain of {gain}, the camera {place} has set {set}"),
            format!("write gain = {set} in [camera]"),
        ));
    }
    Ok(())
}

fn check_exposures<T: RegisterIo>(camera: &Camera<T>, settings: &Settings, place: &str) -> Result<()> {
    let known = ["ExposureTime", "ExposureTimeAbs"];
    if known.iter().all(|name| camera.feature_state(name).is_err()) {
        return Err(camera_fault(
            format!("the camera {place} does not say its exposure in microseconds"),
            "use a camera with the feature ExposureTime",
        ));
    }
    let Some(range) = known.iter().find_map(|name| limits(camera, name)) else { return Ok(()) };
    let [least, most] = [range.min, range.max];
    let [shortest, longest] = settings.exposures;
    // Many cameras round to whole microseconds.
    if 1e6 * shortest < least - 1.0 || 1e6 * longest > most + 1.0 {
        return Err(camera_fault(
            format!(
                "the camera {place} does exposures from {} to {} s, but the rig file says {shortest} to {longest} s",
                least / 1e6,
                most / 1e6
            ),
            "correct exposures in [camera]",
        ));
    }
    Ok(())
}

/// Sets the exposure in seconds, and returns the exposure that was really set.
pub(crate) fn set_exposure<T: RegisterIo>(camera: &mut Camera<T>, place: &str, exposure: f64) -> Result<f64> {
    let failed = |why: GenicamError| said(place, &format!("set an exposure of {exposure} s"), &why);
    camera.set_exposure_time(1e6 * exposure).map_err(failed)?;
    let set = camera.exposure_time().map_err(failed)?;
    Ok(set / 1e6)
}

/// The range of values that a feature may have now, if the camera reports it.
fn limits<T: RegisterIo>(camera: &Camera<T>, name: &str) -> Option<ValueRange> {
    camera.feature_state(name).ok()?.range
}

fn allows(range: ValueRange, value: f64) -> bool {
    // Both values are integers that `f64` represents exactly.
    let is_step = range.inc.is_none_or(|step| step <= 0.0 || (value - range.min).rem_euclid(step) == 0.0);
    (range.min..=range.max).contains(&value) && is_step
}

/// A range in words, for example `4 to 48 in steps of 4`.
fn told(range: ValueRange) -> String {
    let steps = range.inc.filter(|step| *step > 1.0);
    let steps = steps.map_or_else(String::new, |step| format!(" in steps of {step}"));
    format!("{} to {}{steps}", range.min, range.max)
}

pub(crate) fn said(place: &str, doing: &str, why: &GenicamError) -> Error {
    if is_busy(why) || matches!(why, GenicamError::NotInControl(_)) {
        return in_use(place);
    }
    camera_fault(
        format!("the camera {place} did not {doing}: {why}"),
        "check its cable and power, and that no other program uses it",
    )
}

/// The abilities of a machine vision camera, as far as the camera states them.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Abilities {
    /// Width and height of the sensor, in pixels.
    pub sensor: Option<[usize; 2]>,
    /// The camera's names for its pixel formats.
    pub pixel_formats: Vec<String>,
    /// The shortest and the longest exposure, in seconds.
    pub exposures: Option<[f64; 2]>,
    /// The lowest and the highest gain, in the camera's own unit.
    pub gains: Option<[f64; 2]>,
}

impl Abilities {
    pub(crate) fn of<T: RegisterIo>(camera: &Camera<T>) -> Self {
        let range = |names: &[&str]| {
            let mut states = names.iter().filter_map(|name| camera.feature_state(name).ok());
            states.find_map(|state| state.range).map(|range| [range.min, range.max])
        };
        let whole = |names: &[&str]| {
            let number = names.iter().find_map(|name| camera.get_integer(name).ok());
            number.and_then(|number| usize::try_from(number).ok()).filter(|&number| number > 0)
        };
        // Width and height may describe a part of the sensor, but their maximum describes the whole sensor.
        let sides = [whole(&["WidthMax", "SensorWidth"]), whole(&["HeightMax", "SensorHeight"])];
        Self {
            sensor: sides[0].zip(sides[1]).map(|(width, height)| [width, height]),
            pixel_formats: camera
                .feature_state("PixelFormat")
                .ok()
                .and_then(|state| state.enum_entries)
                .unwrap_or_default(),
            // The camera's exposures are in microseconds.
            exposures: range(&["ExposureTime", "ExposureTimeAbs"]).map(|range| range.map(|time| time / 1e6)),
            gains: range(&["Gain"]),
        }
    }
}

impl std::fmt::Display for Abilities {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let between =
            |what: &str, [least, most]: [f64; 2], unit: &str| format!("{what} {least} to {most}{unit}");
        let parts = [
            self.sensor.map(|[width, height]| format!("{width}x{height} pixels")),
            Some(self.pixel_formats.join(", ")).filter(|formats| !formats.is_empty()),
            self.exposures.map(|range| between("exposures", range, " s")),
            self.gains.map(|range| between("gain", range, "")),
        ];
        f.write_str(&parts.into_iter().flatten().collect::<Vec<_>>().join("; "))
    }
}

/// The longest time for reading a camera's description, which usually takes about a second.
const PATIENCE: Duration = Duration::from_secs(15);
/// The address space, in KiB, of the process that reads a description. A description has a few MiB.
const ADDRESS_SPACE: u64 = 1 << 20;
/// The largest answer of that process in bytes.
const MAX_ANSWER: u64 = 1 << 20;

/// Reads a camera's abilities in a process of `helper`. Returns [`Error::Rig`] when the camera does not answer, or when its description
/// cannot be read in bounded time and memory.
pub(crate) fn ask(helper: &Helper, kind: &str, place: Option<&str>) -> Result<Abilities> {
    let name =
        place.map_or_else(|| format!("the {kind} camera"), |place| format!("the {kind} camera {place}"));
    let fault = |what: String| {
        let help = "it is not opened: a description that is damaged or hostile could end the program, or hold it up; \
                    check the camera's cable and firmware, and that it is the camera that you mean";
        camera_fault(format!("{name}: {what}"), help)
    };
    let started = reader(helper, kind, place).spawn();
    let mut child = started.map_err(|why| fault(format!("no process can read its description: {why}")))?;
    let ended = wait(&mut child, PATIENCE);
    let (mut said, mut complaint) = (String::new(), String::new());
    if let (Some(stdout), Some(stderr)) = (child.stdout.take(), child.stderr.take()) {
        // Unreadable bytes are missing from the answer, which then cannot be parsed.
        let _ = stdout.take(MAX_ANSWER).read_to_string(&mut said);
        let _ = stderr.take(MAX_ANSWER).read_to_string(&mut complaint);
    }
    match ended {
        Some(status) if status.success() => {
            serde_json::from_str(&said).map_err(|why| fault(format!("its description gave no answer: {why}")))
        }
        Some(status) => Err(match serde_json::from_str::<Value>(&complaint) {
            // The process found this fault, which already names the camera.
            Ok(error) => {
                let [what, help] = ["error", "help"].map(|key| error[key].as_str().unwrap_or_default());
                camera_fault(what.trim_start_matches("camera: "), help)
            }
            Err(_) => fault(format!(
                "its description ended the process that read it ({status}), as a damaged or hostile one does"
            )),
        }),
        None => Err(fault(format!("its description was not read within {} s", PATIENCE.as_secs()))),
    }
}

fn reader(helper: &Helper, kind: &str, place: Option<&str>) -> Command {
    let program = &helper.program;
    let mut command = if cfg!(unix) {
        let mut shell = Command::new("sh");
        shell
            .args(["-c", &format!("ulimit -v {ADDRESS_SPACE}; ulimit -c 0; exec \"$0\" \"$@\"")])
            .arg(program);
        shell
    } else {
        Command::new(program)
    };
    command.args(["--json", "describe-camera", kind]).args(place);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}
