//! The setup of a still camera: it is found, and its settings are read, set and read back.

use std::time::Duration;

use super::answers::{FoundStillCamera, Setting, cameras, names, setting};
use super::program::{Ran, run};
use super::spec::Gphoto2Spec;
use super::speed::seconds;
use crate::error::{Error, Result};
use crate::rig::camera_fault;
use crate::rig::nearest::nearest;

/// How long `gphoto2` may take to answer a request.
const ANSWER: Duration = Duration::from_secs(20);

/// The names of the setting of the shutter speed, the preferred one first: `shutterspeed2` has fractions.
const SHUTTER: [&str; 2] = ["shutterspeed2", "shutterspeed"];

/// The setting where photos are kept until they are downloaded, and its value: through the memory card it would take longer.
const TARGET: [&str; 2] = ["capturetarget", "Internal RAM"];

/// Lists the still cameras that `gphoto2` finds.
///
/// # Errors
/// [`Error::Rig`] when the program is not installed, fails, or hangs.
pub fn still_cameras() -> Result<Vec<FoundStillCamera>> {
    Ok(cameras(&run("gphoto2", &["--auto-detect".into()], None, ANSWER)?.answer))
}

/// Finds the camera and sets everything except the shutter speed, whose name and setting it returns.
pub(super) fn prepare(spec: &Gphoto2Spec) -> Result<(Body, (String, Setting))> {
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

/// Chooses the camera of this model, or the only camera; returns its port.
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

/// The first of `names` that the camera knows.
fn named<'a>(names: &[&'a str], known: &[String]) -> Result<&'a str> {
    names.iter().find(|name| known.iter().any(|known| known == *name)).copied().ok_or_else(|| {
        let listed: Vec<&str> = known.iter().map(String::as_str).collect();
        let meant = names.first().and_then(|name| nearest(name, &listed));
        let meant = meant.map_or_else(String::new, |name| format!("; did you mean {name}?"));
        camera_fault(
            format!("the camera has no setting {}{meant}", names.join(" or ")),
            "`gphoto2 --list-config` names those it has; some are there in mode M only, or with another lens",
        )
    })
}

/// Checks that a setting can have this value.
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
    let known: Vec<&str> = setting.choices.iter().map(String::as_str).collect();
    let meant = nearest(value, &known).map_or_else(String::new, |choice| format!("; did you mean {choice}?"));
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

/// A camera, which `program` reaches at `port`.
pub(super) struct Body {
    program: String,
    port: String,
}

impl Body {
    /// Runs the program on this camera's port.
    pub(super) fn run(&self, arguments: &[&str], limit: Duration) -> Result<Ran> {
        let arguments = ["--port", &self.port].into_iter().chain(arguments.iter().copied());
        run(&self.program, &arguments.map(String::from).collect::<Vec<_>>(), None, limit)
    }

    /// Reads a setting.
    fn get(&self, name: &str) -> Result<Setting> {
        let ran = self.run(&["--get-config", name], ANSWER)?;
        setting(&ran.answer).ok_or_else(|| unreadable(name, &ran))
    }

    /// Sets a setting, and checks it by reading it back.
    pub(super) fn put(&self, name: &str, value: &str) -> Result<()> {
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
