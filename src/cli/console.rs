//! The output to the user: results on stdout; messages, progress bars and errors on stderr. Also handles Ctrl-C.

use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Write};
use std::ops::ControlFlow;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::options::GlobalArgs;
use super::progress::{Bar, LINE, Progress};
use crate::error::{Error, Result};
use crate::observer::{Level, Observer, PhotoTaken, Step};
use crate::team::Team;

/// Stdout and stderr, the progress of the running computation, and whether the user has pressed Ctrl-C. It observes all long computations.
#[derive(Clone)]
pub(super) struct Console {
    json: bool,
    quiet: bool,
    verbose: bool,
    allows_programs: bool,
    interrupted: Arc<AtomicBool>,
    /// Whether any work has checked yet if it must stop.
    asked: Arc<AtomicBool>,
    progress: Arc<Mutex<Progress>>,
    /// The processes that help this process.
    team: Option<Arc<Team>>,
}

impl Console {
    /// Handles Ctrl-C from now on. The first Ctrl-C asks the running work to stop, and the second ends the program. If no work has checked
    /// yet if it must stop, for example while files are read, the first Ctrl-C ends the program.
    pub(super) fn new(args: &GlobalArgs, team: Option<Arc<Team>>) -> Self {
        let interrupted = Arc::new(AtomicBool::new(false));
        let asked = Arc::new(AtomicBool::new(false));
        let flags = [&interrupted, &asked].map(Arc::clone);
        let handler = ctrlc::set_handler(move || {
            let [interrupted, asked] = &flags;
            if interrupted.swap(true, Ordering::SeqCst) || !asked.load(Ordering::SeqCst) {
                std::process::exit(130);
            }
        });
        let GlobalArgs { json, quiet, verbose, allow_programs: allows_programs } = *args;
        let progress = Arc::new(Mutex::new(Progress::new(quiet)));
        let console = Self { json, quiet, verbose, allows_programs, interrupted, asked, progress, team };
        if handler.is_err() {
            console.note("note: Ctrl-C cannot be handled here; it will stop krylux at once");
        }
        console
    }

    /// Writes a line of the result on stdout. With `--json` or `-q`, nothing is written.
    ///
    /// # Errors
    /// [`Error::Write`] when stdout cannot be written. A closed pipe (`krylux … | head`) is not an error.
    pub(super) fn say(&self, line: impl Display) -> Result<()> {
        if self.json || self.quiet {
            return Ok(());
        }
        self.progress().clear();
        written(writeln!(std::io::stdout().lock(), "{}", shown(line)))
    }

    /// Writes a text that is itself the result, such as a script, unchanged on stdout. With `--json`, the summary contains it instead.
    ///
    /// # Errors
    /// The errors of [`Self::say`].
    pub(super) fn print(&self, text: &str) -> Result<()> {
        if self.json {
            return Ok(());
        }
        written(std::io::stdout().lock().write_all(text.as_bytes()))
    }

    /// Writes the machine-readable summary on stdout. Without `--json`, nothing is written.
    ///
    /// # Errors
    /// The errors of [`Self::say`].
    pub(super) fn summary(&self, summary: &serde_json::Value) -> Result<()> {
        if !self.json {
            return Ok(());
        }
        written(writeln!(std::io::stdout().lock(), "{summary:#}"))
    }

    /// Writes a line on stderr, but not with `-q`. Work continues if stderr cannot be written.
    pub(super) fn note(&self, line: impl Display) {
        if !self.quiet {
            self.progress().clear();
            let _ = writeln!(std::io::stderr().lock(), "{}", shown(line));
        }
    }

    /// Writes a line on stderr with `-v` only.
    pub(super) fn detail(&self, line: impl Display) {
        if self.verbose {
            self.note(line);
        }
    }

    /// Writes the error that ends the program.
    pub(super) fn error(&self, error: &Error) {
        self.progress().clear();
        let line = match self.json {
            true => json_of(&error.to_string()),
            false => format!("krylux: error: {}", shown(error)),
        };
        let _ = writeln!(std::io::stderr().lock(), "{line}");
    }

    /// Whether the user has asked to stop.
    pub(super) fn check(&self) -> ControlFlow<()> {
        self.asked.store(true, Ordering::SeqCst);
        self.is_interrupted()
    }

