//! The folder of a run as a source. Its photos serve further requests without any device.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::finding::Finding;
use crate::image::Image;
use crate::io::manifest::Status;
use crate::journal::Journal;
use crate::lab::layout::{RECORD, calibration_folder, journal_folder};
use crate::lab::measured::{MeasuredRig, measured};
use crate::lab::notes::product_name;
use crate::lab::notes::{self, Kind, SourceNote};
use crate::lab::{SharedObserver, Truth, layout};
use crate::measure::{Calibration, JournaledFrames, RigFile, RunManifest};
use crate::operator::{Direction, Product};
use crate::rig::Frame;
use crate::transport::{Channels, JournaledOperator, Part};

/// A run whose photos answer further questions.
pub(in crate::lab) struct RunSource {
    pub(in crate::lab) folder: PathBuf,
    pub(in crate::lab) note: SourceNote,
    /// The true labels that the scene's author defined, if the run knew them.
    pub(in crate::lab) truth: Option<Truth>,
    /// The number of photos that the run was allowed to take, if the run was completed.
    pub(in crate::lab) photos: Option<usize>,
    /// The findings about the rig from the photos of the run.
    pub(in crate::lab) findings: Vec<Finding>,
}

/// Pairs of patterns and photos of a run, for each channel, without ambient light.
pub(in crate::lab) struct RunPhotos {
    /// Pairs without direct light.
    pub(in crate::lab) global: Vec<Vec<Product>>,
    /// Pairs with direct light.
    pub(in crate::lab) full: Vec<Vec<Product>>,
    /// The direct light, if the run knew it and its matrix is diagonal.
    pub(in crate::lab) direct: Option<Vec<Vec<f64>>>,
    pub(in crate::lab) ambient: Image,
}

impl RunSource {
    /// Reads the notes of a run's journal.
    pub(in crate::lab) fn open(run: &Path) -> Result<Self> {
        let folder = journal_folder(run);
        if !Journal::is_in(&folder) {
            return Err(Error::data(run, "it holds no run whose photos were kept")
                .help("give a scene, a rig file, the folder of a run that has a journal, or a folder of captures with a captures.toml"));
        }
        let mut journal = Journal::read_only(&folder)?;
        let note = read(&mut journal, notes::SOURCE)?
            .ok_or_else(|| incomplete(&journal, "what they are photos of"))?;
        let truth = read(&mut journal, notes::TRUTH)?;
        let record = RunManifest::read(&run.join(RECORD));
        let record = record.ok().filter(|record| record.status == Status::Done);
        let photos = record.as_ref().and_then(|record| record.photos_allowed);
        let findings = record.and_then(|record| record.rig).map_or(Vec::new(), |rig| rig.findings);
        Ok(Self { folder: run.to_path_buf(), note, truth, photos, findings })
    }

    pub(in crate::lab) fn journal(&self, observer: &SharedObserver) -> Result<Journal> {
        let journal = Journal::read_only(&journal_folder(&self.folder))?;
        layout::report_damages(&journal, observer);
        Ok(journal)
    }

    /// The blur, in pixels, that the patterns and photos of a rig need.
    pub(in crate::lab) fn blur(&self) -> Result<f64> {
        Ok(Calibration::load(&calibration_folder(&self.folder))?.registration.blur())
    }

    /// The rig of the run, with photos from the journal. Errors: [`Error::Journal`] if the run stopped before it noted its rig.
    pub(in crate::lab) fn measured(
        &self,
        channels: Option<Channels>,
        observer: &SharedObserver,
    ) -> Result<MeasuredRig> {
        let mut journal = self.journal(observer)?;
        let bytes =
            journal.read_note(notes::RIG_FILE)?.ok_or_else(|| incomplete(&journal, "their rig file"))?;
        let file = RigFile::from_bytes(&self.note.path, &bytes)?;
        let calibration = Calibration::load(&calibration_folder(&self.folder))?;
        let warn = layout::warn_of_damage(&journal, observer);
        let frames = Box::new(JournaledFrames::replay(journal)?.reporting(warn));
        measured(frames, &calibration, &file, (channels, self.note.symmetric))
    }

    pub(in crate::lab) fn taken(&self, observer: &SharedObserver) -> Result<RunPhotos> {
        match self.note.kind {
            Kind::Scene => self.taken_of_scene(&mut self.journal(observer)?),
            Kind::Rig => self.taken_of_rig(observer),
        }
    }

    fn taken_of_scene(&self, journal: &mut Journal) -> Result<RunPhotos> {
        let SourceNote { photos, channels, .. } = self.note;
        let mut of = |part| -> Result<Vec<Vec<Product>>> {
            (0..channels)
                .map(|channel| {
                    JournaledOperator::kept(journal, &product_name(part, channel), Direction::Forward)
                })
                .collect()
        };
        let (global, full) = (of(Part::Global)?, of(Part::Full)?);
        let direct = journal.read_note(notes::DIRECT)?.map(|bytes| {
            let values: Vec<f64> =
                bytes.as_chunks::<8>().0.iter().map(|value| f64::from_le_bytes(*value)).collect();
            values.chunks(photos.pixels().max(1)).map(<[f64]>::to_vec).collect()
        });
        let ambient = match journal.read_note("ambient")? {
            Some(bytes) => {
                let samples =
                    bytes.as_chunks::<4>().0.iter().map(|sample| f32::from_le_bytes(*sample)).collect();
                Image::new(photos, channels, samples)?
            }
            None => Image::filled(photos, channels, 0.0),
        };
        Ok(RunPhotos { global, full, direct, ambient })
    }

    fn taken_of_rig(&self, observer: &SharedObserver) -> Result<RunPhotos> {
        let channels = Channels::of(self.note.channels);
        let mut seen: HashSet<Arc<Frame>> = HashSet::new();
        let mut frames = Vec::new();
        for pair in JournaledFrames::replay(self.journal(observer)?)?.pairs() {
            let frame = pair?.shot.frame;
            if frame.levels().iter().any(|level| *level > 0) && seen.insert(Arc::clone(&frame)) {
                frames.push(frame);
            }
        }
        let mut measurement = self.measured(Some(channels), observer)?.measurement;
        let mut full = vec![Vec::new(); measurement.channels()];
        for frame in &frames {
            let (patterns, photo) = measurement.photograph_frame(frame)?;
            for ((products, pattern), plane) in full.iter_mut().zip(patterns).zip(photo.planes) {
                products.push(Product { from: pattern, to: plane.values });
            }
        }
        // The direct light is absent if the run did not measure it.
        let direct = measurement.direct().ok();
        Ok(RunPhotos {
            global: vec![Vec::new(); full.len()],
            full,
            direct: direct.map(|photo| photo.planes.into_iter().map(|plane| plane.values).collect()),
            ambient: measurement.ambient()?.to_image()?,
        })
    }
}

fn read<T: serde::de::DeserializeOwned>(journal: &mut Journal, name: &str) -> Result<Option<T>> {
    let Some(note) = journal.read_note(name)? else { return Ok(None) };
    serde_json::from_slice(&note).map(Some).map_err(|fault| {
        Error::journal(journal.path(), format!("its note `{name}` cannot be read: {fault}"))
            .help("open it with the version of krylux that wrote it")
    })
}

fn incomplete(journal: &Journal, what: &str) -> Error {
    Error::journal(journal.path(), format!("it holds {} photos, but not {what}", journal.photos()))
        .help("go on with that run by the command that began it, and --resume")
}
