//! Finds the devices that are attached to this computer or named in a rig file, and reads the abilities of cameras in a separate process.

use std::io::Read;
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};

use super::gphoto2::body::wait;
use super::{CameraKind, CameraSpec, GenicamSpec, HardwareRig, Helper, MonitorInfo, camera_fault, monitors};
use crate::error::{Error, Result};

/// The devices that were found.
#[derive(Clone, Debug)]
pub struct AttachedDevices {
    /// The monitors of the X server, in its order.
    pub monitors: Vec<MonitorInfo>,
    /// The cameras of every kind that this program supports.
    pub cameras: Vec<AttachedCamera>,
}

/// A camera that was found.
#[derive(Clone, Debug)]
pub struct AttachedCamera {
    kind: CameraKind,
    /// The camera's address, serial number, device file or port.
    place: Option<String>,
    /// The lines to print: first kind, address and name, then the abilities.
    pub lines: Vec<String>,
    /// The reason why the camera's abilities are unknown although they were requested.
    pub unknown: Option<String>,
    /// The data of `lines` as a JSON object: `kind` as in a rig file, the identity of the camera, and `abilities` if they are known.
    pub described: Value,
}

impl AttachedDevices {
    /// Searches for monitors and cameras. `of_file` has the devices of a rig file. `display` names the X server; the default is the server
    /// in `of_file`, or otherwise in DISPLAY. The camera of `of_file` is asked for its abilities. With `all`, every camera is asked. A
    /// process of the helper program ([`Helper::find`](super::Helper::find)) reads each camera's description. If a search fails, `note`
    /// receives the error, and the other searches continue.
    pub fn find(
        display: Option<&str>,
        of_file: Option<&HardwareRig>,
        all: bool,
        note: &mut dyn FnMut(&Error),
    ) -> Self {
        let display = display.or(of_file.and_then(|rig| rig.projector.display.as_deref()));
        // A computer without a screen may still have cameras.
        let monitors = monitors(display).unwrap_or_else(|why| {
            note(&why);
            Vec::new()
        });
        let of_file = match of_file.map(|rig| &rig.camera) {
            Some(CameraSpec::Genicam(spec)) => Some(spec),
            _ => None,
        };
        let kinds = [
            #[cfg(feature = "gige")]
            super::gige::cameras(of_file.and_then(|spec| spec.address)),
            #[cfg(not(feature = "gige"))]
            Err(CameraKind::Gige.not_built()),
            #[cfg(feature = "usb3")]
            super::usb3::usb_cameras(),
            #[cfg(not(feature = "usb3"))]
            Err(CameraKind::Usb3.not_built()),
            #[cfg(feature = "v4l")]
            Ok(super::v4l::video_devices()),
            #[cfg(not(feature = "v4l"))]
            Err(CameraKind::V4l.not_built()),
            super::gphoto2::body::still_cameras(),
        ];
        let mut cameras = Vec::new();
        for kind in kinds {
            match kind {
                Ok(found) => cameras.extend(found),
                Err(why) => note(&why),
            }
        }
        for camera in &mut cameras {
            if all || of_file.is_some_and(|spec| camera.is_of(spec)) {
                camera.ask_abilities();
            }
        }
        Self { monitors, cameras }
    }
}

impl AttachedCamera {
    /// A camera of this kind. `place` is the camera's address, serial number, device file or port. `line` and `facts` begin with this
    /// place.
    pub(crate) fn new(kind: CameraKind, place: Option<String>, line: String, facts: Value) -> Self {
        let lines = vec![format!("{} {line}", kind.key())];
        let mut found = Self { kind, place, lines, unknown: None, described: facts };
        found.add("kind", kind.key().into());
        found
    }

    /// Whether a rig file describes this camera.
    fn is_of(&self, spec: &GenicamSpec) -> bool {
        let place = spec.address_or_serial();
        self.kind == spec.kind && (place.is_none() || self.place == place)
    }

    /// Reads the abilities of a machine vision camera and adds them. Other cameras are left unchanged.
    fn ask_abilities(&mut self) {
        if !matches!(self.kind, CameraKind::Gige | CameraKind::Usb3) {
            return;
        }
        match Helper::find().and_then(|helper| ask(&helper, self.kind, self.place.as_deref())) {
            Ok(abilities) => {
                self.lines.push(abilities.to_string());
                self.add("abilities", json!(abilities));
            }
            Err(why) => self.unknown = Some(why.to_string()),
        }
    }

    fn add(&mut self, key: &str, value: Value) {
        if let Some(fields) = self.described.as_object_mut() {
            fields.insert(key.into(), value);
        }
    }
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
/// The largest address space, in KiB, of the process that reads a description. A description has a few MiB.
const ADDRESS_SPACE: u64 = 1 << 20;
/// The largest answer, in bytes, of the process that reads a description.
const MAX_ANSWER: u64 = 1 << 20;

/// Reads a camera's abilities in a process of `helper`. Returns [`Error::Rig`] when the camera does not answer, or when its description
/// cannot be read in bounded time and memory.
pub(crate) fn ask(helper: &Helper, kind: CameraKind, place: Option<&str>) -> Result<Abilities> {
    let name = ["the", kind.key(), "camera"].into_iter().chain(place).collect::<Vec<_>>().join(" ");
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
            // This error comes from the process, and already names the camera.
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

fn reader(helper: &Helper, kind: CameraKind, place: Option<&str>) -> Command {
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
    command.args(["--json", "describe-camera", kind.key()]).args(place);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}
