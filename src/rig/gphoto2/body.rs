//! The setup of a still camera: settings are written and read back. This module also runs the necessary programs with a time limit.

use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use serde_json::json;
use tempfile::TempDir;

use crate::error::{Error, Result};
use crate::rig::gphoto2::Gphoto2Spec;
use crate::rig::gphoto2::answers::{FoundStillCamera, Setting, cameras, names, seconds, setting};
use crate::rig::hardware::{in_use, is_busy};
use crate::rig::{AttachedCamera, CameraKind, camera_fault, did_you_mean};

const ANSWER: Duration = Duration::from_secs(20);

/// The possible names of the setting for the shutter speed. The first name is preferred, because its values are fractions.
const SHUTTER: [&str; 2] = ["shutterspeed2", "shutterspeed"];

/// The setting for the place of photos until they are downloaded, and the chosen value. A memory card would take longer than this memory.
const TARGET: [&str; 2] = ["capturetarget", "Internal RAM"];

/// Lists the still cameras that `gphoto2` finds.
pub(crate) fn still_cameras() -> Result<Vec<AttachedCamera>> {
    let camera = |FoundStillCamera { model, port }: FoundStillCamera| {
        let line = format!("\"{model}\", at {port}");
        let facts = json!({ "model": model, "port": port });
        AttachedCamera::new(CameraKind::Gphoto2, Some(port), line, facts)
    };
    let found = cameras(&run("gphoto2", &["--auto-detect".into()], None, ANSWER)?.answer);
    Ok(found.into_iter().map(camera).collect())
}

/// Finds the camera and sets everything except the shutter speed. Returns the camera, and the name and the setting of the shutter speed.
pub(crate) fn prepare(spec: &Gphoto2Spec) -> Result<(Body, (String, Setting))> {
    let found = run(&spec.program, &["--auto-detect".into()], None, ANSWER)?;
    let body = Body { program: spec.program.clone(), port: choose(&found, spec.model.as_deref())? };
    let known = names(&body.run(&["--list-config"], ANSWER)?.answer);
    let has = |name: &str| known.iter().any(|known| known == name);
    if has(TARGET[0]) && !spec.settings.contains_key(TARGET[0]) && body.get(TARGET[0])?.offers(TARGET[1]) {
        body.put(TARGET[0], TARGET[1])?;
    }
    for (names, value) in spec.wanted() {
        let name = named(&names, &known)?;
        let setting = body.get(name)?;
        if setting.current == value {
            continue;
        }
        check(name, &setting, value)?;
        body.put(name, value)?;
    }
    let name = named(&SHUTTER, &known)?;
    let setting = body.get(name)?;
    if setting.is_read_only || !setting.choices.iter().any(|choice| seconds(choice, None).is_some()) {
        return Err(camera_fault(
            format!("the shutter speed ({name}) cannot be set: it is {}", setting.current),
            "turn the camera's mode dial to M",
        ));
    }
    Ok((body, (name.to_owned(), setting)))
}

/// Chooses the camera of this model, or the only camera, and returns its port.
fn choose(ran: &Ran, model: Option<&str>) -> Result<String> {
    let found = cameras(&ran.answer);
    let told = |found: &[FoundStillCamera]| {
        let models: Vec<&str> = found.iter().map(|camera| camera.model.as_str()).collect();
        models.join(", ")
    };
    if found.is_empty() {
        return Err(camera_fault(
            format!("gphoto2 finds no camera: {}", ran.said),
            "check that it is on, its cable, and that it is in a mode for computers (PTP)",
        ));
    }
    let fits: Vec<&FoundStillCamera> =
        found.iter().filter(|camera| model.is_none_or(|model| camera.model == model)).collect();
    match (fits.as_slice(), model) {
        ([camera], _) => Ok(camera.port.clone()),
        ([], model) => Err(camera_fault(
            format!("gphoto2 finds no camera \"{}\"", model.unwrap_or_default()),
            format!("it finds {}: correct model in [camera]", told(&found)),
        )),
        _ => Err(camera_fault(
            format!("gphoto2 finds {} cameras: {}", fits.len(), told(&found)),
            "give the model of one in [camera], or switch the other off",
        )),
    }
}

