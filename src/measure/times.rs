//! How the time of a session is spent.

use std::fmt;
use std::ops::Add;

/// How the time of one or of many photos is spent, in seconds on the rig's clock. The sum of a session is
/// [`Effort::seconds`](super::Effort::seconds). `refresh` and `settle` depend on the projector, `expose` on
/// the light, and the rest on this program and its connections.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Times {
    /// Drawing frames, sending them to the projector, and reading them back before and after the photo.
    pub show: f64,
    /// Waiting until the next refresh of the projector showed the frame and this was confirmed.
    pub refresh: f64,
    /// Waiting for further refreshes, and for the settle time of the calibration.
    pub settle: f64,
    /// Exposures of accepted frames.
    pub expose: f64,
    /// Setting and triggering the camera, transferring frames, and refused tries.
    pub transfer: f64,
    /// Everything else: processing photos and writing the journal.
    pub process: f64,
}

impl Times {
    /// The sum.
    pub fn sum(&self) -> f64 {
        self.show + self.refresh + self.settle + self.expose + self.transfer + self.process
    }

    /// The mean time of one of so many photos.
    pub fn each(self, photos: u64) -> Self {
        let share = 1.0 / photos.max(1) as f64;
        let Self { show, refresh, settle, expose, transfer, process } = self;
        Self {
            show: share * show,
            refresh: share * refresh,
            settle: share * settle,
            expose: share * expose,
            transfer: share * transfer,
            process: share * process,
        }
    }
}

impl Add for Times {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            show: self.show + other.show,
            refresh: self.refresh + other.refresh,
            settle: self.settle + other.settle,
            expose: self.expose + other.expose,
            transfer: self.transfer + other.transfer,
            process: self.process + other.process,
        }
    }
}

/// Writes the times in milliseconds, with their names.
impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = [
            ("show", self.show),
            ("refresh", self.refresh),
            ("settle", self.settle),
            ("expose", self.expose),
            ("transfer", self.transfer),
            ("process", self.process),
        ];
        write!(f, "{:.1} ms:", 1e3 * self.sum())?;
        for (at, (name, seconds)) in parts.into_iter().enumerate() {
            let separator = if at == 0 { "" } else { "," };
            write!(f, "{separator} {name} {:.1}", 1e3 * seconds)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_add_up_and_are_written_per_photo_in_milliseconds() {
        let one =
            Times { show: 0.002, refresh: 0.01, settle: 0.016, expose: 0.004, transfer: 0.001, process: 0.0 };
        let both = one + Times { process: 0.007, ..one };
        assert!((both.sum() - 0.073).abs() < 1e-12);
        let text = both.each(2).to_string();
        assert_eq!(
            text,
            "36.5 ms: show 2.0, refresh 10.0, settle 16.0, expose 4.0, transfer 1.0, process 3.5"
        );
        assert_eq!(Times::default().each(0), Times::default());
    }
}
