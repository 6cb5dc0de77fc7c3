//! The figures of one frame of a preview.

use serde::Serialize;

use super::CountRange;
use crate::finding::decimal;
use crate::rig::RawFrame;

/// The figures of one frame. Shares are of all samples; the mean is above black, as a share of the camera's
/// range.
#[derive(Clone, Debug, Serialize)]
pub struct FrameFigures {
    /// The number of the frame, from 1.
    pub frame: u64,
    /// The largest count.
    pub brightest: u16,
    /// The mean count above black, as a share of the range above black.
    pub mean: f64,
    /// The share of the samples that are saturated.
    pub saturated: f64,
    /// The share of the samples whose count is 0.
    pub black: f64,
    /// The [focus score](crate::measure::focus()) of this frame and the one before; none of the first frame.
    pub focus: Option<f64>,
    /// The best focus score so far.
    pub best_focus: Option<f64>,
    /// Frames per second.
    pub per_second: f64,
    /// The exposure of the frame, in seconds.
    pub exposure: f64,
}

impl FrameFigures {
    /// The figures of the frame with this number, taken at so many frames per second; the focus score and the
    /// best so far.
    pub(crate) fn of(
        raw: &RawFrame,
        range: &CountRange,
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

    /// One line with all figures:
    /// `frame     12: focus 5.951e-2, best 6.012e-2; saturated 0.0 %, black 0.0 %, brightest 2900 of 4095, mean 34.0 %; 20.1 a second of 0.0333 s`.
    pub fn line(&self, range: &CountRange) -> String {
        format!(
            "frame     {}: focus {}, best {}; saturated {}, black {}, brightest {} of {}, mean {}; {:.1} a second of {} s",
            self.frame,
            score(self.focus),
            score(self.best_focus),
            percent(self.saturated),
            percent(self.black),
            self.brightest,
            range.full,
            percent(self.mean),
            self.per_second,
            decimal(self.exposure, 4),
        )
    }

    /// The figures that fit into a terminal of 80 columns.
    pub fn short_line(&self, range: &CountRange) -> String {
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
    fn the_short_line_fits_into_80_columns() {
        let figures = FrameFigures {
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
        let range = CountRange { black: 0.0, limit: 65535.0, full: 65535.0 };
        let short = figures.short_line(&range);
        assert!(short.chars().count() <= 80, "{short}");
        assert!(figures.line(&range).contains("123.4 a second of 0.0333 s"));
    }

    /// Ten counts of two pixels of five channels: one black, three at the limit of 200 or above.
    #[test]
    fn figures_are_those_of_the_counts_and_lines_say_them() {
        let counts = vec![0, 10, 200, 255, 199, 201, 20, 30, 40, 45];
        let resolution = crate::image::Resolution::new(2, 1);
        let raw = RawFrame { resolution, channels: 5, counts, exposure: 0.02, id: 7, started: 0.0 };
        let range = CountRange { black: 50.0, limit: 200.0, full: 250.0 };
        let figures = FrameFigures::of(&raw, &range, (12, 20.0), [None, Some(0.5)]);
        let (shares, mean) = ((figures.saturated, figures.black), figures.mean);
        assert_eq!((figures.frame, figures.brightest, shares, mean), (12, 255, (0.3, 0.1), 0.25));
        assert_eq!(
            figures.line(&range),
            "frame     12: focus –, best 5.00e-1; saturated 30.0 %, black 10.0 %, brightest 255 of 250, mean 25.0 %; 20.0 a second of 0.0200 s"
        );
        assert_eq!(
            figures.short_line(&range),
            "focus –, best 5.00e-1, saturated 30.0 %, black 10.0 %, peak 102 %, 20.0/s"
        );
        assert_eq!([0.0, 5e-4, 1e-3, 1.0].map(percent), ["0.0 %", "<0.1 %", "0.1 %", "100.0 %"]);
    }
}
