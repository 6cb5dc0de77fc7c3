//! The line about a run: rewritten on a terminal, now and then a new one elsewhere.

use std::time::{Duration, Instant};

use super::super::console::{Bar, Console};

/// Without a terminal, a line at most so often: a log of hours stays readable.
const EVERY: Duration = Duration::from_secs(10);

/// Photos done and left, time, and the residual so far.
pub(super) struct Line {
    bar: Bar,
    console: Console,
    residual: String,
    start: Instant,
    pace: Pace,
    first: Option<u64>,
}

impl Line {
    pub(super) fn new(console: &Console) -> Self {
        let start = Instant::now();
        Self {
            bar: console.photos(),
            console: console.clone(),
            residual: String::new(),
            start,
            pace: Pace { last: start },
            first: None,
        }
    }

    pub(super) fn residual(&mut self, residual: String) {
        self.bar.say(&residual);
        self.residual = residual;
    }

    pub(super) fn at(&mut self, done: u64, total: u64) {
        // Whether to go on is asked elsewhere.
        let _ = self.bar.at(done, total);
        // Those of an earlier stage took another time.
        let first = *self.first.get_or_insert(done.saturating_sub(1));
        if self.console.has_terminal() || !self.pace.is_due(Instant::now()) {
            return;
        }
        self.console.note(line(done - first, total - first, self.start.elapsed(), &self.residual));
    }
}

/// `photos    12 of 50, 8 s gone, about 25 s left, residual 1.2e-3`
fn line(done: u64, total: u64, gone: Duration, residual: &str) -> String {
    let left = gone.as_secs_f64() / done.max(1) as f64 * total.saturating_sub(done) as f64;
    let comma = if residual.is_empty() { "" } else { ", " };
    format!(
        "photos    {done} of {total}, {:.0} s gone, about {left:.0} s left{comma}{residual}",
        gone.as_secs_f64()
    )
}

struct Pace {
    last: Instant,
}

impl Pace {
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
        let mut pace = Pace { last: start };
        let after = |seconds: u64| start + Duration::from_secs(seconds);
        let due: Vec<u64> = (0..60).filter(|&second| pace.is_due(after(second))).collect();
        assert_eq!(due, [10, 20, 30, 40, 50]);
    }

    #[test]
    fn a_line_says_what_is_done_and_what_is_left() {
        let said = line(12, 48, Duration::from_secs(8), "residual 1.2e-3");
        assert_eq!(said, "photos    12 of 48, 8 s gone, about 24 s left, residual 1.2e-3");
        assert_eq!(line(1, 1, Duration::from_secs(3), ""), "photos    1 of 1, 3 s gone, about 0 s left");
    }
}
