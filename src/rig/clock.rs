//! The wall's clock, as hardware lives by it.

use std::time::{Duration, Instant};

use super::Clock;

/// Seconds of the wall's clock, from a given moment on. Copies tell the same time.
#[derive(Clone, Copy, Debug)]
pub struct WallClock {
    origin: Instant,
    /// What it told at the origin.
    start: f64,
}

impl WallClock {
    /// A clock that tells `start` seconds now.
    pub fn starting_at(start: f64) -> Self {
        Self { origin: Instant::now(), start }
    }

    /// The seconds that it tells.
    pub fn seconds(&self) -> f64 {
        self.start + self.origin.elapsed().as_secs_f64()
    }
}

impl Clock for WallClock {
    fn now(&self) -> f64 {
        self.seconds()
    }

    fn sleep(&mut self, seconds: f64) {
        if let Ok(time) = Duration::try_from_secs_f64(seconds) {
            std::thread::sleep(time);
        }
    }
}
