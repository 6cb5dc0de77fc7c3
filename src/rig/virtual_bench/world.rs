//! The state of a virtual rig and its changes with time: the light on the sensor, the projector's brightness, and the next frame.
//!
//! The state consists of the time, the history of the screen, and the number of the last frame. All other values are functions of the rig's
//! description, the frame's number and the time. Therefore a rig that is opened after a [`Stamp`](crate::rig::Stamp) continues as if it had
//! never been closed.

use std::collections::VecDeque;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::Deserialize;

use super::light::{VirtualScreen, VirtualSensor};
use super::optics::{SeenLight, View};
use super::spec::{Faults, VirtualRig};
use crate::error::Result;
use crate::image::Resolution;
use crate::rig::{Frame, RawFrame};

/// The number of changes in the screen's history. Late frames look back by one change.
const HISTORY: usize = 8;

pub(crate) struct Change {
    /// The time of the request, in seconds.
    pub(crate) asked: f64,
    pub(crate) confirmed: f64,
    pub(crate) appears: f64,
    /// The new frame's light on the sensor: one entry for all colours, or three for red, green and blue if a wheel shows them in turn.
    pub(crate) light: Vec<SeenLight>,
    /// The brightness of the iris when the light appears, and the brightness that it approaches.
    pub(crate) iris: [f64; 2],
}

pub(crate) struct VirtualWorld {
    pub(crate) rig: VirtualRig,
    pub(crate) camera: Resolution,
    pub(crate) view: View,
    pub(crate) screen: VirtualScreen,
    pub(crate) sensor: VirtualSensor,
    pub(crate) own_light: SeenLight,
    /// The light on the sensor at an ambient level of 1.
    pub(crate) ambient_unit: f64,
    pub(crate) exposure: f64,
    /// The time on the rig's clock, in seconds.
    pub(crate) now: f64,
    pub(crate) id: u64,
    /// The history of the screen, with the latest change last. It is never empty.
    pub(crate) changes: VecDeque<Change>,
    /// The frame that the camera returned last. `None` before the first frame of a session.
    pub(crate) handed_out: Option<RawFrame>,
    pub(crate) restarted_at: Option<u64>,
}

impl VirtualWorld {
    /// Shows a frame, which must fit the screen, and returns the time of the confirmation.
    pub(crate) fn show(&mut self, frame: &Frame) -> Result<f64> {
        let light = self.light_of(frame)?;
        let asked = self.now;
        self.now += self.rig.projector.frame_time;
        let (confirmed, appears) = (self.now, self.now + self.rig.projector.latency);
        let target = self.rig.projector.iris.target(self.screen.mean(frame));
        let start = self.changes.back().map_or(target, |last| {
            self.rig.projector.iris.after(last.iris, (appears - last.appears).max(0.0))
        });
        self.changes.push_back(Change { asked, confirmed, appears, light, iris: [start, target] });
        if self.changes.len() > HISTORY {
            self.changes.pop_front();
        }
        Ok(confirmed)
    }

    /// Puts a frame on screen as if it had been there from the beginning, and returns the time of the confirmation.
    pub(crate) fn restore(&mut self, frame: &Frame) -> Result<f64> {
        let light = self.light_of(frame)?;
        let iris = [self.rig.projector.iris.target(self.screen.mean(frame)); 2];
        self.changes.clear();
        self.changes.push_back(Change {
            asked: 0.0,
            confirmed: 0.0,
            appears: f64::NEG_INFINITY,
            light,
            iris,
        });
        Ok(0.0)
    }

    /// The light of a frame on the sensor, for each colour of the wheel.
    fn light_of(&mut self, frame: &Frame) -> Result<Vec<SeenLight>> {
        let pattern = self.screen.emit(frame);
        if !self.rig.projector.pulse.wheel {
            return Ok(vec![self.view.lit_by(&pattern)?]);
        }
        (0..pattern.channels())
            .map(|colour| {
                let mut alone = pattern.clone();
                let others = alone.samples_mut().iter_mut().enumerate();
                others.filter(|(sample, _)| sample % 3 != colour).for_each(|(_, value)| *value = 0.0);
                self.view.lit_by(&alone)
            })
            .collect()
    }

    pub(crate) fn capture(&mut self) -> Option<RawFrame> {
        let (exposure, camera) = (self.exposure, &self.rig.camera);
        let (readout, timeout) = (camera.readout, camera.timeout);
        if self.rig.faults.freeze_after.contains(&self.id) && self.restarted_at != Some(self.id) {
            self.now += timeout;
            return None;
        }
        self.id += 1;
        let fate = self.rig.faults.fate(self.rig.seed, self.id);
        let (asked, confirmed) = self.changes.back().map_or((0.0, 0.0), |last| (last.asked, last.confirmed));
        let started = match fate {
            // A late frame was waiting in a buffer, so no time passes.
            Fate::Late => asked - exposure - camera.rolling_shutter,
            Fate::Early => confirmed,
            Fate::Good | Fate::Dropped | Fate::Repeated => self.now,
        };
        if fate != Fate::Late {
            self.now += exposure + camera.rolling_shutter;
        }
        self.now += readout;
        match fate {
            Fate::Dropped => {
                self.now += timeout;
                None
            }
            Fate::Repeated => self.handed_out.clone(),
            Fate::Good | Fate::Late | Fate::Early => {
                let counts = self.sensor.expose(&self.light_during(started, exposure), exposure, self.id);
                let (resolution, channels) = (self.camera, camera.channels);
                let frame = RawFrame { resolution, channels, counts, exposure, id: self.id, started };
                self.handed_out = Some(frame.clone());
                Some(frame)
            }
        }
    }

