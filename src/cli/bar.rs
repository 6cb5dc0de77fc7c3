//! Progress bars on the terminal.

use std::cell::Cell;
use std::fmt::Write;
use std::io::IsTerminal;
use std::time::Duration;

use indicatif::style::TemplateError;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::machine;

const STEPS: &str = "{prefix:<9} {bar:32} {percent:>3} %  {elapsed} gone, {eta} left";
const LINE: &str = "{wide_msg}";
/// One line with what is known of the answer so far. 80 columns hold it with the longest estimate and a thousand photos.
const PHOTOS: &str = "{prefix} {bar:8} {pos}/{len}  {gone} gone, {left} left  {wide_msg}";

/// Whether progress is drawn on a terminal.
pub(super) fn has_terminal() -> bool {
    std::io::stderr().is_terminal()
}

/// A progress bar on stderr; nothing is drawn where stderr is no terminal.
pub(super) struct Bar {
    bar: ProgressBar,
    total: Cell<u64>,
}

impl Bar {
    pub(super) fn steps(quiet: bool, what: &'static str) -> Self {
        Self::drawn(quiet, what, STEPS)
    }

    pub(super) fn line(quiet: bool) -> Self {
        Self::drawn(quiet, "", LINE)
    }

    pub(super) fn photos(quiet: bool) -> Self {
        Self::drawn(quiet, "photos", PHOTOS)
    }

    fn drawn(quiet: bool, what: &'static str, template: &str) -> Self {
        let is_hidden = quiet || !has_terminal();
        let target = if is_hidden { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        // The templates are constants; the test below settles that they parse.
        if let Ok(style) = style(template) {
            bar.set_style(style);
        }
        bar.set_prefix(what);
        // The clock of a bar needs a thread. Without one the bar moves when something is done.
        if !is_hidden && machine::has_thread() {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        Self { bar, total: Cell::new(0) }
    }

    /// Something beside it.
    pub(super) fn say(&self, text: &str) {
        self.bar.set_message(text.to_owned());
    }

    /// Shows that `done` of `total` steps are done.
    pub(super) fn show(&self, done: u64, total: u64) {
        if self.total.replace(total) != total {
            self.bar.set_length(total);
        }
        self.bar.set_position(done);
    }
}

/// The style of a bar. Its template may have `{gone}` and `{left}`: times in few characters, such as `12s` and `3m`.
fn style(template: &str) -> Result<ProgressStyle, TemplateError> {
    // A time that cannot be formatted is left out; nothing else depends on it.
    let style = ProgressStyle::with_template(template)?
        .with_key("gone", |state: &ProgressState, to: &mut dyn Write| {
            let _ = write!(to, "{:#}", HumanDuration(state.elapsed()));
        })
        .with_key("left", |state: &ProgressState, to: &mut dyn Write| {
            let _ = write!(to, "{:#}", HumanDuration(state.eta()));
        });
    Ok(style.progress_chars("━╸─"))
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use indicatif::TermLike;

    use super::*;
    use crate::observer::Estimate;

    #[test]
    fn the_templates_of_bars_parse() {
        for template in [STEPS, PHOTOS, LINE] {
            assert!(style(template).is_ok(), "{template}");
        }
    }

    /// A terminal of 80 columns that keeps all that is written to it.
    #[derive(Clone, Debug, Default)]
    struct Terminal(Arc<Mutex<String>>);

    impl TermLike for Terminal {
        fn width(&self) -> u16 {
            80
        }

        fn move_cursor_up(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }

        fn move_cursor_down(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }

        fn move_cursor_right(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }

        fn move_cursor_left(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }

        fn write_line(&self, line: &str) -> std::io::Result<()> {
            self.write_str(line)
        }

        fn write_str(&self, text: &str) -> std::io::Result<()> {
            self.0.lock().expect("no test fails while it writes").push_str(text);
            Ok(())
        }

        fn clear_line(&self) -> std::io::Result<()> {
            Ok(())
        }

        fn flush(&self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn eighty_columns_hold_the_whole_estimate() {
        let eigenpairs = Estimate::Eigenpairs { values: &[1.0; 20], residuals: &[1.2e-13; 20] };
        let solution = Estimate::Solution { residual: 0.5, best: 0.25, iterate: &Vec::new };
        for estimate in [eigenpairs, solution, Estimate::Unpredicted(0.123)] {
            let terminal = Terminal::default();
            let target = ProgressDrawTarget::term_like(Box::new(terminal.clone()));
            let bar = ProgressBar::with_draw_target(Some(1000), target).with_elapsed(Duration::from_secs(59));
            bar.set_style(style(PHOTOS).expect("it parses"));
            bar.set_prefix("photos");
            bar.set_message(estimate.to_string());
            bar.set_position(873);
            bar.force_draw();
            let shown = terminal.0.lock().expect("no test fails while it writes").clone();
            assert!(shown.contains("59s gone") && shown.contains(&estimate.to_string()), "{shown}");
        }
    }
}
