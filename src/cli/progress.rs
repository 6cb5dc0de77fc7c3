//! What is seen of a computation while it goes on: a bar of light paths, or a line about the photos of a run; and images in a viewer.

use std::io::Write;
use std::time::{Duration, Instant};

use super::bar::{Bar, has_terminal};
use crate::image::Resolution;
use crate::observer::{PhotoTaken, Step};
use crate::report::viewer::{Plane, Viewer};

/// Without a terminal, a line at most so often: a log of hours stays readable.
const EVERY: Duration = Duration::from_secs(10);

/// What is shown of a running computation.
pub(super) struct Progress {
    /// Whether nothing is drawn.
    quiet: bool,
    steps: Option<Bar>,
    photos: Option<PhotoLine>,
    taken: u64,
    viewer: Option<Display>,
}

/// An image viewer, and what it has to know of the images.
pub(super) struct Display {
    pub(super) viewer: Viewer,
    pub(super) name: String,
    /// Pixels of patterns and of photos.
    pub(super) sizes: [Resolution; 2],
    pub(super) channels: usize,
}

impl Progress {
    /// Nothing is drawn where `quiet`, nor where stderr is no terminal.
    pub(super) fn new(quiet: bool) -> Self {
        Self { quiet, steps: None, photos: None, taken: 0, viewer: None }
    }

    /// Shows every pattern and photo in this viewer from now on.
    pub(super) fn show_in(&mut self, display: Option<Display>) {
        self.viewer = display;
    }

    /// Takes bar and line off the screen, before something else is written.
    pub(super) fn clear(&mut self) {
        self.steps = None;
        self.photos = None;
    }

    pub(super) fn step(&mut self, step: &Step<'_>) {
        match step.stage {
            // While photos are traced one by one, the line about photos says more.
            "tracing" if self.photos.is_some() => {}
            "loading" | "tracing" | "trials" => {
                let quiet = self.quiet;
                let bar = self.steps.get_or_insert_with(|| Bar::steps(quiet, step.stage));
                // Whether to go on is asked by the console, and not here: while a scene is loaded, it is not asked at all.
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

    /// Shows a channel of an image in the viewer, if there is one.
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

/// The line about the photos of a run: rewritten on a terminal, now and then a new one elsewhere.
struct PhotoLine {
    quiet: bool,
    bar: Bar,
    estimate: String,
    start: Instant,
    rhythm: Rhythm,
    /// Photos of earlier stages, which took another time, and of all stages at most.
    before: u64,
    total: u64,
}

impl PhotoLine {
    fn new(quiet: bool, before: u64, total: u64) -> Self {
        let start = Instant::now();
        let bar = Bar::photos(quiet);
        Self { quiet, bar, estimate: String::new(), start, rhythm: Rhythm { last: start }, before, total }
    }

    fn estimate(&mut self, estimate: String) {
        self.bar.say(&estimate);
        self.estimate = estimate;
    }

    fn at(&mut self, taken: u64) {
        let total = self.total.max(taken);
        self.bar.show(taken, total);
        if self.quiet || has_terminal() || !self.rhythm.is_due(Instant::now()) {
            return;
        }
        let (done, all) = (taken - self.before, total - self.before);
        // The console would take the line off the screen; there is none without a terminal.
        eprintln_softly(&line(done, all, self.start.elapsed(), &self.estimate));
    }
}

fn eprintln_softly(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// `photos    12 of 50, 8 s gone, about 25 s left, relative residual 0.0012`
fn line(done: u64, total: u64, gone: Duration, estimate: &str) -> String {
    let left = gone.as_secs_f64() / done.max(1) as f64 * total.saturating_sub(done) as f64;
    let comma = if estimate.is_empty() { "" } else { ", " };
    format!(
        "photos    {done} of {total}, {:.0} s gone, about {left:.0} s left{comma}{estimate}",
        gone.as_secs_f64()
    )
}

struct Rhythm {
    last: Instant,
}

impl Rhythm {
    /// Whether it is time for the next line; then the next one's time starts.
    fn is_due(&mut self, now: Instant) -> bool {
        let is_due = now.duration_since(self.last) >= EVERY;
        if is_due {
            self.last = now;
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_sparse() {
        let start = Instant::now();
        let mut rhythm = Rhythm { last: start };
        let after = |seconds: u64| start + Duration::from_secs(seconds);
        let due: Vec<u64> = (0..60).filter(|&second| rhythm.is_due(after(second))).collect();
        assert_eq!(due, [10, 20, 30, 40, 50]);
    }

    #[test]
    fn a_line_says_what_is_done_and_what_is_left() {
        let said = line(12, 48, Duration::from_secs(8), "residual 1.2e-3");
        assert_eq!(said, "photos    12 of 48, 8 s gone, about 24 s left, residual 1.2e-3");
        assert_eq!(line(1, 1, Duration::from_secs(3), ""), "photos    1 of 1, 3 s gone, about 0 s left");
    }
}