    /// Restarts the camera. This ends a hang unless the hang is permanent.
    pub(crate) fn restart(&mut self) {
        self.now += self.rig.camera.timeout;
        if !self.rig.faults.freeze_for_good {
            self.restarted_at = Some(self.id);
        }
    }

    /// The mean light on the sensor during an exposure whose first row begins at `started`.
    fn light_during(&self, started: f64, exposure: f64) -> SeenLight {
        let mut light = self.own_light.clone();
        let rolling = self.rig.camera.rolling_shutter;
        let rows = if rolling == 0.0 { 1 } else { self.camera.height };
        let length = self.camera.pixels() / rows;
        for row in 0..rows {
            let begins = started + rolling * row as f64 / (rows - 1).max(1) as f64;
            let pixels = row * length..(row + 1) * length;
            let ambient = self.ambient(begins + 0.5 * exposure, exposure);
            for plane in &mut light {
                plane[pixels.clone()].iter_mut().for_each(|value| *value += ambient);
            }
            for (shown, share) in self.shares(begins, exposure) {
                for (plane, shown) in light.iter_mut().zip(shown) {
                    let values = plane[pixels.clone()].iter_mut().zip(&shown[pixels.clone()]);
                    values.for_each(|(value, shown)| *value += share * shown);
                }
            }
        }
        light
    }

    fn shares(&self, started: f64, exposure: f64) -> Vec<(&SeenLight, f64)> {
        let (ended, projector) = (started + exposure, &self.rig.projector);
        let brightness = self.brightness(started + 0.5 * exposure, exposure);
        let mut shares = Vec::new();
        for (index, change) in self.changes.iter().enumerate() {
            // The oldest known frame was on screen before the exposure began.
            let from = if index == 0 { started } else { change.appears.clamp(started, ended) };
            let until = self.changes.get(index + 1).map_or(ended, |next| next.appears.clamp(started, ended));
            if until > from {
                let iris = projector.iris.mean(change.iris, from - change.appears, until - change.appears);
                let share = brightness * iris * ((until - from) / exposure);
                let pulsed = change.light.iter().enumerate();
                shares.extend(
                    pulsed.map(|(colour, light)| (light, share * projector.pulse.mean(colour, from, until))),
                );
            }
        }
        shares
    }

    /// The projector's mean brightness during an exposure, relative to its brightness at time 0.
    fn brightness(&self, middle: f64, exposure: f64) -> f64 {
        let drift = &self.rig.drift;
        let trend = (1.0 + drift.per_hour * middle / 3600.0).max(0.0);
        trend * (1.0 + drift.swing * mean_sine(drift.period, middle, exposure))
    }

    fn ambient(&self, middle: f64, exposure: f64) -> f64 {
        let ambient = &self.rig.ambient;
        let swing = ambient.variation * mean_sine(ambient.period, middle, exposure);
        self.ambient_unit * ambient.level * (1.0 + swing)
    }
}

/// The mean of `sin(2π t / period)` over an exposure centred at `middle`; 0 if the period is 0.
fn mean_sine(period: f64, middle: f64, exposure: f64) -> f64 {
    if period == 0.0 {
        return 0.0;
    }
    let half = std::f64::consts::PI * exposure / period;
    (std::f64::consts::TAU * middle / period).sin() * half.sin() / half
}

/// An automatic iris, or a lamp that follows the picture. A frame with mean light `m`, relative to white, is shown with the brightness
/// `1 − dimming · (1 − m)`. The iris approaches this brightness exponentially after the frame appears. When the rig is opened or reopened,
/// the frame on screen has been there for a long time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Iris {
    /// The fraction by which an almost black frame is dimmer than white; 0: no iris. With a negative value, dark frames are brighter, as
    /// with a projector that limits the power of bright frames.
    pub dimming: f64,
    /// The time constant of the approach in seconds; 0: immediate.
    pub time: f64,
}

impl Iris {
    /// The brightness that the iris approaches for a frame of this mean light.
    pub(crate) fn target(&self, mean: f64) -> f64 {
        1.0 - self.dimming * (1.0 - mean)
    }

    /// The brightness `seconds` after a frame appeared. The brightness was `start` when the frame appeared, and approaches `target`.
    pub(crate) fn after(&self, [start, target]: [f64; 2], seconds: f64) -> f64 {
        if self.time == 0.0 { target } else { target + (start - target) * (-seconds / self.time).exp() }
    }

