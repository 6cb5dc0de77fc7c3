//! What time does to a virtual rig: which light is on, how bright, and which frame comes.
//!
//! Its state is the clock, what is on screen since when, and the number of the last frame. Everything else is a function
//! of the rig's description, the frame's number and the time, so that a bench that is opened after a
//! [`Stamp`](crate::rig::Stamp) goes on as if it had never been closed.

use std::collections::VecDeque;

use super::VirtualRig;
use super::faults::Fate;
use super::screen::Screen;
use super::sensor::Sensor;
use super::view::{SeenLight, View};
use crate::error::Result;
use crate::image::Resolution;
use crate::rig::{Frame, RawFrame};

/// Changes that the screen's history holds. Late frames look back by one.
const HISTORY: usize = 8;

/// A frame that was put on screen.
pub(super) struct Change {
    /// When it was asked for, in seconds.
    pub(super) asked: f64,
    /// When it was confirmed.
    pub(super) confirmed: f64,
    /// When its light is there.
    pub(super) appears: f64,
    /// Its light on the sensor.
    pub(super) light: SeenLight,
}

/// A virtual rig at work.
pub(super) struct World {
    pub(super) rig: VirtualRig,
    pub(super) camera: Resolution,
    pub(super) view: View,
    pub(super) screen: Screen,
    pub(super) sensor: Sensor,
    /// The scene's own light, and the light of an ambient level of 1.
    pub(super) own_light: SeenLight,
    pub(super) ambient_unit: f64,
    /// Seconds.
    pub(super) exposure: f64,
    /// Seconds on the rig's clock.
    pub(super) now: f64,
    /// The camera's number of its last frame.
    pub(super) id: u64,
    /// What was shown, the latest last; never empty.
    pub(super) changes: VecDeque<Change>,
    /// The frame handed out last; not known to a bench that was opened after it.
    pub(super) handed_out: Option<RawFrame>,
    /// The number of the last frame before the camera was restarted.
    pub(super) restarted_at: Option<u64>,
}

impl World {
    /// Shows a frame, which fits the screen; the time of its confirmation.
    pub(super) fn show(&mut self, frame: &Frame) -> Result<f64> {
        let light = self.view.lit_by(&self.screen.emit(frame))?;
        let asked = self.now;
        self.now += self.rig.projector.frame_time;
        let (confirmed, appears) = (self.now, self.now + self.rig.projector.latency);
        self.changes.push_back(Change { asked, confirmed, appears, light });
        if self.changes.len() > HISTORY {
            self.changes.pop_front();
        }
        Ok(confirmed)
    }

    /// Puts a frame on screen as if it had been there from the beginning.
    pub(super) fn restore(&mut self, frame: &Frame) -> Result<f64> {
        let light = self.view.lit_by(&self.screen.emit(frame))?;
        self.changes.clear();
        self.changes.push_back(Change { asked: 0.0, confirmed: 0.0, appears: f64::NEG_INFINITY, light });
        Ok(0.0)
    }

    /// Takes a frame.
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
            // It lay waiting, and takes no time.
            Fate::Late => asked - exposure,
            Fate::Early => confirmed,
            Fate::Good | Fate::Dropped | Fate::Repeated => self.now,
        };
        if fate != Fate::Late {
            self.now += exposure;
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

    /// Wakes a camera that hangs.
    pub(super) fn restart(&mut self) {
        self.now += self.rig.camera.timeout;
        if !self.rig.faults.freeze_for_good {
            self.restarted_at = Some(self.id);
        }
    }

    /// The mean light on the sensor while an exposure lasts.
    fn light_during(&self, started: f64, exposure: f64) -> SeenLight {
        let ended = started + exposure;
        let middle = started + 0.5 * exposure;
        let brightness = self.brightness(middle, exposure);
        let ambient = self.ambient(middle, exposure);
        let mut light = self.own_light.clone();
        light.iter_mut().flatten().for_each(|value| *value += ambient);
        for (index, change) in self.changes.iter().enumerate() {
            // The oldest that is known was there before.
            let from = if index == 0 { started } else { change.appears.clamp(started, ended) };
            let until = self.changes.get(index + 1).map_or(ended, |next| next.appears.clamp(started, ended));
            if until > from {
                let share = brightness * ((until - from) / exposure);
                for (value, shown) in light.iter_mut().flatten().zip(change.light.iter().flatten()) {
                    *value += share * shown;
                }
            }
        }
        light
    }

    /// The projector's light relative to that at the beginning, on average while an exposure lasts.
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

/// The mean of `sin(2π t / period)` over an exposure about `middle`; 0 without a period.
fn mean_sine(period: f64, middle: f64, exposure: f64) -> f64 {
    if period == 0.0 {
        return 0.0;
    }
    let half = std::f64::consts::PI * exposure / period;
    (std::f64::consts::TAU * middle / period).sin() * half.sin() / half
}
