//! A warning, before tracing, that photos will be black.

use super::{Lab, Log};
use crate::observer::Level;
use crate::scene::view::reason_for_darkness;

impl Lab {
    /// Warns if the photos of a scene will be black or nearly so, and gives the reason.
    pub(super) fn warn_of_darkness(&self) {
        let Ok(source) = self.scene_source() else { return };
        let scene = &source.scene;
        if let Some(reason) = reason_for_darkness(scene, source.settings.resolution) {
            let message = format!("warning: {}: {reason}", scene.path.display());
            self.observer.log(Level::Warning, &message);
        }
    }
}
