//! The substitute for an X server in a krylux that was built without the feature `x11`. Every request is an error that names the feature.

use super::fault;
use crate::error::{Error, Result};
use crate::rig::Frame;
use crate::rig::x11::projector::ShowTimes;
use crate::rig::x11::{MonitorInfo, X11Spec};

/// The screen cannot be opened, so this type has no values.
pub(crate) enum Screen {}

impl Screen {
    pub(crate) fn open(_: &X11Spec) -> Result<Self> {
        Err(not_built())
    }

    pub(crate) fn monitor(&self) -> &MonitorInfo {
        match *self {}
    }

    pub(crate) fn show(&mut self, _: &Frame) -> Result<ShowTimes> {
        match *self {}
    }

    pub(crate) fn confirm(&mut self) -> Result<()> {
        match *self {}
    }
}

impl X11Spec {
    /// Fails with [`Error::Rig`], because this krylux was built without X11.
    pub fn monitor(&self) -> Result<MonitorInfo> {
        Err(not_built())
    }
}

/// Fails with [`Error::Rig`], because this krylux was built without X11.
pub fn monitors(_: Option<&str>) -> Result<Vec<MonitorInfo>> {
    Err(not_built())
}

fn not_built() -> Error {
    fault("this krylux was built without projectors on X11", "build it with --features x11, on Linux")
}
