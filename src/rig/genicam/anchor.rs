//! The relation between the camera's clock and the rig's.
//!
//! A camera stamps its frames by its own clock. An anchor reads the camera's time between two readings of the rig's clock, which
//! relates both with an error of at most half the interval. Afterwards the error grows with the drift between the two quartzes.

use viva_genicam::Camera;
use viva_genicam::genapi::RegisterIo;

use crate::rig::WallClock;

/// A bound on the relative drift between two quartzes.
const DRIFT: f64 = 1e-4;

/// The age in seconds after which an anchor is renewed.
const AGE: f64 = 10.0;

/// The features that latch and read the camera's time: the command, the value, and ticks per second where the standard fixes them.
/// The first are of SFNC 2, the second of GigE Vision 1.
const LATCHES: [(&str, &str, Option<f64>); 2] = [
    ("TimestampLatch", "TimestampLatchValue", Some(1e9)),
    ("GevTimestampControlLatch", "GevTimestampValue", None),
];

/// One simultaneous reading of both clocks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor {
    /// The camera's time in ticks.
    ticks: f64,
    /// Ticks of the camera per second.
    per_second: f64,
    /// The rig's time in seconds.
    time: f64,
    /// The largest error of `time` in seconds.
    error: f64,
}

impl Anchor {
    /// Reads both clocks. `None`: the camera does not tell its time.
    pub(super) fn take<T: RegisterIo>(camera: &mut Camera<T>, clock: WallClock) -> Option<Self> {
        for (latch, value, unit) in LATCHES {
            let before = clock.seconds();
            if camera.execute_command(latch).is_err() {
                continue;
            }
            let after = clock.seconds();
            camera.invalidate(value);
            let (Ok(ticks), Some(per_second)) =
                (camera.get_integer(value), unit.or_else(|| frequency(camera)))
            else {
                continue;
            };
            let (time, error) = (0.5 * (before + after), 0.5 * (after - before));
            return Some(Self { ticks: ticks as f64, per_second, time, error });
        }
        None
    }

    /// Whether the anchor is too old at the rig's time `now`.
    pub(super) fn is_old(&self, now: f64) -> bool {
        now - self.time > AGE
    }

    /// The rig's time of a camera's time stamp, and its largest error, both in seconds.
    pub(super) fn time_of(&self, stamp: u64) -> [f64; 2] {
        let since = (stamp as f64 - self.ticks) / self.per_second;
        [self.time + since, self.error + DRIFT * since.abs()]
    }
}

/// Ticks per second of a GigE Vision 1 camera.
fn frequency<T: RegisterIo>(camera: &Camera<T>) -> Option<f64> {
    let ticks = camera.get_integer("GevTimestampTickFrequency").ok()?;
    (ticks > 0).then_some(ticks as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_is_converted_to_the_rigs_time_with_the_error_of_drift() {
        let anchor = Anchor { ticks: 5e9, per_second: 1e9, time: 100.0, error: 0.001 };
        let [time, error] = anchor.time_of(3_000_000_000);
        assert!((time - 98.0).abs() < 1e-9 && (error - 0.0012).abs() < 1e-12, "{time} ± {error}");
        assert!(anchor.is_old(111.0) && !anchor.is_old(109.0));
    }
}
