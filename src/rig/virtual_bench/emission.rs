//! How a projector's light changes with the frame that it shows and within the frame's time: automatic iris, and pulses.

use serde::Deserialize;

/// An automatic iris, or a lamp that follows the picture. A frame whose mean light is `m`, relative to white, is shown with the
/// brightness `1 − dimming · (1 − m)`, which is approached exponentially after the frame appears. The frame on screen when the rig is
/// opened, or opened again, has been there for long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Iris {
    /// The share by which an almost black frame is dimmer than white; 0: no iris. Less than 0: dark frames are brighter, as of a
    /// projector that limits the power of bright frames.
    pub dimming: f64,
    /// The time constant of the approach in seconds; 0: at once.
    pub time: f64,
}

impl Iris {
    /// The brightness that a frame of this mean light tends to.
    pub(super) fn target(&self, mean: f64) -> f64 {
        1.0 - self.dimming * (1.0 - mean)
    }

    /// The brightness `seconds` after a frame with the brightness `target` appeared. It was `start` then.
    pub(super) fn after(&self, [start, target]: [f64; 2], seconds: f64) -> f64 {
        if self.time == 0.0 { target } else { target + (start - target) * (-seconds / self.time).exp() }
    }

    /// The mean brightness from one time to a later one, both in seconds after the frame appeared.
    pub(super) fn mean(&self, [start, target]: [f64; 2], from: f64, until: f64) -> f64 {
        if self.time == 0.0 || from.is_infinite() {
            return target;
        }
        let fall = |seconds: f64| (-seconds.max(0.0) / self.time).exp();
        target + (start - target) * self.time * (fall(from) - fall(until)) / (until - from)
    }
}

/// Light that is emitted in pulses, of the same mean brightness as steady light. A frame's exposure sees another amount of light unless it
/// is a whole multiple of the period.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Pulse {
    /// The time from one pulse to the next in seconds, or of one turn of the colour wheel; 0: steady light.
    pub period: f64,
    /// The share of the time of its pulse in which light is emitted; 1: all of it.
    pub duty: f64,
    /// Whether a colour wheel shows red, green and blue one after the other, each in a third of the period.
    pub wheel: bool,
}

impl Default for Pulse {
    fn default() -> Self {
        Self { period: 0.0, duty: 1.0, wheel: false }
    }
}

impl Pulse {
    /// The mean brightness of a colour from one time to a later one, in seconds on the rig's clock, relative to steady light. `colour`
    /// is 0 without a wheel.
    pub(super) fn mean(&self, colour: usize, from: f64, until: f64) -> f64 {
        if self.period == 0.0 {
            return 1.0;
        }
        let colours = if self.wheel { 3.0 } else { 1.0 };
        let begins = colour as f64 / colours;
        // The light since time 0, in periods of steady light.
        let emitted = |time: f64| {
            let turns = time / self.period;
            turns.floor() + ((turns - turns.floor() - begins) * colours / self.duty).clamp(0.0, 1.0)
        };
        (emitted(until) - emitted(from)) * self.period / (until - from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulses_have_the_mean_of_steady_light_over_whole_periods_only() {
        let pulse = Pulse { period: 0.01, duty: 0.5, wheel: false };
        for start in [0.0, 0.0033, 0.0071] {
            assert!((pulse.mean(0, start, start + 0.02) - 1.0).abs() < 1e-9);
        }
        // One period and its lit half, or its dark half.
        assert!((pulse.mean(0, 0.0, 0.015) - 2.0 / 1.5).abs() < 1e-9);
        assert!((pulse.mean(0, 0.005, 0.020) - 1.0 / 1.5).abs() < 1e-9);
        let wheel = Pulse { period: 0.03, duty: 1.0, wheel: true };
        let third = |colour| wheel.mean(colour, 0.01, 0.02);
        assert!([third(0), third(1) - 3.0, third(2)].iter().all(|off| off.abs() < 1e-9));
    }

    #[test]
    fn an_iris_approaches_its_brightness_and_its_mean_is_the_integral() {
        let iris = Iris { dimming: 0.4, time: 0.5 };
        let ends = [1.0, iris.target(0.25)];
        assert!((ends[1] - 0.7).abs() < 1e-12);
        let steps = 10_000;
        let sum: f64 = (0..steps)
            .map(|step| iris.after(ends, 0.1 + 0.3 * (f64::from(step) + 0.5) / f64::from(steps)))
            .sum();
        assert!((iris.mean(ends, 0.1, 0.4) - sum / f64::from(steps)).abs() < 1e-8);
        assert_eq!(Iris { time: 0.0, ..iris }.mean(ends, 0.0, 0.1), ends[1]);
        assert_eq!(iris.mean(ends, f64::INFINITY, f64::INFINITY), ends[1], "a frame that was always there");
    }
}
