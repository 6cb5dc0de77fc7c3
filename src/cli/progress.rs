//! The display of a running computation: a bar of light paths or a line about the photos of a run, and images in a viewer.

use std::cell::Cell;
use std::fmt;
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use indicatif::style::TemplateError;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::image::Resolution;
use crate::machine;
use crate::observer::{PhotoTaken, Step};
use crate::report::viewer::{Plane, Viewer};

/// The shortest time between two lines without a terminal, so that a log of hours stays readable.
const EVERY: Duration = Duration::from_secs(10);

/// The display of a running computation.
pub(super) struct Progress {
    /// Whether nothing is drawn.
    quiet: bool,
    steps: Option<Bar>,
    photos: Option<PhotoLine>,
    taken: u64,
    viewer: Option<Display>,
}

/// An image viewer, with the facts about the images that it needs.
pub(super) struct Display {
    pub(super) viewer: Viewer,
    pub(super) name: String,
    /// The resolutions of patterns and of photos.
    pub(super) sizes: [Resolution; 2],
    pub(super) channels: usize,
}

impl Progress {
    /// A new display. Nothing is drawn if `quiet`, or if stderr is no terminal.
    pub(super) fn new(quiet: bool) -> Self {
        Self { quiet, steps: None, photos: None, taken: 0, viewer: None }
    }

    /// Shows every pattern and photo in this viewer from now on.
    pub(super) fn show_in(&mut self, display: Option<Display>) {
        self.viewer = display;
    }

    /// Removes the bar and the line from the screen, before other output is written.
    pub(super) fn clear(&mut self) {
        self.steps = None;
        self.photos = None;
    }

    pub(super) fn step(&mut self, step: &Step<'_>) {
        match step.stage {
            // When photos are traced one by one, only the line about photos is shown, since it tells more.
            "tracing" if self.photos.is_some() => {}
            "loading" | "tracing" | "trials" => {
                let quiet = self.quiet;
                let bar = self.steps.get_or_insert_with(|| Bar::new(quiet, step.stage, STEPS));
                // The bar does not check for Ctrl-C. The console checks, but must not record its check while a scene is loaded.
                bar.show(step.done, step.total);
                if step.done == step.total {
                    self.steps = None;
                }
            }
            _ if step.done == 0 => {
                self.steps = None;
                self.photos = Some(PhotoLine::new(self.quiet, self.taken, self.taken + step.total));
            }
            _ => {
                if let Some(line) = &mut self.photos {
                    line.estimate(step.estimate.to_string());
                    line.at(self.taken);
                }
            }
        }
    }

    pub(super) fn photo(&mut self, photo: &PhotoTaken<'_>) {
        self.taken += 1;
        if let Some(line) = &mut self.photos {
            line.at(self.taken);
        }
        let Some(display) = &self.viewer else { return };
        let [patterns, photos] = display.sizes;
        let [of_pattern, of_photo] = if photo.is_dual { [photos, patterns] } else { [patterns, photos] };
        display.show("pattern", of_pattern, photo.channel, photo.pattern);
        display.show("photo", of_photo, photo.channel, photo.photo);
    }

    /// Shows a channel of an image in the viewer, if there is a viewer.
    pub(super) fn show(&self, what: &str, size: Resolution, channel: usize, values: &[f64]) {
        if let Some(display) = &self.viewer {
            display.show(what, size, channel, values);
        }
    }
}

impl Display {
    fn show(&self, what: &str, size: Resolution, channel: usize, values: &[f64]) {
        let channels: &[&str] = if self.channels == 3 { &["R", "G", "B"] } else { &["Y"] };
        self.viewer.show(Plane {
            name: format!("{} {what}", self.name),
            size,
            channels,
            channel,
            values: values.iter().map(|&value| value as f32).collect(),
        });
    }
}

/// The line about the photos of a run. A terminal rewrites it. Elsewhere, a new line is written from time to time.
struct PhotoLine {
    quiet: bool,
    bar: Bar,
    estimate: String,
    start: Instant,
    /// The time of the last line.
    last: Instant,
    /// The number of photos of earlier stages. The written lines omit them, since each of them took a different time.
    before: u64,
    /// The largest number of photos of all stages together.
    total: u64,
}

impl PhotoLine {
    fn new(quiet: bool, before: u64, total: u64) -> Self {
        let start = Instant::now();
        let bar = Bar::new(quiet, "photos", PHOTOS);
        Self { quiet, bar, estimate: String::new(), start, last: start, before, total }
    }

