//! A lamp that drifts: the sentinel is a white frame, shot again every so many photos. What it says of the lamp's light
//! relative to the first white photo divides the photos.
//!
//! A photo must be of use at once, so the light at its time is extrapolated from the last two sentinels (interpolated, where a
//! photo out of a journal lies between two). Times are those of the frames themselves, so a replay corrects
//! alike.

/// The light of the lamp over time, as far as it is known.
#[derive(Clone, Debug, Default)]
pub(super) struct Drift {
    /// Time on the rig's clock, and light relative to the reference.
    sentinels: Vec<[f64; 2]>,
}

/// The drift that was seen.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct DriftReport {
    /// Each sentinel's time on the rig's clock in seconds, and the lamp's light relative to the first white photo.
    pub sentinels: Vec<[f64; 2]>,
    /// The largest relative change from the first.
    pub largest: f64,
}

impl Drift {
    /// Begins with the white photo itself.
    pub(super) fn new(started: f64) -> Self {
        Self { sentinels: vec![[started, 1.0]] }
    }

    /// A sentinel says this of the lamp's light, relative to the first white photo.
    pub(super) fn add(&mut self, started: f64, light: f64) {
        let at = self.sentinels.partition_point(|&[time, _]| time <= started);
        self.sentinels.insert(at, [started, light]);
    }

    /// Sentinels so far, the first white photo not counted.
    pub(super) fn count(&self) -> usize {
        self.sentinels.len().saturating_sub(1)
    }

    /// The lamp's light at this time, relative to the first white photo.
    pub(super) fn light(&self, time: f64) -> f64 {
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
        // No further beyond the last than one interval: a line is not to be trusted for long.
        let share = ((time - from) / (to - from)).min(2.0);
        first + (second - first) * share
    }

    /// What was seen.
    pub(super) fn report(&self) -> DriftReport {
        let largest = self.sentinels.iter().map(|[_, light]| (light - 1.0).abs()).fold(0.0, f64::max);
        DriftReport { sentinels: self.sentinels.clone(), largest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_two_sentinels_light_is_interpolated_and_after_them_extrapolated() {
        let mut drift = Drift::new(10.0);
        assert_eq!(drift.light(99.0), 1.0);
        drift.add(20.0, 1.1);
        let close = |time: f64, light: f64| assert!((drift.light(time) - light).abs() < 1e-12, "{time}");
        close(5.0, 1.0);
        close(15.0, 1.05);
        close(25.0, 1.15);
        // One interval beyond, not more.
        close(30.0, 1.2);
        close(80.0, 1.2);
        assert_eq!(drift.report().sentinels, [[10.0, 1.0], [20.0, 1.1]]);
    }
}