fn named<'a>(names: &[&'a str], known: &[String]) -> Result<&'a str> {
    names.iter().find(|name| known.iter().any(|known| known == *name)).copied().ok_or_else(|| {
        let meant = names.first().map_or_else(String::new, |name| did_you_mean(name, known, ""));
        camera_fault(
            format!("the camera has no setting {}{meant}", names.join(" or ")),
            "`gphoto2 --list-config` names those it has; some are there in mode M only, or with another lens",
        )
    })
}

fn check(name: &str, setting: &Setting, value: &str) -> Result<()> {
    if setting.is_read_only {
        return Err(camera_fault(
            format!("{name} cannot be set to {value}: it is {}, and fixed", setting.current),
            "turn the camera's mode dial to M, and its lens to the aperture ring's computer setting",
        ));
    }
    if setting.offers(value) {
        return Ok(());
    }
    let known = &setting.choices;
    let meant = did_you_mean(value, known, "");
    Err(camera_fault(
        format!("{name} has no choice \"{value}\"{meant}"),
        format!("correct it in [camera]; the camera's choices are {}", known.join(", ")),
    ))
}

impl Setting {
    fn offers(&self, value: &str) -> bool {
        self.choices.is_empty() || self.choices.iter().any(|choice| choice == value)
    }
}

/// A camera that `program` reaches at `port`.
pub(crate) struct Body {
    program: String,
    port: String,
}

impl Body {
    pub(crate) fn run(&self, arguments: &[&str], limit: Duration) -> Result<Ran> {
        let arguments = ["--port", &self.port].into_iter().chain(arguments.iter().copied());
        run(&self.program, &arguments.map(String::from).collect::<Vec<_>>(), None, limit)
    }

    fn get(&self, name: &str) -> Result<Setting> {
        let ran = self.run(&["--get-config", name], ANSWER)?;
        setting(&ran.answer).ok_or_else(|| unreadable(name, &ran))
    }

    pub(crate) fn put(&self, name: &str, value: &str) -> Result<()> {
        let assigned = format!("{name}={value}");
        let ran = self.run(&["--set-config-value", &assigned, "--get-config", name], ANSWER)?;
        let now = setting(&ran.answer).ok_or_else(|| unreadable(name, &ran))?.current;
        if now == value {
            return Ok(());
        }
        Err(camera_fault(
            format!("{name} was set to {value}, but is {now}"),
            "turn the camera's mode dial to M; some choices exclude each other",
        ))
    }
}

fn unreadable(name: &str, ran: &Ran) -> Error {
    camera_fault(
        format!("gphoto2 did not tell {name}: {}", ran.said),
        "check by hand what `gphoto2 --get-config` prints for it",
    )
}

const LOOK: Duration = Duration::from_millis(2);

const REPEATED: usize = 300;

pub(crate) struct Ran {
    pub(crate) folder: TempDir,
    pub(crate) answer: Vec<u8>,
    /// The end of the program's standard error on one line, or the end of its standard output if standard error is empty.
    pub(crate) said: String,
}

/// Runs a program in a new temporary folder, or in the folder `before` of an earlier run. Returns [`Error::Rig`] when the program is not
/// installed, fails, or takes longer than `limit`. A program that reaches the limit is killed.
pub(crate) fn run(
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
    // The output goes to files. Unlike pipes, files need no reader, and the program's children cannot hold them open.
    let [answer, said] = ["answer", "said"].map(|name| logs.path().join(name));
    let mut command = Command::new(program);
    command.args(arguments).current_dir(folder.path()).env("LC_ALL", "C").stdin(Stdio::null());
    command.stdout(File::create(&answer).map_err(failed)?).stderr(File::create(&said).map_err(failed)?);
    // An interrupt in the terminal does not reach a separate process group, so a photo that has begun is finished.
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

/// Waits for a program to end. `None`: the program did not end in time and was killed.
pub(crate) fn wait(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let began = Instant::now();
    while began.elapsed() < limit {
        if let Ok(Some(status)) = child.try_wait() {
            return Some(status);
        }
        std::thread::sleep(LOOK);
    }
    // Killing fails if the program has just ended, which is harmless.
    let _ = child.kill();
    let _ = child.wait();
    None
}

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

pub(crate) fn last(answer: &[u8]) -> String {
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