    fn estimate(&mut self, estimate: String) {
        self.bar.say(&estimate);
        self.estimate = estimate;
    }

    fn at(&mut self, taken: u64) {
        let total = self.total.max(taken);
        self.bar.show(taken, total);
        if self.quiet || has_terminal() || !is_due(&mut self.last, Instant::now()) {
            return;
        }
        let (done, all) = (taken - self.before, total - self.before);
        // The line does not go through the console, which would clear the display. Without a terminal, nothing is to be cleared.
        let line = line(done, all, self.start.elapsed(), &self.estimate);
        let _ = writeln!(std::io::stderr().lock(), "{line}");
    }
}

/// The line, such as `photos    12 of 50, 8 s gone, about 25 s left, relative residual 0.0012`.
fn line(done: u64, total: u64, gone: Duration, estimate: &str) -> String {
    let left = gone.as_secs_f64() / done.max(1) as f64 * total.saturating_sub(done) as f64;
    let comma = if estimate.is_empty() { "" } else { ", " };
    format!(
        "photos    {done} of {total}, {:.0} s gone, about {left:.0} s left{comma}{estimate}",
        gone.as_secs_f64()
    )
}

/// Whether it is time for the next line. If so, the time of the last line is set to now.
fn is_due(last: &mut Instant, now: Instant) -> bool {
    let is_due = now.duration_since(*last) >= EVERY;
    if is_due {
        *last = now;
    }
    is_due
}

const STEPS: &str = "{prefix:<9} {bar:32} {percent:>3} %  {elapsed} gone, {eta} left";
pub(super) const LINE: &str = "{wide_msg}";
/// One line about the photos and the current estimate. It fits into 80 columns with the longest estimate and a thousand photos.
const PHOTOS: &str = "{prefix} {bar:8} {pos}/{len}  {gone} gone, {left} left  {wide_msg}";

/// Whether progress is drawn on a terminal.
pub(super) fn has_terminal() -> bool {
    std::io::stderr().is_terminal()
}

/// A progress bar on stderr. Nothing is drawn if stderr is no terminal.
pub(super) struct Bar {
    bar: ProgressBar,
    total: Cell<u64>,
}

impl Bar {
    pub(super) fn new(quiet: bool, what: &'static str, template: &str) -> Self {
        let is_hidden = quiet || !has_terminal();
        let target = if is_hidden { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        // The templates are constants. The test below checks that they can be parsed.
        if let Ok(style) = style(template) {
            bar.set_style(style);
        }
        bar.set_prefix(what);
        // The clock of a bar needs a thread. Without a thread, the bar moves only when a step is done.
        if !is_hidden && machine::has_thread() {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        Self { bar, total: Cell::new(0) }
    }

    /// Shows a text beside the bar.
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

/// The style of a bar. Its template may contain `{gone}` and `{left}`: short times, such as `12s` and `3m`.
fn style(template: &str) -> Result<ProgressStyle, TemplateError> {
    // A time that cannot be formatted is left out.
    let style = ProgressStyle::with_template(template)?
        .with_key("gone", |state: &ProgressState, to: &mut dyn fmt::Write| {
            let _ = write!(to, "{:#}", HumanDuration(state.elapsed()));
        })
        .with_key("left", |state: &ProgressState, to: &mut dyn fmt::Write| {
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
    fn lines_are_sparse() {
        let start = Instant::now();
        let mut last = start;
        let after = |seconds: u64| start + Duration::from_secs(seconds);
        let due: Vec<u64> = (0..60).filter(|&second| is_due(&mut last, after(second))).collect();
        assert_eq!(due, [10, 20, 30, 40, 50]);
    }

    #[test]
    fn a_line_says_what_is_done_and_what_is_left() {
        let said = line(12, 48, Duration::from_secs(8), "residual 1.2e-3");
        assert_eq!(said, "photos    12 of 48, 8 s gone, about 24 s left, residual 1.2e-3");
        assert_eq!(line(1, 1, Duration::from_secs(3), ""), "photos    1 of 1, 3 s gone, about 0 s left");
    }

    #[test]
    fn the_templates_of_bars_parse() {
        for template in [STEPS, PHOTOS, LINE] {
            assert!(style(template).is_ok(), "{template}");
        }
    }

    /// A terminal of 80 columns that stores its output.
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
