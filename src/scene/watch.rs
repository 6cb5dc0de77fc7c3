//! Progress of loading, and whether to go on.

use std::fmt;
use std::ops::ControlFlow;

use crate::error::{Error, Result};

/// After how many triangles or lines the watcher is told again: a fraction of a second.
const RHYTHM: usize = 1 << 16;

/// Receives the progress of loading a scene, and decides whether it goes on. The default does nothing.
#[derive(Clone, Copy, Default)]
pub struct Watcher<'a>(Option<&'a dyn Fn(f32) -> ControlFlow<()>>);

impl<'a> Watcher<'a> {
    /// Calls `told` now and then with the share of the work that is done. [`ControlFlow::Break`] ends loading with [`Error::Interrupted`].
    pub fn new(told: &'a dyn Fn(f32) -> ControlFlow<()>) -> Self {
        Self(Some(told))
    }

    /// Tells that this share is done.
    pub(super) fn tell(self, share: f32) -> Result<()> {
        match self.0.map(|told| told(share.clamp(0.0, 1.0))) {
            Some(ControlFlow::Break(())) => Err(Error::Interrupted),
            _ => Ok(()),
        }
    }

    /// Tells the share `share()` at every 65,536th of the things that are counted by `count`.
    pub(super) fn count(self, count: usize, share: impl FnOnce() -> f32) -> Result<()> {
        if count.is_multiple_of(RHYTHM) { self.tell(share()) } else { Ok(()) }
    }
}

impl fmt::Debug for Watcher<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Watcher" } else { "none" })
    }
}
