//! The data of a rig that a run and its journal keep. They suffice for a replay.

use std::path::Path;

use super::RigSource;
use crate::error::{Error, Result};
use crate::io::manifest;
use crate::journal::Journal;
use crate::lab::layout::calibration_folder;
use crate::lab::notes::{self, Kind, SourceNote};
use crate::measure::{Calibration, RigFile, RunManifest};
use crate::transport::Channels;

impl RigSource {
    /// Stores beside the journal in `folder` the data of the rig that a replay needs: its note, its file and its calibration.
    pub(in crate::lab) fn keep(&self, folder: &Path, journal: &mut Journal) -> Result<()> {
        let path = &self.file.path;
        let bytes = match &self.program.text {
            Some(text) => text.clone().into_bytes(),
            None => crate::file::read(path)?,
        };
        if RigFile::from_bytes(path, &bytes)? != self.file {
            return Err(Error::data(
                &path,
                "the file is not what the rig was opened by, and a run keeps the file",
            )
            .help("open the rig by the file as it is, or take its photos without a folder for the run"));
        }
        journal.note(notes::RIG_FILE, &bytes)?;
        let calibration = calibration_folder(folder);
        let is_kept =
            Calibration::load(&calibration).is_ok_and(|kept| kept.identity() == self.calibration.identity());
        if !is_kept {
            self.calibration.save(&calibration)?;
        }
        Ok(())
    }

    pub(in crate::lab) fn note(&self, channels: Channels) -> SourceNote {
        SourceNote {
            kind: Kind::Rig,
            name: self.name(),
            path: self.file.path.clone(),
            hash: blake3::Hash::from_bytes(self.file.hash).to_string(),
            photos: self.resolution(),
            patterns: self.resolution(),
            symmetric: self.is_symmetric(),
            channels: channels.count(),
        }
    }

    pub(in crate::lab) fn describe(&self, manifest: &mut RunManifest) {
        let hash = blake3::Hash::from_bytes(self.file.hash).to_string();
        if let Some(scene) = &self.scene {
            scene.describe(manifest);
        }
        manifest.scene = Some(manifest::SourceFile { path: (&self.file.path).into(), hash });
    }
}
