//! The folder that a run leaves behind, with its record.

use std::path::{Path, PathBuf};
use std::time::Instant;

use super::console::Console;
use super::light::Light;
use super::measured;
use super::options::RunArgs;
use crate::error::{Error, Result};
use crate::report::manifest::{self, Manifest, Status};

const RECORD: &str = "run.json";

/// An open run: the folder is there and writable before any work starts, and its record says `running` until the end.
pub(super) struct RunFolder {
    pub(super) path: PathBuf,
    pub(super) manifest: Manifest,
    started: Instant,
}

impl RunFolder {
    /// Makes the folder wanted, or, where the user named none, the first free one of `out/NAME`, `out/NAME-2`, …
    ///
    /// # Errors
    /// [`Error::Option`] when it holds an earlier run that is not to be overwritten; [`Error::Write`].
    pub(super) fn create(wanted: &RunArgs, name: &str) -> Result<Self> {
        let path = match &wanted.folder {
            Some(path) if path.join(RECORD).exists() && !wanted.overwrite => {
                return Err(Error::Option {
                    option: "-o".into(),
                    fault: format!("{} already holds a run", path.display()),
                    help: "name another folder, or add --overwrite".into(),
                });
            }
            Some(path) => path.clone(),
            None => free(name),
        };
        std::fs::create_dir_all(&path).map_err(Error::writing(&path))?;
        let manifest = Manifest::new(std::env::args());
        manifest.write(&path.join(RECORD))?;
        Ok(Self { path, manifest, started: Instant::now() })
    }

    /// Notes the file that a run depends on where there is no scene: a matrix.
    ///
    /// # Errors
    /// [`Error::Read`].
    pub(super) fn describe_file(&mut self, path: &Path) -> Result<()> {
        let bytes = std::fs::read(path).map_err(Error::reading(path))?;
        let hash = blake3::hash(&bytes).to_hex().to_string();
        self.manifest.scene = Some(manifest::Scene { path: path.display().to_string(), hash });
        Ok(())
    }

    /// Notes what a run on a rig has cost, and says it; then hands on what came of it. What it has cost is of interest above all
    /// when it failed.
    pub(super) fn record_rig<T>(
        &mut self,
        light: &mut Light<'_>,
        found: Result<T>,
        console: &Console,
    ) -> anyhow::Result<T> {
        self.manifest.rig = light.record(found.is_ok())?;
        if let Some(rig) = &self.manifest.rig {
            measured::say(rig, console)?;
        }
        Ok(found?)
    }

    /// Seconds since the run started.
    pub(super) fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Runs `work` and notes how long it took.
    pub(super) fn timed<T>(&mut self, name: &str, work: impl FnOnce(&mut Self) -> T) -> T {
        let start = Instant::now();
        let result = work(self);
        self.manifest.record(name, start.elapsed());
        result
    }

    /// Writes how the run ended. An error is recorded and handed on; should even that fail, the error itself matters more.
    pub(super) fn close<T>(mut self, outcome: anyhow::Result<(T, String)>) -> anyhow::Result<T> {
        let record = self.path.join(RECORD);
        match outcome {
            Ok((result, message)) => {
                self.manifest.finish(Status::Done, message);
                self.manifest.write(&record)?;
                Ok(result)
            }
            Err(error) => {
                let interrupted = matches!(error.downcast_ref(), Some(Error::Interrupted));
                let status = if interrupted { Status::Interrupted } else { Status::Failed };
                self.manifest.finish(status, format!("{error:#}"));
                let _ = self.manifest.write(&record);
                Err(error)
            }
        }
    }
}

fn free(name: &str) -> PathBuf {
    let numbered = |number: u32| match number {
        1 => PathBuf::from(format!("out/{name}")),
        _ => PathBuf::from(format!("out/{name}-{number}")),
    };
    // Numbers do not run out before the disk does.
    (1..).map(numbered).find(|path| !path.exists()).unwrap_or_else(|| numbered(1))
}
