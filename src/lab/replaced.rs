//! The run that a new one replaces waits in a separate folder until the new one is whole.

use std::path::{Path, PathBuf};

use super::layout::{RECORD, REPORT, journal_folder, photos_in};
use crate::error::{Error, Result};
use crate::io::model;

/// A run that was moved aside, into `earlier-N` of its folder.
pub(super) struct Replaced {
    run: PathBuf,
    aside: PathBuf,
}

impl Replaced {
    /// Moves the photos, the model, the record and the report of the run aside.
    ///
    /// # Errors
    /// [`Error::Write`]; then everything is where it was.
    pub(super) fn move_aside(run: &Path) -> Result<Self> {
        let aside =
            (1..).map(|number: u32| run.join(format!("earlier-{number}"))).find(|path| !path.exists());
        let replaced = Self { run: run.to_path_buf(), aside: aside.unwrap_or_else(|| run.join("earlier")) };
        std::fs::create_dir(&replaced.aside).map_err(Error::writing(&replaced.aside))?;
        for part in parts(run) {
            let moved = replaced.aside.join(part.file_name().unwrap_or_default());
            if let Err(error) = std::fs::rename(&part, moved) {
                replaced.restore()?;
                return Err(Error::writing(&part)(error));
            }
        }
        Ok(replaced)
    }

    /// Photos of the run that was moved aside.
    pub(super) fn photos(&self) -> usize {
        photos_in(&self.aside)
    }

    /// Where the run is now.
    pub(super) fn path(&self) -> &Path {
        &self.aside
    }

    /// Deletes it: the new run is whole.
    pub(super) fn discard(self) -> Result<()> {
        std::fs::remove_dir_all(&self.aside).map_err(Error::writing(&self.aside))
    }

    /// Puts it back in place of a run that has no photos.
    pub(super) fn restore(&self) -> Result<()> {
        for part in parts(&self.aside) {
            let place = self.run.join(part.file_name().unwrap_or_default());
            let freed = match std::fs::symlink_metadata(&place) {
                Ok(there) if there.is_dir() => std::fs::remove_dir_all(&place),
                Ok(_) => std::fs::remove_file(&place),
                Err(_) => Ok(()),
            };
            freed.and_then(|()| std::fs::rename(&part, &place)).map_err(Error::writing(&place))?;
        }
        std::fs::remove_dir(&self.aside).map_err(Error::writing(&self.aside))
    }
}

/// What there is of a run in its folder. Other files are replaced one by one when the new run writes its own.
fn parts(run: &Path) -> impl Iterator<Item = PathBuf> {
    let parts = [journal_folder(run), model::folder(run), run.join(REPORT), run.join(RECORD)];
    parts.into_iter().filter(|part| std::fs::symlink_metadata(part).is_ok())
}
