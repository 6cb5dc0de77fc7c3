//! The folder of a run, with its record.

use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::layout::{ANSWER, CALIBRATION, JOURNAL, RECORD, REPORT, journal_folder, photos_in};
use super::replaced::{MOVING, Replaced, is_file_name, is_name, move_all};
use super::{Log, SharedObserver};
use crate::error::{Error, Result};
use crate::file::{self, FileKind};
use crate::io::manifest::Status;
use crate::io::model;
use crate::journal::Journal;
use crate::measure::RunManifest;

/// The choice of a run's folder.
#[derive(Clone, Debug, Default)]
pub struct RunOptions {
    /// The folder. If it is `None`, the first unused name of `out/NAME`, `out/NAME-2`, … is taken.
    pub folder: Option<PathBuf>,
    /// Allows a folder that holds an earlier run. When the new run is complete, the old photos are deleted, unless the old run is the
    /// source.
    pub overwrite: bool,
    /// Continues the run in the folder: a photo in its journal is not taken again.
    pub resume: bool,
}

/// An open run. Its folder exists, is writable and is locked before any work starts. Its record has the status `running` until the end.
pub struct RunFolder {
    /// The folder.
    pub path: PathBuf,
    /// The record.
    pub manifest: RunManifest,
    /// The folder in which the files of the answer are written ([`RunFolder::answer`]).
    pub(crate) answer: PathBuf,
    /// Whether the folder holds the complete answer of another verb. The files of that answer are kept.
    keeps_answers: bool,
    pub(super) resumes: bool,
    started: Instant,
    start: Start,
    /// The lock that keeps other runs out of the folder.
    _lock: Option<File>,
}

enum Start {
    /// An empty folder, or the folder of a run that is continued.
    Fresh,
    /// The folder of another run, which is restored if this run fails without photos.
    Replaces(Replaced),
    /// The folder of the source of this run. It is unchanged until there is an answer. `photos_allowed` is the photo budget of the source.
    Beside { photos_allowed: Option<usize> },
}

impl RunFolder {
    /// Creates the folder. A run to be resumed is in the named folder, or in `out/NAME`. `source` is the folder of an earlier run, if that
    /// run is the source of the new run. If the new run has the same folder, its answer is stored beside the photos of `source`.
    ///
    /// # Errors
    /// [`Error::Option`] if the folder holds an active run, a run that must not be overwritten, or another program's files;
    /// [`Error::Write`].
    pub fn create(
        options: &RunOptions,
        name: &str,
        source: Option<&Path>,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let RunOptions { overwrite, resume, .. } = *options;
        let path = match &options.folder {
            Some(path) => path.clone(),
            None if resume => numbered(name, 1),
            None => make_free(name)?,
        };
        file::make_folder(&path)?;
        let lock = lock(&path)?;
        file::follow_no_links_below(&path);
        let real = |path: &Path| std::fs::canonicalize(path).ok();
        let is_source = source.is_some_and(|source| real(source) == real(&path));
        require_plain_files(&path)?;
        let unfinished = Replaced::recover(&path)?;
        let refusal =
            |fault: &str, help: &str| Error::option("-o", format!("{} {fault}", path.display())).help(help);
        let record = RunManifest::read(&path.join(RECORD)).ok();
        let mut manifest = RunManifest::new(std::env::args_os());
        let is_other =
            |record: &RunManifest| record.status == Status::Done && record.verb() != manifest.verb();
        let keeps_answers = record.as_ref().is_some_and(is_other);
        let start = match holds_run(&path) {
            true if is_source => {
                Start::Beside { photos_allowed: record.and_then(|record| record.photos_allowed) }
            }
            true if overwrite => Start::Replaces(Replaced::move_aside(&path)?),
            true if resume => {
                if keeps_answers && !Journal::is_in(&journal_folder(&path)) {
                    let fault = "holds the answer to another question, and no photos to go on with";
                    return Err(refusal(fault, "name another folder, or add --overwrite"));
                }
                manifest.outputs = record.map_or(Vec::new(), |record| record.outputs);
                unfinished.map_or(Start::Fresh, Start::Replaces)
            }
            true => {
                let help = "go on with it by --resume, name another folder, or add --overwrite";
                return Err(refusal("already holds a run", help));
            }
            false if path.join(REPORT).exists() && !overwrite => {
                let fault = "holds no run, but the report.html of another program";
                return Err(refusal(fault, "name another folder, or add --overwrite"));
            }
            false => Start::Fresh,
        };
        let (answer, started) = (path.join(ANSWER), Instant::now());
        let mut run =
            Self { path, manifest, answer, keeps_answers, resumes: resume, started, start, _lock: lock };
        run.begin(overwrite, observer)?;
        Ok(run)
    }

