//! The folder that a run leaves behind, with its record.

use std::path::{Path, PathBuf};
use std::time::Instant;

use super::notes::journal_folder;
use super::{Log, SharedObserver};
use crate::error::{Error, Result};
use crate::io::manifest::Status;
use crate::journal::Journal;
use crate::measure::RunManifest;

/// What a run says of itself.
pub(super) const RECORD: &str = "run.json";

/// Which folder a run uses.
#[derive(Clone, Debug, Default)]
pub struct RunOptions {
    /// The folder; where none is named, the first free one of `out/NAME`, `out/NAME-2`, …
    pub folder: Option<PathBuf>,
    /// Use a folder that holds an earlier run, and discard the photos of that run.
    pub overwrite: bool,
    /// Go on with the run in the folder: no photo that is in its journal is taken again.
    pub resume: bool,
}

/// An open run: the folder is there and writable before any work starts, and its record says `running` until the end.
pub struct RunFolder {
    /// The folder.
    pub path: PathBuf,
    /// The record.
    pub manifest: RunManifest,
    pub(super) resumes: bool,
    started: Instant,
}

impl RunFolder {
    /// Makes the folder. A run that is to be resumed is in the folder named, or in `out/NAME`.
    ///
    /// # Errors
    /// [`Error::Option`] when it holds an earlier run that is not to be overwritten; [`Error::Write`].
    pub fn create(options: &RunOptions, name: &str, observer: &SharedObserver) -> Result<Self> {
        let RunOptions { overwrite, resume, .. } = *options;
        let path = match &options.folder {
            Some(path) if holds_run(path) && !overwrite && !resume => {
                return Err(Error::Option {
                    option: "-o".into(),
                    fault: format!("{} already holds a run", path.display()),
                    help: "go on with it by --resume, name another folder, or add --overwrite".into(),
                });
            }
            Some(path) => path.clone(),
            None if resume => numbered(name, 1),
            None => free(name),
        };
        std::fs::create_dir_all(&path).map_err(Error::writing(&path))?;
        if overwrite {
            let photos = Journal::discard(&journal_folder(&path))?;
            if photos > 0 {
                observer.note(format_args!(
                    "note: --overwrite throws away {photos} photos of the run in {}",
                    path.display()
                ));
            }
        }
        let manifest = RunManifest::new(std::env::args());
        manifest.write(&path.join(RECORD))?;
        Ok(Self { path, manifest, started: Instant::now(), resumes: resume })
    }

    /// Seconds since the run started.
    pub fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Writes how the run ended: well, with a sentence that says so, or by an error.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn close(&mut self, outcome: std::result::Result<&str, &Error>) -> Result<()> {
        match outcome {
            Ok(message) => self.manifest.finish(Status::Done, message),
            Err(Error::Interrupted) => {
                self.manifest.finish(Status::Interrupted, Error::Interrupted.to_string());
            }
            Err(error) => self.manifest.finish(Status::Failed, error.to_string()),
        }
        self.manifest.write(&self.path.join(RECORD))
    }
}

fn free(name: &str) -> PathBuf {
    // Numbers do not run out before the disk does.
    (1..)
        .map(|number| numbered(name, number))
        .find(|path| !path.exists())
        .unwrap_or_else(|| numbered(name, 1))
}

fn numbered(name: &str, number: u32) -> PathBuf {
    match number {
        1 => PathBuf::from(format!("out/{name}")),
        _ => PathBuf::from(format!("out/{name}-{number}")),
    }
}

/// Whether there is a run that a new one would replace.
fn holds_run(path: &Path) -> bool {
    path.join(RECORD).exists() || Journal::is_in(&journal_folder(path))
}
