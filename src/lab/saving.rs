//! The run of a laboratory, from its folder to its report.

use std::path::Path;
use std::time::Instant;

use super::folder::{RunFolder, RunOptions};
use super::lock;
use super::source::Source;
use super::{Answer, Lab, Log, Saved};
use crate::error::{Error, Result};
use crate::finding::{Finding, merge};
use crate::io::manifest::Verification;

impl Lab {
    /// Begins a run and makes its folder. The journal in the folder keeps every photo from now on. If the options name no folder, the
    /// folder is `out/NAME-VERB`. Call it before the first photo.
    ///
    /// # Errors
    /// [`Error::Option`] when the folder holds an earlier run that must not be overwritten; [`Error::Write`].
    pub fn begin_run(&mut self, verb: &str, options: &RunOptions) -> Result<&mut RunFolder> {
        let name = format!("{}-{verb}", self.name());
        let mut run = RunFolder::create(options, &name, self.source.folder(), &self.observer)?;
        if let Source::Scene(scene) = &mut self.source {
            scene.claim_file(&run.path)?;
        }
        self.source.describe(&mut run.manifest, self.channels);
        self.warn_of_darkness();
        Ok(self.run.insert(run))
    }

    /// The open run.
    pub fn run(&mut self) -> Option<&mut RunFolder> {
        self.run.as_mut()
    }

    /// Records in the open run how many photos a verb may take. Later requests to the run use this number as their default budget.
    pub(crate) fn allow_photos(&mut self, photos: usize) {
        if let Some(run) = &mut self.run {
            run.manifest.photos_allowed = Some(photos);
        }
    }

    /// Runs `work` and records in the open run how long it took.
    pub fn timed<T>(&mut self, name: &str, work: impl FnOnce(&mut Self) -> T) -> T {
        let start = Instant::now();
        let result = work(self);
        if let Some(run) = &mut self.run {
            run.manifest.record(name, start.elapsed());
        }
        result
    }

    /// Writes an answer into a folder: arrays, pictures, `run.json` and `report.html`. If the folder holds a run, it must be the open run.
    ///
    /// # Errors
    /// [`Error::Option`] if the folder holds another run; [`Error::Write`]; the errors of the photos that the report shows.
    pub fn save(&mut self, folder: impl AsRef<Path>, answer: &(impl Answer + ?Sized)) -> Result<Saved> {
        let folder = folder.as_ref();
        if self.run.as_ref().is_none_or(|run| run.path != folder) {
            let options = RunOptions { folder: Some(folder.to_path_buf()), ..RunOptions::default() };
            self.begin_run(answer.names()[0], &options)?;
        }
        self.finish(answer)
    }

    /// All findings about the answer, and about the rig that took its photos. They determine the colour of the page and the exit status.
    pub fn findings_of(&self, answer: &(impl Answer + ?Sized)) -> Vec<Finding> {
        let mut all = self.findings.clone();
        merge(&mut all, answer.findings());
        let verification = self.run.as_ref().and_then(|run| run.manifest.verification.as_ref());
        merge(&mut all, verification.map(Verification::finding));
        all
    }

    /// Writes an answer into the folder of the open run, and ends the run.
    ///
    /// # Errors
    /// [`Error::Option`] if no run is open; otherwise as [`Lab::save`].
    pub fn finish(&mut self, answer: &(impl Answer + ?Sized)) -> Result<Saved> {
        let Some(mut run) = self.run.take() else {
            let help = "name the folder: lab.save(folder, &answer)";
            return Err(Error::option("-o", "no run is open").help(help));
        };
        let written = self.write(answer, &mut run);
        match &written {
            Ok(saved) => run.close(Ok(&saved.message))?,
            Err(error) => self.closed_by(error, &mut run),
        }
        written
    }

    fn write(&mut self, answer: &(impl Answer + ?Sized), run: &mut RunFolder) -> Result<Saved> {
        run.manifest.photos = answer.photos() as u64;
        self.record_costs(run, answer.has_white())?;
        merge(&mut self.findings, run.manifest.rig.iter().flat_map(|rig| rig.findings.clone()));
        run.manifest.findings = self.findings_of(answer);
        // `findings_of` adds the verification only while the run is open, and `self.run` is already empty. It is therefore added here.
        merge(&mut run.manifest.findings, run.manifest.verification.as_ref().map(Verification::finding));
        let seconds = run.seconds();
        let start = Instant::now();
        run.answer(|run| {
            let mut written = self.show(answer, run, seconds)?;
            written.extend(self.source.keep_scene(&run.answer)?);
            Ok(written)
        })?;
        run.manifest.record("files", start.elapsed());
        Ok(Saved {
            report: run.path.join("report.html"),
            folder: run.path.clone(),
            message: answer.headline(),
            findings: run.manifest.findings.clone(),
            seconds: run.seconds(),
        })
    }

    /// Ends the open run, if any, for a verb that leaves no report. `photos` is the run's number of photos. Fails with [`Error::Write`].
    pub fn end_run(&mut self, photos: usize, message: &str) -> Result<()> {
        let Some(mut run) = self.run.take() else { return Ok(()) };
        run.manifest.photos = photos as u64;
        self.record_costs(&mut run, true)?;
        run.manifest.findings = run.manifest.rig.as_ref().map_or(Vec::new(), |rig| rig.findings.clone());
        // Without an answer, only a scene in memory has a file.
        if let Some(scene) = self.source.keep_scene(&run.path)? {
            run.manifest.outputs.push(scene);
        }
        run.close(Ok(message))
    }

    /// Ends the open run because of an error. Its record contains the error and the costs so far.
    pub fn abort(&mut self, error: &Error) {
        if let Some(mut run) = self.run.take() {
            self.closed_by(error, &mut run);
        }
    }

    /// Records the costs of a rig, unless they are already recorded. All photos of a complete run are on disk first.
    fn record_costs(&self, run: &mut RunFolder, is_complete: bool) -> Result<()> {
        let Some(transport) = &self.transport else { return Ok(()) };
        let mut transport = lock(transport);
        if is_complete {
            transport.flush()?;
        }
        if run.manifest.rig.is_none() {
            run.manifest.rig = transport.record(is_complete)?;
        }
        Ok(())
    }

    fn closed_by(&mut self, error: &Error, run: &mut RunFolder) {
        // A failure to record the error is ignored, since the error itself is more important.
        let _ = self.record_costs(run, false);
        if let Err(why) = run.close(Err(error)) {
            self.observer.note(format_args!("note: the record of the run is not written: {why}"));
        }
    }
}