    /// The mean brightness from one time to a later time, both in seconds after the frame appeared.
    pub(crate) fn mean(&self, [start, target]: [f64; 2], from: f64, until: f64) -> f64 {
        if self.time == 0.0 || from.is_infinite() {
            return target;
        }
        let fall = |seconds: f64| (-seconds.max(0.0) / self.time).exp();
        target + (start - target) * self.time * (fall(from) - fall(until)) / (until - from)
    }
}

/// Light that is emitted in pulses with the same mean brightness as steady light. The light in an exposure depends on the time of the
/// exposure unless the exposure is a whole multiple of the period.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Pulse {
    /// The time in seconds from one pulse to the next, or of one turn of the colour wheel; 0: steady light.
    pub period: f64,
    /// The fraction of a pulse's time in which light is emitted; 1: light is emitted all the time.
    pub duty: f64,
    /// Whether a colour wheel shows red, green and blue in turn, each for a third of the period.
    pub wheel: bool,
}

impl Default for Pulse {
    fn default() -> Self {
        Self { period: 0.0, duty: 1.0, wheel: false }
    }
}

impl Pulse {
    /// The mean brightness of a colour between two times on the rig's clock, relative to steady light. `colour` is 0 without a wheel.
    pub(crate) fn mean(&self, colour: usize, from: f64, until: f64) -> f64 {
        if self.period == 0.0 {
            return 1.0;
        }
        let colours = if self.wheel { 3.0 } else { 1.0 };
        let begins = colour as f64 / colours;
        // The light emitted since time 0, divided by the light that a steady source emits in one period.
        let emitted = |time: f64| {
            let turns = time / self.period;
            turns.floor() + ((turns - turns.floor() - begins) * colours / self.duty).clamp(0.0, 1.0)
        };
        (emitted(until) - emitted(from)) * self.period / (until - from)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fate {
    Good,
    Dropped,
    /// The previous frame arrives again in place of this frame.
    Repeated,
    /// The frame was exposed before the last pattern was shown.
    Late,
    /// The exposure began as soon as the last pattern was confirmed.
    Early,
}

/// A random number generator for one purpose. Equal arguments give equal numbers.
pub(crate) fn generator(seed: u64, frame: u64, purpose: u64) -> Pcg64 {
    let mut key = [0; 32];
    for (word, value) in key.chunks_exact_mut(8).zip([seed, frame, purpose, 0x6b72_796c_7578]) {
        word.copy_from_slice(&value.to_le_bytes());
    }
    // The hash makes the seeds of neighbouring keys unrelated.
    Pcg64::from_seed(*blake3::hash(&key).as_bytes())
}

impl Faults {
    pub(crate) fn fate(&self, seed: u64, id: u64) -> Fate {
        let faults = [
            (&self.dropped_frames, self.dropped, Fate::Dropped),
            (&self.repeated_frames, self.repeated, Fate::Repeated),
            (&self.late_frames, self.late, Fate::Late),
            (&self.early_frames, self.early, Fate::Early),
        ];
        if let Some((.., fate)) = faults.iter().find(|(frames, ..)| frames.contains(&id)) {
            return *fate;
        }
        let mut chance: f64 = generator(seed, id, u64::MAX).random();
        for (_, share, fate) in faults {
            if chance < share {
                return fate;
            }
            chance -= share;
        }
        Fate::Good
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
        // The first interval is one period and the lit half of the next. The second interval is one period and a dark half.
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

    #[test]
    fn faults_have_their_probabilities_and_repeat_with_the_seed() {
        let faults = Faults { dropped: 0.1, repeated: 0.05, late: 0.2, ..Faults::default() };
        let fates: Vec<Fate> = (1..=20_000).map(|id| faults.fate(7, id)).collect();
        for (fate, share) in
            [(Fate::Dropped, 0.1), (Fate::Repeated, 0.05), (Fate::Late, 0.2), (Fate::Early, 0.0)]
        {
            let found = fates.iter().filter(|&&found| found == fate).count() as f64 / 2e4;
            // The bound is five standard errors of a binomial proportion.
            assert!((found - share).abs() <= 5.0 * (share * (1.0 - share) / 2e4).sqrt(), "{fate:?}: {found}");
        }
        assert!((1..=20_000).all(|id| faults.fate(7, id) == fates[id as usize - 1]));
        assert!((1..=20_000).any(|id| faults.fate(8, id) != fates[id as usize - 1]));
    }

    #[test]
    fn a_frame_given_by_its_number_always_fails() {
        let faults = Faults { dropped_frames: vec![3], repeated_frames: vec![5], ..Faults::default() };
        let fates: Vec<Fate> = (1..=5).map(|id| faults.fate(0, id)).collect();
        assert_eq!(fates, [Fate::Good, Fate::Good, Fate::Dropped, Fate::Good, Fate::Repeated]);
    }
}
