//! The helper program is the `krylux` program that owns a projector's window.
//!
//! The window lives in a separate process. A crash or a hang of the X connection, or an interrupt in the terminal, therefore does not end
//! the measurement. The process is always the `krylux` program, started as `krylux projector`. A program other than krylux never starts
//! itself as the helper: such a program names the `krylux` program, or [`Helper::find`] searches for it.

use std::ffi::OsString;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

use super::fault;
use super::projector::{self, Reply, Request, ShowTimes};
#[cfg(feature = "x11")]
use super::screen::Screen;
use crate::error::{Error, Result};
#[cfg(feature = "x11")]
use crate::rig::Frame;

/// The running program, if it is krylux.
static DECLARED: OnceLock<PathBuf> = OnceLock::new();

/// The program and the longest wait of a helper process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Helper {
    /// The `krylux` program.
    pub program: PathBuf,
    /// The longest wait for an answer, 15 s by default. This wait must exceed the helper's own wait of 5 s for the X server, so that the
    /// helper can report a failure.
    pub patience: Duration,
}

impl Helper {
    /// The environment variable that names the `krylux` program for [`Helper::find`].
    pub const VARIABLE: &str = "KRYLUX_HELPER";

    /// The `krylux` program at this path. A wrong path is reported only when a projector is opened.
    pub fn at(program: impl Into<PathBuf>) -> Self {
        Self { program: program.into(), patience: Duration::from_secs(15) }
    }

    /// Finds the `krylux` program. These places are tried in order:
    ///
    /// 1. the file in the environment variable [`KRYLUX_HELPER`](Self::VARIABLE);
    /// 2. the running program, if it called [`Helper::declare_this_program`];
    /// 3. a file `krylux` in the folder of the running program;
    /// 4. a file `krylux` in a folder of `PATH`.
    ///
    /// # Errors
    /// [`Error::Rig`] when there is no such program, or when the variable does not name a file.
    pub fn find() -> Result<Self> {
        let running = std::env::current_exe().ok();
        Places {
            variable: std::env::var_os(Self::VARIABLE).filter(|named| !named.is_empty()),
            declared: DECLARED.get().map(PathBuf::as_path),
            running: running.as_deref(),
            path: std::env::var_os("PATH").unwrap_or_default(),
        }
        .find()
        .map(Self::at)
    }

    /// Declares that the running program is krylux, so that it calls [`serve_projector`] when started with the single argument `projector`.
    /// Only such a program may call this function, at the start of its `main`.
    pub fn declare_this_program() {
        if let Ok(program) = std::env::current_exe() {
            // A second declaration has the same value.
            let _ = DECLARED.set(program);
        }
    }
}

struct Places<'a> {
    variable: Option<OsString>,
    declared: Option<&'a Path>,
    running: Option<&'a Path>,
    path: OsString,
}

impl Places<'_> {
    fn find(&self) -> Result<PathBuf> {
        if let Some(named) = &self.variable {
            let program = PathBuf::from(named);
            let names = Helper::VARIABLE;
            let what =
                format!("the environment variable {names} names the helper program \"{}\"", named.display());
            let help = "set it to the path of the krylux program, or unset it";
            return if program.is_file() {
                Ok(program)
            } else {
                Err(fault(format!("{what}, which is not a file"), help))
            };
        }
        if let Some(program) = self.declared {
            return Ok(program.to_owned());
        }
        let name = format!("krylux{}", std::env::consts::EXE_SUFFIX);
        let beside = self.running.and_then(Path::parent).map(Path::to_owned);
        let mut candidates =
            beside.into_iter().chain(std::env::split_paths(&self.path)).map(|folder| folder.join(&name));
        candidates
            .find(|program| program.is_file() && !self.is_running(program))
            .ok_or_else(|| self.none(&name))
    }

    /// Whether `program` is the running program, which must not start itself, because it has not declared that it is krylux.
    fn is_running(&self, program: &Path) -> bool {
        let real = |path: &Path| path.canonicalize().ok();
        self.running.and_then(real).is_some_and(|running| real(program) == Some(running))
    }

    fn none(&self, name: &str) -> Error {
        let beside = self.running.and_then(Path::parent).map(|folder| format!("{} and ", folder.display()));
        fault(
            format!(
                "no helper program was found: a file \"{name}\" was looked for in {}the folders of PATH, the environment \
                 variable {} is not set, and the running program is not krylux",
                beside.unwrap_or_default(),
                Helper::VARIABLE
            ),
            format!(
                "install krylux (`cargo install krylux`), set {} to its program, or give its path by Helper::at",
                Helper::VARIABLE
            ),
        )
    }
}

