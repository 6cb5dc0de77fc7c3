//! What a camera can do, as it says itself. Its description is a stranger's program in XML: a separate process reads it, in bounded time and
//! memory, and may fail without the list of the other cameras, or the session that would open it.

use std::io::Read;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::{Abilities, Helper, camera_fault};
use crate::error::Result;

/// How long a camera's description may take. Reading one takes about a second.
const PATIENCE: Duration = Duration::from_secs(15);
/// The address space of the process that reads a description, in KiB. Descriptions have a few MiB.
const ADDRESS_SPACE: u64 = 1 << 20;
/// The largest answer of that process in bytes.
const MAX_ANSWER: u64 = 1 << 20;

/// Asks a camera what it can do, in a process of `helper`.
///
/// # Errors
/// [`Error::Rig`](crate::Error::Rig) when it does not answer, or when its description cannot be read in bounded time and memory.
pub(super) fn ask(helper: &Helper, kind: &str, place: Option<&str>) -> Result<Abilities> {
    let name =
        place.map_or_else(|| format!("the {kind} camera"), |place| format!("the {kind} camera {place}"));
    let fault = |what: String| {
        let help = "it is not opened: a description that is damaged or hostile could end the program, or hold it up; \
                    check the camera's cable and firmware, and that it is the camera that you mean";
        camera_fault(format!("{name}: {what}"), help)
    };
    let started = reader(helper, kind, place).spawn();
    let mut child = started.map_err(|why| fault(format!("no process can read its description: {why}")))?;
    let ended = wait(&mut child);
    let (mut said, mut complaint) = (String::new(), String::new());
    if let (Some(stdout), Some(stderr)) = (child.stdout.take(), child.stderr.take()) {
        // What cannot be read is missing from the answer, which then is none.
        let _ = stdout.take(MAX_ANSWER).read_to_string(&mut said);
        let _ = stderr.take(MAX_ANSWER).read_to_string(&mut complaint);
    }
    match ended {
        Some(status) if status.success() => {
            serde_json::from_str(&said).map_err(|why| fault(format!("its description gave no answer: {why}")))
        }
        Some(status) => Err(match serde_json::from_str::<Value>(&complaint) {
            // What the process found wrong; it names the camera itself.
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

/// The process that reads the description of a camera.
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

/// Waits for a process to end; `None`: it took too long, and was ended.
fn wait(child: &mut Child) -> Option<ExitStatus> {
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        if let Ok(Some(status)) = child.try_wait() {
            return Some(status);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    // Killing fails if it has just ended, which does not matter.
    let _ = child.kill();
    let _ = child.wait();
    None
}
