//! What the user sees while a verb runs: results on stdout, progress and notes on stderr.

use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use anyhow::Result;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::options::OutputArgs;
use crate::observer::{Observer, Step};

/// Where text goes, and whether the user has asked to stop.
#[derive(Clone)]
pub(super) struct Console {
    json: bool,
    quiet: bool,
    verbose: bool,
    interrupted: Arc<AtomicBool>,
}

impl Console {
    /// Listens to Ctrl-C: the first one stops the work in good order, a second one at once.
    pub(super) fn new() -> Self {
        let interrupted = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&interrupted);
        let handler = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        });
        let console = Self { json: false, quiet: false, verbose: false, interrupted };
        if handler.is_err() {
            console.note("note: Ctrl-C cannot be handled here; it will stop krylux at once");
        }
        console
    }

    /// The same console, as talkative as the user wants it.
    pub(super) fn with(&self, args: &OutputArgs) -> Self {
        Self { json: args.json, quiet: args.quiet, verbose: args.verbose, ..self.clone() }
    }

    /// A line of the result on stdout; nothing with `--json` or `-q`.
    pub(super) fn say(&self, line: impl Display) -> Result<()> {
        if !self.json && !self.quiet {
            writeln!(std::io::stdout().lock(), "{line}")?;
        }
        Ok(())
    }

    /// The machine summary on stdout; nothing without `--json`.
    pub(super) fn summary(&self, summary: &serde_json::Value) -> Result<()> {
        if self.json {
            writeln!(std::io::stdout().lock(), "{summary:#}")?;
        }
        Ok(())
    }

    /// A line on stderr; nothing with `-q`.
    pub(super) fn note(&self, line: impl Display) {
        if !self.quiet {
            eprintln!("{line}");
        }
    }

    /// A line on stderr with `-v` only.
    pub(super) fn detail(&self, line: impl Display) {
        if self.verbose {
            eprintln!("{line}");
        }
    }

    /// The error that ends the program.
    pub(super) fn error(&self, error: &anyhow::Error) {
        eprintln!("krylux: error: {error:#}");
    }

    /// Whether the user has asked to stop.
    pub(super) fn check(&self) -> ControlFlow<()> {
        if self.interrupted.load(Ordering::SeqCst) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Whether progress is drawn on a terminal.
    pub(super) fn has_terminal(&self) -> bool {
        std::io::stderr().is_terminal()
    }

    /// A bar for steps of `what`: drawn on a terminal, invisible in a pipe and with `-q`.
    pub(super) fn bar(&self, what: &'static str) -> Bar {
        self.drawn(what, TEMPLATE)
    }

    /// A bar that counts photos.
    pub(super) fn photos(&self) -> Bar {
        self.drawn("photos", PHOTOS)
    }

    /// One line that is written anew again and again.
    pub(super) fn line(&self) -> Bar {
        self.drawn("", LINE)
    }

    fn drawn(&self, what: &'static str, template: &str) -> Bar {
        let hidden = self.quiet || !self.has_terminal();
        let target = if hidden { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        // The templates are constants, so that they parse is settled by the test below.
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("━╸─"));
        }
        bar.set_prefix(what);
        bar.enable_steady_tick(Duration::from_millis(200));
        Bar { console: self.clone(), bar, total: AtomicU64::new(0) }
    }
}

const TEMPLATE: &str = "{prefix:<9} {bar:32} {percent:>3} %  {elapsed} gone, {eta} left";

const LINE: &str = "{wide_msg}";

/// One line of 80 columns, with what is said of the answer so far.
const PHOTOS: &str = "{prefix:<9} {bar:16} {pos:>3}/{len}  {elapsed} gone, {eta} left  {wide_msg}";

/// A progress bar that also answers whether to go on.
pub(super) struct Bar {
    console: Console,
    bar: ProgressBar,
    total: AtomicU64,
}

impl Bar {
    /// Something beside it.
    pub(super) fn say(&self, text: &str) {
        self.bar.set_message(text.to_owned());
    }

    /// `done` of `total` steps are done.
    pub(super) fn at(&self, done: u64, total: u64) -> ControlFlow<()> {
        if self.total.swap(total, Ordering::Relaxed) != total {
            self.bar.set_length(total);
        }
        self.bar.set_position(done);
        self.console.check()
    }
}

/// Stops where the user asks for that.
impl Observer for Console {
    fn step(&self, _: &Step<'_>) -> ControlFlow<()> {
        self.check()
    }
}

impl Observer for Bar {
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        self.at(step.done, step.total)
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Whether the reader of our output has gone, which is no fault: `krylux … | head`.
pub(super) fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let io = error.downcast_ref::<std::io::Error>();
    io.is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_bars_templates_parse() {
        for template in [super::TEMPLATE, super::PHOTOS, super::LINE] {
            assert!(indicatif::ProgressStyle::with_template(template).is_ok(), "{template}");
        }
    }
}