    /// Writes the first record. If the record cannot be written, the replaced run is put back.
    fn begin(&mut self, overwrite: bool, observer: &SharedObserver) -> Result<()> {
        let earlier = match &self.start {
            Start::Beside { .. } => return Ok(()),
            Start::Fresh => return self.manifest.write(&self.path.join(RECORD)),
            Start::Replaces(earlier) => earlier,
        };
        self.manifest.replaces = earlier.names();
        self.manifest.write(&self.path.join(RECORD))?;
        if overwrite {
            earlier.settle()?;
        }
        if earlier.photos() > 0 {
            observer.note(format_args!(
                "note: --overwrite throws away {} photos of the run in {} when the new run is whole; until then they are in {}",
                earlier.photos(),
                self.path.display(),
                earlier.path().display()
            ));
        }
        Ok(())
    }

    /// Writes the files of the answer. `write` returns their names. The files are moved into the run's folder after all are complete and
    /// the record lists them. Even if this program is killed in between, a run that replaces this one finds them through the record.
    pub(crate) fn answer(&mut self, write: impl FnOnce(&mut Self) -> Result<Vec<String>>) -> Result<()> {
        file::remove(&self.answer)?;
        file::make_folder(&self.answer)?;
        let written = write(self)?;
        let record = self.path.join(RECORD);
        let is_beside = matches!(self.start, Start::Beside { .. });
        let mut before = if is_beside { RunManifest::read(&record)? } else { self.manifest.clone() };
        let stale: Vec<String> =
            before.outputs.iter().filter(|name| !written.contains(name)).cloned().collect();
        before.outputs = written.iter().chain(&stale).cloned().collect();
        before.write(&record)?;
        move_all(&self.answer, &self.path)?;
        if is_beside || self.keeps_answers {
            self.manifest.outputs = before.outputs;
        } else {
            // The new answer replaces the earlier answer in the folder. Files that only the earlier answer had are removed.
            stale
                .iter()
                .filter(|name| is_own_file(name))
                .try_for_each(|name| file::remove(&self.path.join(name)))?;
            // This call removes the model's folder only if it is empty. If it still holds a model, the call fails as intended.
            let _ = std::fs::remove_dir(model::folder(&self.path));
            self.manifest.outputs = written;
        }
        Ok(())
    }

    /// Seconds since the run started.
    pub fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Records how the run ended, with a sentence or an error. If the run fails before its first photo, or because of a wrong option, the
    /// run that it was about to replace is restored. Fails with [`Error::Write`].
    pub fn close(&mut self, outcome: std::result::Result<&str, &Error>) -> Result<()> {
        let start = std::mem::replace(&mut self.start, Start::Fresh);
        let (status, message) = match outcome {
            Ok(message) => (Status::Done, message.to_owned()),
            Err(error @ Error::Interrupted) => (Status::Interrupted, error.to_string()),
            Err(error) => (Status::Failed, error.to_string()),
        };
        let is_done = status == Status::Done;
        if !is_done {
            file::remove(&self.answer)?;
        }
        match &start {
            Start::Beside { .. } if !is_done => return Ok(()),
            Start::Replaces(earlier) if !is_done => {
                let photos = photos_in(&self.path);
                let is_wrong_option = matches!(outcome, Err(Error::Option { .. }));
                if photos == 0 || (is_wrong_option && photos <= earlier.photos()) {
                    return earlier.restore();
                }
            }
            Start::Beside { photos_allowed } => self.manifest.photos_allowed = *photos_allowed,
            Start::Replaces(_) | Start::Fresh => {}
        }
        self.manifest.finish(status, message);
        self.manifest.write(&self.path.join(RECORD))?;
        match start {
            Start::Replaces(earlier) if is_done => {
                earlier.discard()?;
                self.manifest.replaces.clear();
                self.manifest.write(&self.path.join(RECORD))
            }
            _ => Ok(()),
        }
    }
}

