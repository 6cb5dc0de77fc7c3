//! The three handles of a virtual bench: all of one world.

use std::cell::RefCell;
use std::rc::Rc;

use super::world::World;
use crate::error::Result;
use crate::rig::{Camera, CameraInfo, Clock, Frame, Projector, ProjectorInfo, RawFrame, Shown};

pub(super) struct VirtualProjectorHandle {
    pub(super) info: ProjectorInfo,
    pub(super) world: Rc<RefCell<World>>,
}

pub(super) struct VirtualCameraHandle {
    pub(super) info: CameraInfo,
    /// Exposures are whole multiples of this many seconds; 0: any.
    pub(super) step: f64,
    pub(super) world: Rc<RefCell<World>>,
}

pub(super) struct VirtualClock {
    pub(super) world: Rc<RefCell<World>>,
}

impl Projector for VirtualProjectorHandle {
    fn info(&self) -> &ProjectorInfo {
        &self.info
    }

    fn show(&mut self, frame: &Frame) -> Result<Shown> {
        self.info.check(frame)?;
        Ok(Shown { at: self.world.borrow_mut().show(frame)? })
    }

    fn restore(&mut self, frame: &Frame) -> Result<Shown> {
        self.info.check(frame)?;
        Ok(Shown { at: self.world.borrow_mut().restore(frame)? })
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
            // To the nearest that is still in range.
            let [fewest, most] = [(shortest / self.step).ceil(), (longest / self.step).floor()];
            set = (exposure / self.step).round().clamp(fewest, most.max(fewest)) * self.step;
        }
        self.world.borrow_mut().exposure = set;
        Ok(set)
    }

    fn capture(&mut self) -> Result<Option<RawFrame>> {
        Ok(self.world.borrow_mut().capture())
    }

    fn restart(&mut self) -> Result<()> {
        self.world.borrow_mut().restart();
        Ok(())
    }
}

impl Clock for VirtualClock {
    fn now(&self) -> f64 {
        self.world.borrow().now
    }

    fn sleep(&mut self, seconds: f64) {
        self.world.borrow_mut().now += seconds.max(0.0);
    }
}