    fn is_interrupted(&self) -> ControlFlow<()> {
        match self.interrupted.load(Ordering::SeqCst) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    /// Works like [`Self::check`], but a stop is returned as an error.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(super) fn go_on(&self) -> Result<()> {
        if self.check().is_break() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// The processes that help this process, if several were started together.
    pub(super) fn team(&self) -> Option<Arc<Team>> {
        self.team.clone()
    }

    /// Whether pictures may be drawn among the lines of the result. Stdout must be a terminal, and lines must not be suppressed.
    pub(super) fn draws_pictures(&self) -> bool {
        !self.json && !self.quiet && std::io::stdout().is_terminal()
    }

    /// Whether programs that a rig file names may be run.
    pub(super) fn allows_programs(&self) -> bool {
        self.allows_programs
    }

    /// A single line that is rewritten repeatedly.
    pub(super) fn line(&self) -> Bar {
        Bar::new(self.quiet, "", LINE)
    }

    /// The display of a running computation.
    pub(super) fn progress(&self) -> MutexGuard<'_, Progress> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Observer for Console {
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        self.progress().step(step);
        if step.stage == "loading" {
            // The check is not recorded here. Files may be read for long between these steps, so the first Ctrl-C must end the program.
            return self.is_interrupted();
        }
        self.check()
    }

    fn log(&self, level: Level, message: &str) {
        match level {
            Level::Warning | Level::Note => self.note(message),
            Level::Detail => self.detail(message),
            // An error is ignored here, because it occurs again when the verb writes its own result.
            Level::Info => drop(self.say(message)),
        }
    }

    fn frame(&self) -> ControlFlow<()> {
        self.check()
    }

    fn photo(&self, photo: &PhotoTaken<'_>) -> ControlFlow<()> {
        self.progress().photo(photo);
        self.check()
    }
}

/// An error as one JSON object: `{"error": …, "help": …}`. If the message has no help, the help is null.
fn json_of(message: &str) -> String {
    let (error, help) = match message.split_once("\n  help: ") {
        Some((error, help)) => (error, Some(help)),
        None => (message, None),
    };
    serde_json::json!({ "error": error, "help": help }).to_string()
}

/// The line with escaped control characters. Names from files may contain such characters, which would change the terminal.
fn shown(line: impl Display) -> String {
    let line = line.to_string();
    if !line.contains(|c: char| c.is_control() && c != '\n') {
        return line;
    }
    let escaped =
        |c: char| if c.is_control() && c != '\n' { c.escape_default().collect() } else { c.to_string() };
    line.chars().map(escaped).collect()
}

/// Ignores the error of a closed pipe.
fn written(done: std::io::Result<()>) -> Result<()> {
    match done {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Error::writing("standard output")(error)),
        _ => Ok(()),
    }
}

/// Reports why the command line cannot be parsed, as JSON with `--json`, or prints the requested help.
pub(super) fn report_usage(why: &clap::Error) -> ExitCode {
    let wants_json = std::env::args_os().any(|argument| argument == "--json");
    if why.use_stderr() && wants_json {
        let _ = writeln!(std::io::stderr().lock(), "{}", json_of(&as_error_and_help(&why.to_string())));
    } else {
        // The error is ignored, since the pipe may be closed.
        let _ = why.print();
    }
    ExitCode::from(u8::try_from(why.exit_code()).unwrap_or(2))
}

/// The message in the form of krylux's own errors: first the fault, then the help.
fn as_error_and_help(message: &str) -> String {
    let message = message.trim();
    let (error, help) = message.split_once("\n\n").unwrap_or((message, "see --help"));
    format!("{}\n  help: {}", error.trim_start_matches("error: "), help.trim())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observer::Estimate;

    #[test]
    fn while_a_scene_is_loaded_nothing_asks_so_that_the_first_interrupt_ends_the_program() {
        let [json, quiet, verbose, allows_programs] = [false, true, false, false];
        let [interrupted, asked] = [false, false].map(|flag| Arc::new(AtomicBool::new(flag)));
        let progress = Arc::new(Mutex::new(Progress::new(quiet)));
        let console =
            Console { json, quiet, verbose, allows_programs, interrupted, asked, progress, team: None };
        let step = |stage, done| console.step(&Step { stage, done, total: 100, estimate: Estimate::None });
        assert!([0, 7, 50].map(|done| step("loading", done)).iter().all(|told| told.is_continue()));
        assert!(!console.asked.load(Ordering::SeqCst), "an interrupt would be put off");
        assert!(step("tracing", 1).is_continue());
        assert!(console.asked.load(Ordering::SeqCst));
        console.interrupted.store(true, Ordering::SeqCst);
        assert!(step("tracing", 2).is_break() && step("loading", 8).is_break());
    }

    #[test]
    fn names_from_files_do_not_change_the_terminal() {
        assert_eq!(
            shown("a\u{1b}[2Jb\r\u{7f}\u{9b}é\n  help: x"),
            "a\\u{1b}[2Jb\\r\\u{7f}\\u{9b}é\n  help: x"
        );
    }
}
