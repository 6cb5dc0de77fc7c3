//! The state of a virtual rig, and how it changes with time: the light on the sensor, its brightness, and the next frame.
//!
//! The state consists of the time, what has been on screen since when, and the number of the last frame. Everything else is a
//! function of the rig's description, the frame's number and the time. Therefore a rig that is opened after a
//! [`Stamp`](crate::rig::Stamp) continues as if it had never been closed.

use std::collections::VecDeque;

use super::VirtualRig;
use super::faults::Fate;
use super::screen::Screen;
use super::sensor::Sensor;
use super::view::{SeenLight, View};
use crate::error::Result;
use crate::image::Resolution;
use crate::rig::{Frame, RawFrame};

/// The number of changes that the screen's history holds. Late frames look back by one.
const HISTORY: usize = 8;

/// A frame that was put on screen.
pub(super) struct Change {
    /// When it was asked for, in seconds.
    pub(super) asked: f64,
    /// When it was confirmed.
    pub(super) confirmed: f64,
    /// When its light appears.
    pub(super) appears: f64,
    /// Its light on the sensor: all of it, or that of red, green and blue where a wheel shows them one after the other.
    pub(super) light: Vec<SeenLight>,
    /// The brightness that the iris has when the light appears, and the one that it tends to.
    pub(super) iris: [f64; 2],
}

/// An open virtual rig.
pub(super) struct World {
    pub(super) rig: VirtualRig,
    pub(super) camera: Resolution,
    pub(super) view: View,
    pub(super) screen: Screen,
    pub(super) sensor: Sensor,
    /// The scene's own light.
    pub(super) own_light: SeenLight,
    /// The light of an ambient level of 1.
    pub(super) ambient_unit: f64,
    /// The exposure in seconds.
    pub(super) exposure: f64,
    /// The time in seconds on the rig's clock.
    pub(super) now: f64,
    /// The number of the camera's last frame.
    pub(super) id: u64,
    /// The history of the screen, the latest change last; never empty.
    pub(super) changes: VecDeque<Change>,
    /// The frame that the camera returned last. `None` in a session that has none yet.
    pub(super) handed_out: Option<RawFrame>,
    /// The number of the last frame before the camera was restarted.
    pub(super) restarted_at: Option<u64>,
}

impl World {
    /// Shows a frame, which must fit the screen; returns the time of the confirmation.
    pub(super) fn show(&mut self, frame: &Frame) -> Result<f64> {
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

    /// Puts a frame on screen as if it had been there from the beginning; returns the time of the confirmation.
    pub(super) fn restore(&mut self, frame: &Frame) -> Result<f64> {
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

    /// The light of a frame on the sensor, by the colours of the wheel.
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

    /// Takes a frame. `None`: it does not arrive.
    pub(super) fn capture(&mut self) -> Option<RawFrame> {
        let (exposure, camera) = (self.exposure, &self.rig.camera);
        let (readout, timeout) = (camera.readout, camera.timeout);
        if self.rig.faults.freezes_after(self.id) && self.restarted_at != Some(self.id) {
            self.now += timeout;
            return None;
        }
        self.id += 1;
        let fate = self.rig.faults.fate(self.rig.seed, self.id);
        let (asked, confirmed) = self.changes.back().map_or((0.0, 0.0), |last| (last.asked, last.confirmed));
        let started = match fate {
            // The frame was waiting in a buffer, and takes no time.
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

    /// Restarts the camera, which ends a hang unless it is for good.
    pub(super) fn restart(&mut self) {
        self.now += self.rig.camera.timeout;
        if !self.rig.faults.freeze_for_good {
            self.restarted_at = Some(self.id);
        }
    }

    /// The mean light on the sensor during an exposure, whose first row begins at `started`.
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

    /// The light of the frames that are on screen during an exposure, each with its share.
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

    /// The mean brightness of the projector during an exposure, relative to that at the beginning.
    fn brightness(&self, middle: f64, exposure: f64) -> f64 {
        let drift = &self.rig.drift;
        let trend = (1.0 + drift.per_hour * middle / 3600.0).max(0.0);
        trend * (1.0 + drift.swing * mean_sine(drift.period, middle, exposure))
    }

    /// The mean ambient light during an exposure.
    fn ambient(&self, middle: f64, exposure: f64) -> f64 {
        let ambient = &self.rig.ambient;
        let swing = ambient.variation * mean_sine(ambient.period, middle, exposure);
        self.ambient_unit * ambient.level * (1.0 + swing)
    }
}

/// The mean of `sin(2π t / period)` over an exposure with the centre `middle`; 0 if the period is 0.
fn mean_sine(period: f64, middle: f64, exposure: f64) -> f64 {
    if period == 0.0 {
        return 0.0;
    }
    let half = std::f64::consts::PI * exposure / period;
    (std::f64::consts::TAU * middle / period).sin() * half.sin() / half
}
