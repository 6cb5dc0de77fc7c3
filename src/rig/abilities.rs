//! The abilities of a machine vision camera, which a separate process reads.

use std::io::Read;
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use super::gphoto2::body::wait;
use super::{CameraKind, Helper, camera_fault};
use crate::error::Result;

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
/// The address space, in KiB, of the process that reads a description. A description has a few MiB.
const ADDRESS_SPACE: u64 = 1 << 20;
/// The largest answer of that process in bytes.
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
