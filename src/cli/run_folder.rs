//! The folder that a run leaves behind, with its record.

use std::path::{Path, PathBuf};
use std::time::Instant;

use super::console::Console;
use super::journal;
use super::light::Light;
use super::measured;
use super::opener;
use super::options::RunArgs;
use crate::error::{Error, Result};
use crate::io::manifest::{self, Status};
use crate::journal::{Identity, Journal};
use crate::measure::RunManifest;

/// What a run says of itself.
pub(super) const RECORD: &str = "run.json";

/// An open run: the folder is there and writable before any work starts, and its record says `running` until the end.
pub(super) struct RunFolder {
    pub(super) path: PathBuf,
    pub(super) manifest: RunManifest,
    started: Instant,
    /// Show the report in the end.
    open: bool,
    resume: bool,
    notes: Vec<(&'static str, Vec<u8>)>,
}

impl RunFolder {
    /// Makes the folder wanted, or, where the user named none, the first free one of `out/NAME`, `out/NAME-2`, …; a run that is
    /// to be resumed is in the folder wanted, or in `out/NAME`.
    ///
    /// # Errors
    /// [`Error::Option`] when it holds an earlier run that is not to be overwritten; [`Error::Write`].
    pub(super) fn create(wanted: &RunArgs, name: &str, console: &Console) -> Result<Self> {
        let RunArgs { overwrite, resume, .. } = *wanted;
        let path = match &wanted.folder {
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
            let photos = Journal::discard(&journal::folder(&path))?;
            if photos > 0 {
                console.note(format_args!(
                    "note: --overwrite throws away {photos} photos of the run in {}",
                    path.display()
                ));
            }
        }
        let manifest = RunManifest::new(std::env::args());
        manifest.write(&path.join(RECORD))?;
        Ok(Self { path, manifest, started: Instant::now(), resume, notes: Vec::new(), open: wanted.open })
    }

    /// Something that a replay of this run should know, to be written into its journal.
    pub(super) fn keep(&mut self, name: &'static str, value: &impl serde::Serialize) -> anyhow::Result<()> {
        self.notes.push((name, serde_json::to_vec(value)?));
        Ok(())
    }

    /// The run's journal: a new one, or the one to go on with.
    ///
    /// # Errors
    /// As [`Journal::create`] and [`Journal::resume`].
    pub(super) fn journal(&self, identity: &Identity, console: &Console) -> Result<Journal> {
        let mut journal = journal::open(&self.path, identity, self.resume, console)?;
        self.notes.iter().try_for_each(|(name, value)| journal.note(name, value))?;
        Ok(journal)
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

    /// Notes what is known of the matrix, where there is one.
    pub(super) fn describe_light(&mut self, light: &Light<'_>) {
        self.manifest.noise = light.noise().map(Into::into);
        self.manifest.products = light.products();
    }

    /// Notes what a run on a rig has cost, and says it; then hands on what came of it. What it has cost is of interest above all
    /// when it failed.
    pub(super) fn record_rig<T, E>(
        &mut self,
        light: &mut Light<'_>,
        found: std::result::Result<T, E>,
        console: &Console,
    ) -> anyhow::Result<T>
    where
        anyhow::Error: From<E>,
    {
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
                if self.open {
                    opener::open(&self.path.join("report.html"));
                }
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

/// Whether there is anything that a new run would take the place of.
fn holds_run(path: &Path) -> bool {
    path.join(RECORD).exists() || Journal::is_in(&journal::folder(path))
}
