//! What one frame tells the one who sets up a camera.

use serde::Serialize;

use crate::rig::RawFrame;

/// What one frame tells. Shares are of all samples; light is above black, as a share of the camera's range.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Figures {
    frame: u64,
    brightest: u16,
    mean: f64,
    saturated: f64,
    black: f64,
    focus: Option<f64>,
    best_focus: Option<f64>,
    per_second: f64,
    exposure: f64,
}

/// What counts mean.
pub(super) struct Range {
    /// The count without light.
    pub(super) black: f64,
    /// Counts from here on are saturated.
    pub(super) limit: f64,
    /// The largest count.
    pub(super) full: f64,
}

impl Figures {
    /// Of a frame with this number, after so many in a second; the focus score and the best so far.
    pub(super) fn of(
        raw: &RawFrame,
        range: &Range,
        (frame, per_second): (u64, f64),
        [focus, best_focus]: [Option<f64>; 2],
    ) -> Self {
        let samples = raw.counts.len() as f64;
        let share =
            |of: &dyn Fn(u16) -> bool| raw.counts.iter().filter(|&&count| of(count)).count() as f64 / samples;
        let mean = raw.counts.iter().map(|&count| f64::from(count)).sum::<f64>() / samples;
        Self {
            frame,
            brightest: raw.counts.iter().copied().max().unwrap_or(0),
            mean: (mean - range.black) / (range.full - range.black),
            saturated: share(&|count| f64::from(count) >= range.limit),
            black: share(&|count| count == 0),
            focus,
            best_focus,
            per_second,
            exposure: raw.exposure,
        }
    }

    /// `frame     12: focus 5.951e-2, best 6.012e-2; saturated 0.0 %, black 0.0 %, brightest 2900 of 4095, mean 34.0 %; 20.1 a second
    /// of 0.0333 s`
    pub(super) fn line(&self, range: &Range) -> String {
        format!(
            "frame     {}: focus {}, best {}; saturated {}, black {}, brightest {} of {}, mean {}; {:.1} a second of {:.4} s",
            self.frame,
            score(self.focus),
            score(self.best_focus),
            percent(self.saturated),
            percent(self.black),
            self.brightest,
            range.full,
            percent(self.mean),
            self.per_second,
            self.exposure,
        )
    }

    /// What fits into a terminal of 80 columns.
    pub(super) fn short(&self, range: &Range) -> String {
        format!(
            "focus {}, best {}, saturated {}, black {}, peak {:.0} %, {:.1}/s",
            score(self.focus),
            score(self.best_focus),
            percent(self.saturated),
            percent(self.black),
            100.0 * f64::from(self.brightest) / range.full,
            self.per_second,
        )
    }
}

fn score(score: Option<f64>) -> String {
    score.map_or("–".into(), |score| format!("{score:.2e}"))
}

fn percent(share: f64) -> String {
    match 100.0 * share {
        some if some > 0.0 && some < 0.1 => "<0.1 %".to_owned(),
        some => format!("{some:.1} %"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_on_a_terminal_fits_into_80_columns() {
        let figures = Figures {
            frame: 123_456,
            brightest: 65535,
            mean: 0.999,
            saturated: 0.999,
            black: 0.999,
            focus: Some(1.234e-5),
            best_focus: Some(1.234e-5),
            per_second: 123.4,
            exposure: 0.0333,
        };
        let range = Range { black: 0.0, limit: 65535.0, full: 65535.0 };
        let short = figures.short(&range);
        assert!(short.chars().count() <= 80, "{short}");
        assert!(figures.line(&range).contains("123.4 a second of 0.0333 s"));
    }
}
