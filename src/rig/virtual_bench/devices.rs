//! The virtual projector, camera and clock: three handles on one simulated world.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::world::World;
use crate::error::Result;
use crate::rig::{Camera, CameraInfo, Clock, Frame, Projector, ProjectorInfo, RawFrame, Shown};

/// The world that the three handles share. Each handle may be on another thread.
pub(super) type SharedWorld = Arc<Mutex<World>>;

/// A thread that panicked while it held the world leaves a frame unfinished, but no inconsistent state.
fn locked(world: &SharedWorld) -> MutexGuard<'_, World> {
    world.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(super) struct VirtualProjectorHandle {
    pub(super) info: ProjectorInfo,
    pub(super) world: SharedWorld,
}

pub(super) struct VirtualCameraHandle {
    pub(super) info: CameraInfo,
    /// Exposures are whole multiples of this many seconds; 0: any.
    pub(super) step: f64,
    pub(super) world: SharedWorld,
}

pub(super) struct VirtualClock {
    pub(super) world: SharedWorld,
}

impl Projector for VirtualProjectorHandle {
    fn info(&self) -> &ProjectorInfo {
        &self.info
    }

    fn show(&mut self, frame: &Frame) -> Result<Shown> {
        self.info.check(frame)?;
        Ok(Shown { at: locked(&self.world).show(frame)? })
    }

    fn restore(&mut self, frame: &Frame) -> Result<Shown> {
        self.info.check(frame)?;
        Ok(Shown { at: locked(&self.world).restore(frame)? })
    }
}

impl Camera for VirtualCameraHandle {
    fn info(&self) -> &CameraInfo {
        &self.info
    }

    fn configure(&mut self, exposure: f64) -> Result<f64> {
        self.info.check_exposure(exposure)?;
        let [shortest, longest] = self.info.exposures;
        let mut set = exposure;
        if self.step > 0.0 {
            // The nearest multiple that is in range.
            let [fewest, most] = [(shortest / self.step).ceil(), (longest / self.step).floor()];
            set = (exposure / self.step).round().clamp(fewest, most.max(fewest)) * self.step;
        }
        locked(&self.world).exposure = set;
        Ok(set)
    }

    fn capture(&mut self) -> Result<Option<RawFrame>> {
        Ok(locked(&self.world).capture())
    }

    fn restart(&mut self) -> Result<()> {
        locked(&self.world).restart();
        Ok(())
    }
}

impl Clock for VirtualClock {
    fn now(&self) -> f64 {
        locked(&self.world).now
    }

    fn sleep(&mut self, seconds: f64) {
        locked(&self.world).now += seconds.max(0.0);
    }
}