/// When a panic ends a run without photos, the replaced run is restored.
impl Drop for RunFolder {
    fn drop(&mut self) {
        if let Start::Replaces(earlier) = &self.start
            && photos_in(&self.path) == 0
        {
            // An error cannot be returned from here. If the call fails, the next run in this folder finds the replaced runs in the record.
            let _ = earlier.restore();
        }
    }
}

/// Whether a path in a record is one of the run's own files.
fn is_own_file(path: &str) -> bool {
    let in_model = path.strip_prefix(model::FOLDER).and_then(|rest| rest.strip_prefix('/'));
    is_file_name(in_model.unwrap_or(path))
}

/// Creates the first unused folder of `out/NAME`, `out/NAME-2`, … Programs that do this at the same time get different folders.
fn make_free(name: &str) -> Result<PathBuf> {
    let mut number = 1;
    loop {
        let path = numbered(name, number);
        let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        match made.and_then(|()| std::fs::create_dir(&path)) {
            Ok(()) => return Ok(path),
            // The addition cannot overflow, since the disk is full long before.
            Err(error) if error.kind() == ErrorKind::AlreadyExists && path.exists() => number += 1,
            Err(error) => return Err(Error::writing(&path)(error)),
        }
    }
}

fn numbered(name: &str, number: u32) -> PathBuf {
    match number {
        1 => PathBuf::from(format!("out/{name}")),
        _ => PathBuf::from(format!("out/{name}-{number}")),
    }
}

/// Whether the folder holds a run that a new run would replace.
fn holds_run(path: &Path) -> bool {
    path.join(RECORD).exists() || Journal::is_in(&journal_folder(path)) || model::is_in(path)
}

/// Locks the folder itself, so that only one run at a time uses it. If folders cannot be locked, the journal's lock still protects the
/// photos.
pub(super) fn lock(path: &Path) -> Result<Option<File>> {
    let Ok(folder) = File::open(path) else { return Ok(None) };
    // A killed process may still hold its lock for a moment.
    for _ in 0..50 {
        match folder.try_lock() {
            Ok(()) => return Ok(Some(folder)),
            Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(10)),
            Err(TryLockError::Error(_)) => return Ok(None),
        }
    }
    Err(Error::option("-o", format!("a run is at work in {}", path.display()))
        .help("wait until it has ended, or name another folder"))
}

/// Refuses links, pipes and devices among the files of a run, before any photo is taken. Links to folders that are not part of the run are
/// accepted.
fn require_plain_files(folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(folder).map_err(Error::reading(folder))?.flatten() {
        let path = entry.path();
        let Some(kind) = file::kind(&path)? else { continue };
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let is_ours = [JOURNAL, CALIBRATION, ANSWER, model::FOLDER].contains(&&*name)
            || is_name(name.strip_suffix(MOVING).unwrap_or(&name));
        let what = match kind {
            FileKind::File => continue,
            FileKind::Folder if is_ours => {
                require_plain_files(&path)?;
                continue;
            }
            FileKind::Folder => continue,
            FileKind::Link if path.is_dir() && !is_ours => continue,
            FileKind::Link => "a link",
            FileKind::Other => "a device or a pipe",
        };
        let fault = format!("{} is {what}, and a run has only files of its own", path.display());
        return Err(Error::option("-o", fault).help("remove it, or name another folder"));
    }
    Ok(())
}