/// Reads requests from `from` and writes replies to `to` until `from` ends. Then the window closes. The helper process does nothing else.
///
/// # Errors
/// An error of reading or writing the pipe. Errors of the projector are sent as replies.
pub fn serve_projector(mut from: impl Read, mut to: impl Write) -> std::io::Result<()> {
    let mut screen = None;
    while let Some((request, payload)) = projector::receive(&mut from)? {
        let reply: Reply = answer(&mut screen, request, &payload).map_err(|error| match error {
            Error::Rig { fault, help, .. } => [fault, help],
            other => [other.to_string(), "report this".into()],
        });
        projector::send(&mut to, &reply, &[])?;
    }
    Ok(())
}

#[cfg(feature = "x11")]
fn answer(screen: &mut Option<Screen>, request: Request, payload: &[u8]) -> Result<ShowTimes> {
    match (request, screen) {
        (Request::Open(spec), screen) => {
            // The old window is closed before a new window opens.
            *screen = None;
            *screen = Some(Screen::open(&spec)?);
            Ok(ShowTimes::default())
        }
        (Request::Show { resolution, channels }, Some(screen)) => {
            let levels = payload.iter().map(|&level| u16::from(level)).collect();
            screen.show(&Frame::new(resolution, channels, levels)?)
        }
        (Request::Confirm, Some(screen)) => screen.confirm().map(|()| ShowTimes::default()),
        (Request::Show { .. } | Request::Confirm, None) => {
            Err(fault("its window was never opened", "open it first"))
        }
    }
}

/// Without the feature `x11` there is no window.
#[cfg(not(feature = "x11"))]
fn answer(_: &mut Option<()>, _: Request, _: &[u8]) -> Result<ShowTimes> {
    Err(super::not_built())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder_with_krylux() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().expect("a folder can be made");
        let program = folder.path().join(format!("krylux{}", std::env::consts::EXE_SUFFIX));
        std::fs::write(&program, []).expect("a file can be written");
        (folder, program)
    }

    #[test]
    fn the_variable_comes_before_the_declared_program_before_the_folder_before_path() {
        let [named, beside, on_path] = [(); 3].map(|()| folder_with_krylux());
        let running = beside.0.path().join("notebook");
        let declared = Path::new("/declared/krylux");
        let mut places = Places {
            variable: Some(named.1.clone().into()),
            declared: Some(declared),
            running: Some(&running),
            path: on_path.0.path().into(),
        };
        assert_eq!(places.find().expect("it is a file"), named.1);
        places.variable = None;
        assert_eq!(places.find().expect("it is declared"), declared);
        places.declared = None;
        assert_eq!(places.find().expect("it is beside"), beside.1);
        places.running = None;
        assert_eq!(places.find().expect("it is on PATH"), on_path.1);
    }

    #[test]
    fn a_program_that_is_called_krylux_but_did_not_declare_itself_is_not_started() {
        let (folder, program) = folder_with_krylux();
        let places =
            Places { variable: None, declared: None, running: Some(&program), path: folder.path().into() };
        let message = places.find().expect_err("only itself is there").to_string();
        assert!(message.contains("no helper program was found"), "{message}");
    }

    #[test]
    fn a_variable_that_names_no_file_is_an_error() {
        let (folder, _) = folder_with_krylux();
        let variable = Some(folder.path().join("absent").into());
        let places = Places { variable, declared: None, running: None, path: folder.path().into() };
        let message = places.find().expect_err("there is no such file").to_string();
        assert!(message.contains("KRYLUX_HELPER") && message.contains("absent"), "{message}");
    }
}
