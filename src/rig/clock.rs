//! The clock of hardware: real time.

use std::time::Instant;

use super::Clock;

/// Real time in seconds, from a given moment on. Copies tell the same time.
#[derive(Clone, Copy, Debug)]
pub struct WallClock {
    origin: Instant,
    /// The time that it told at the origin, in seconds.
    start: f64,
}

impl WallClock {
    /// A clock that tells `start` seconds now.
    pub fn starting_at(start: f64) -> Self {
        Self { origin: Instant::now(), start }
    }

    /// The time now, in seconds.
    pub fn seconds(&self) -> f64 {
        self.start + self.origin.elapsed().as_secs_f64()
    }
}

impl Clock for WallClock {
    fn now(&self) -> f64 {
        self.seconds()
    }
}
