//! Running other programs with a time limit.

use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::error::{Error, Result};
use crate::rig::busy::{in_use, is_busy};
use crate::rig::camera_fault;

/// The time between two looks whether a program has ended.
const LOOK: Duration = Duration::from_millis(2);

/// The number of characters of a program's output that an error quotes.
const REPEATED: usize = 300;

/// The output of a program, and the folder in which it ran.
pub(super) struct Ran {
    pub(super) folder: TempDir,
    /// Its standard output.
    pub(super) answer: Vec<u8>,
    /// The end of its standard error, or of its standard output if that is empty, on one line.
    pub(super) said: String,
}

/// Runs a program in a fresh temporary folder, or in the folder `before` of an earlier run.
///
/// # Errors
/// [`Error::Rig`] when it is not installed, fails, or takes longer than `limit`, in which case it is killed.
pub(super) fn run(
    program: &str,
    arguments: &[String],
    before: Option<TempDir>,
    limit: Duration,
) -> Result<Ran> {
    let failed = |why: std::io::Error| {
        camera_fault(
            format!("no temporary files can be made for {program}: {why}"),
            "make room in the temporary folder, or set TMPDIR to another one",
        )
    };
    let logs = tempfile::Builder::new().prefix("krylux-").tempdir().map_err(failed)?;
    let folder = match before {
        Some(folder) => folder,
        None => tempfile::Builder::new().prefix("krylux-").tempdir().map_err(failed)?,
    };
    // Files instead of pipes: nothing has to read them while the program runs, and its own children cannot keep them open.
    let [answer, said] = ["answer", "said"].map(|name| logs.path().join(name));
    let mut command = Command::new(program);
    command.args(arguments).current_dir(folder.path()).env("LC_ALL", "C").stdin(Stdio::null());
    command.stdout(File::create(&answer).map_err(failed)?).stderr(File::create(&said).map_err(failed)?);
    // In a separate process group, so that the terminal's interrupt does not reach it: a photo that has begun is finished.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    let mut child = command.spawn().map_err(|why| missing(program, &why))?;
    let ended = wait(&mut child, limit);
    let answer = std::fs::read(&answer).map_err(failed)?;
    let complaint = std::fs::read(&said).map_err(failed)?;
    let said = last(if complaint.trim_ascii().is_empty() { &answer } else { &complaint });
    match ended {
        Some(status) if status.success() => Ok(Ran { folder, answer, said }),
        Some(_) if is_busy(&std::io::Error::other(said.clone())) => Err(in_use("that gphoto2 finds")),
        Some(status) => Err(camera_fault(
            format!("{program} failed ({status}): {said}"),
            "check the camera's cable, power and mode dial (M), and that no other program uses it (a desktop may \
             have mounted it: eject it there)",
        )),
        None => Err(camera_fault(
            format!("{program} did not end within {:.1} s, and was ended: {said}", limit.as_secs_f64()),
            "switch the camera off and on, or give a longer timeout in [camera]",
        )),
    }
}

/// Waits for a program to end. `None`: it did not end in time, and was killed.
fn wait(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let began = Instant::now();
    while began.elapsed() < limit {
        if let Ok(Some(status)) = child.try_wait() {
            return Some(status);
        }
        std::thread::sleep(LOOK);
    }
    // Killing fails if the program has just ended, which does not matter.
    let _ = child.kill();
    let _ = child.wait();
    None
}

/// The error where a program cannot be started.
fn missing(program: &str, why: &std::io::Error) -> Error {
    let name = Path::new(program).file_name().map_or(program.into(), |name| name.to_string_lossy());
    let package = match &*name {
        "unprocessed_raw" | "dcraw_emu" => "libraw-bin",
        name => name,
    };
    if why.kind() == ErrorKind::NotFound {
        return camera_fault(
            format!("the program {program} is not installed"),
            format!("install it (Debian: apt install {package})"),
        );
    }
    camera_fault(format!("the program {program} cannot be run: {why}"), "check its file's permissions")
}

/// The end of a program's output, on one line.
pub(super) fn last(answer: &[u8]) -> String {
    let text = String::from_utf8_lossy(answer);
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let line = lines.join("; ").replace(|letter: char| letter.is_control(), "?");
    let letters = line.chars().count();
    match letters {
        0 => "it said nothing".into(),
        _ if letters > REPEATED => format!("… {}", line.chars().skip(letters - REPEATED).collect::<String>()),
        _ => line,
    }
}
