//! The drift stage: photos are divided by the brightness of the lamp, which sentinels measure.
//!
//! A sentinel is a photo of white that is repeated after a fixed number of patterns. The brightness of the
//! lamp is its light relative to the first white photo. A photo is corrected as soon as it is taken, so the
//! brightness at its time is extrapolated from the last two sentinels. For a replayed photo between two
//! sentinels it is interpolated. Times are those of the frames, so that a replay makes the same corrections.

/// The brightness of the lamp over time, as far as it is known.
#[derive(Clone, Debug, Default)]
pub(crate) struct Drift {
    /// Times in seconds on the rig's clock, and brightnesses relative to the first white photo.
    sentinels: Vec<[f64; 2]>,
    /// The largest standard error of a brightness.
    error: f64,
}

/// The drift that was measured.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct DriftReport {
    /// The time of each sentinel in seconds on the rig's clock, and the brightness of the lamp relative to
    /// the first white photo.
    pub sentinels: Vec<[f64; 2]>,
    /// The largest relative change since the first white photo.
    pub largest: f64,
    /// The largest relative change from one photo of white to the next, and its standard error.
    pub step: [f64; 2],
}

impl Drift {
    /// The drift after the first white photo, which was taken at this time.
    pub(crate) fn new(started: f64) -> Self {
        Self { sentinels: vec![[started, 1.0]], error: 0.0 }
    }

    /// Adds a sentinel: its time, and the brightness of the lamp relative to the first white photo with its standard error.
    pub(crate) fn add(&mut self, started: f64, [light, error]: [f64; 2]) {
        self.error = self.error.max(error);
        let at = self.sentinels.partition_point(|&[time, _]| time <= started);
        self.sentinels.insert(at, [started, light]);
    }

    /// The brightness of the lamp at this time, relative to the first white photo.
    pub(crate) fn light(&self, time: f64) -> f64 {
        let after = self.sentinels.partition_point(|&[at, _]| at <= time);
        let pair = match (self.sentinels.len(), after) {
            (0, _) => return 1.0,
            (1, _) => return self.sentinels[0][1],
            (_, 0) => return self.sentinels[0][1],
            (count, after) => after.min(count - 1),
        };
        let ([from, first], [to, second]) = (self.sentinels[pair - 1], self.sentinels[pair]);
        if to <= from {
            return second;
        }
        // The line is extrapolated by at most one interval.
        let share = ((time - from) / (to - from)).min(2.0);
        first + (second - first) * share
    }

    /// The drift so far.
    pub(crate) fn report(&self) -> DriftReport {
        let largest = self.sentinels.iter().map(|[_, light]| (light - 1.0).abs()).fold(0.0, f64::max);
        let changes = self.sentinels.windows(2).map(|pair| (pair[1][1] - pair[0][1]).abs());
        let step = [changes.fold(0.0, f64::max), std::f64::consts::SQRT_2 * self.error];
        DriftReport { sentinels: self.sentinels.clone(), largest, step }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_is_interpolated_between_sentinels_and_extrapolated_after_them() {
        let mut drift = Drift::new(10.0);
        assert_eq!(drift.light(99.0), 1.0);
        drift.add(20.0, [1.1, 0.01]);
        let close = |time: f64, light: f64| assert!((drift.light(time) - light).abs() < 1e-12, "{time}");
        close(5.0, 1.0);
        close(15.0, 1.05);
        close(25.0, 1.15);
        // One interval beyond the last sentinel, and not more.
        close(30.0, 1.2);
        close(80.0, 1.2);
        assert_eq!(drift.report().sentinels, [[10.0, 1.0], [20.0, 1.1]]);
        drift.add(30.0, [0.9, 0.02]);
        let [step, error] = drift.report().step;
        assert!((step - 0.2).abs() < 1e-12 && (error - 0.02 * 2.0_f64.sqrt()).abs() < 1e-12);
    }
}
