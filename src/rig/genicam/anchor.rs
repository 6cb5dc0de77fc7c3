//! The camera's clock against the rig's.
//!
//! A camera stamps its frames by a clock of its own. It is asked for its time between two looks at the rig's, which says what
//! its stamps mean to within half of that; from then on both may part by what quartzes do.

use viva_genicam::Camera;
use viva_genicam::genapi::RegisterIo;

use crate::rig::WallClock;

/// Quartzes differ by less, relatively.
const DRIFT: f64 = 1e-4;

/// Seconds after which the camera is asked again.
const AGE: f64 = 10.0;

/// The names of the latch, by SFNC 2 and by GigE Vision 1, with the unit of SFNC's.
const LATCHES: [(&str, &str, Option<f64>); 2] = [
    ("TimestampLatch", "TimestampLatchValue", Some(1e9)),
    ("GevTimestampControlLatch", "GevTimestampValue", None),
];

/// One look at both clocks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor {
    /// The camera's ticks then, and how many are a second.
    ticks: f64,
    per_second: f64,
    /// The rig's time then, and how far it may be off.
    time: f64,
    error: f64,
}

impl Anchor {
    /// Asks the camera for its time. None where it cannot tell.
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

    /// Whether it is too old at this time.
    pub(super) fn is_old(&self, now: f64) -> bool {
        now - self.time > AGE
    }

    /// The rig's time of a stamp, and how far it may be off.
    pub(super) fn time_of(&self, stamp: u64) -> [f64; 2] {
        let since = (stamp as f64 - self.ticks) / self.per_second;
        [self.time + since, self.error + DRIFT * since.abs()]
    }
}

fn frequency<T: RegisterIo>(camera: &Camera<T>) -> Option<f64> {
    let ticks = camera.get_integer("GevTimestampTickFrequency").ok()?;
    (ticks > 0).then_some(ticks as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_is_told_in_the_rigs_time_with_what_quartzes_do() {
        let anchor = Anchor { ticks: 5e9, per_second: 1e9, time: 100.0, error: 0.001 };
        let [time, error] = anchor.time_of(3_000_000_000);
        assert!((time - 98.0).abs() < 1e-9 && (error - 0.0012).abs() < 1e-12, "{time} ± {error}");
        assert!(anchor.is_old(111.0) && !anchor.is_old(109.0));
    }
}
