//! The folder of a run as a source: its photos, asked anew with nothing attached.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Result;

use super::about::{ABOUT, About, DIRECT, Kind, RIG_FILE, TRUTH, calibration};
use super::console::Console;
use super::light::{self, Kept, Light};
use super::measured::Measured;
use super::run_folder::RECORD;
use super::{journal, rig_source};
use crate::error::Error;
use crate::image::Image;
use crate::io::manifest::{self, Status};
use crate::journal::Journal;
use crate::measure::RigFile;
use crate::measure::RunManifest;
use crate::measure::{Calibration, JournaledFrames};
use crate::operator::Product;
use crate::report::segmentation::Truth;
use crate::rig::Frame;
use crate::transport::{Channels, JournaledOperator, Part};

/// A run that can be asked anew.
pub(super) struct Replay {
    folder: PathBuf,
    pub(super) about: About,
    truth: Option<Truth>,
    /// Photos that the run was allowed to take, if it came to its end.
    pub(super) photos: Option<usize>,
}

/// The photos of a run: patterns with what was seen of them, for each channel, without ambient light.
pub(super) struct Taken {
    /// Those without direct light, …
    pub(super) global: Vec<Vec<Product>>,
    /// … and those with all of it.
    pub(super) full: Vec<Vec<Product>>,
    /// The direct light, where it is a diagonal and the run knew it.
    pub(super) direct: Option<Vec<Vec<f64>>>,
    pub(super) ambient: Image,
}

impl Replay {
    /// Looks into a run's journal.
    pub(super) fn open(run: &Path) -> Result<Self> {
        let folder = journal::folder(run);
        if !Journal::is_in(&folder) {
            return Err(Error::Data {
                path: run.to_path_buf(),
                fault: "there is no run in it whose photos were kept".into(),
                help: "give a scene, a rig file, or the folder of a run that has a journal".into(),
            }
            .into());
        }
        let mut journal = Journal::read_only(&folder)?;
        let about = read(&mut journal, ABOUT)?.ok_or_else(|| unfinished(&journal, "what they are of"))?;
        let truth = read(&mut journal, TRUTH)?;
        let record = RunManifest::read(&run.join(RECORD)).ok().filter(|record| record.status == Status::Done);
        let photos = record.and_then(|record| record.photos_allowed);
        Ok(Self { folder: run.to_path_buf(), about, truth, photos })
    }

    /// The labels of the scene's author, where the run knew them.
    pub(super) fn truth(&self) -> Option<Truth> {
        self.truth.clone()
    }

    /// What a rig takes photos by, without the rig.
    pub(super) fn light(&self, channels: Channels, console: &Console) -> Result<Light<'static>> {
        let mut journal = Journal::read_only(&journal::folder(&self.folder))?;
        journal::say_damages(&journal, console);
        if self.about.kind == Kind::Scene {
            return Ok(Light::Kept(Box::new(Kept::replay(journal, self.about.clone(), channels)?)));
        }
        let bytes = journal.read_note(RIG_FILE)?.ok_or_else(|| unfinished(&journal, "their rig file"))?;
        let file = RigFile::from_bytes(&self.about.path, &bytes)?;
        let calibration = Calibration::load(&calibration(&self.folder))?;
        let warn = journal::warning(&journal, console);
        let shots = Box::new(JournaledFrames::replay(journal)?.reporting(warn));
        Ok(Light::Measured(Box::new(rig_source::measured(
            shots,
            &calibration,
            &file,
            (Some(channels), self.about.symmetry()),
        )?)))
    }

    /// All the photos that the run took.
    pub(super) fn taken(&self, console: &Console) -> Result<Taken> {
        let mut journal = Journal::read_only(&journal::folder(&self.folder))?;
        journal::say_damages(&journal, console);
        match self.about.kind {
            Kind::Scene => self.taken_of_scene(&mut journal),
            Kind::Rig => self.taken_of_rig(journal, console),
        }
    }

    fn taken_of_scene(&self, journal: &mut Journal) -> Result<Taken> {
        let About { photos, channels, .. } = self.about;
        let mut of = |part| -> Result<Vec<Vec<Product>>> {
            let each =
                (0..channels).map(|channel| JournaledOperator::kept(journal, &light::name(part, channel)));
            Ok(each.collect::<crate::Result<_>>()?)
        };
        let (global, full) = (of(Part::Global)?, of(Part::Full)?);
        let direct = journal.read_note(DIRECT)?.map(|bytes| {
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
        Ok(Taken { global, full, direct, ambient })
    }

    fn taken_of_rig(&self, journal: Journal, console: &Console) -> Result<Taken> {
        let channels = Channels::of(self.about.channels);
        let mut seen: HashSet<Arc<Frame>> = HashSet::new();
        let mut frames = Vec::new();
        for pair in JournaledFrames::replay(journal)?.pairs() {
            let frame = pair?.shot.frame;
            if frame.levels().iter().any(|level| *level > 0) && seen.insert(Arc::clone(&frame)) {
                frames.push(frame);
            }
        }
        let Light::Measured(mut measured) = self.light(channels, console)? else {
            return Err(unfinished(&Journal::read_only(&journal::folder(&self.folder))?, "their rig").into());
        };
        let measurement = &mut measured.measurement;
        let mut full = vec![Vec::new(); measurement.channels()];
        for frame in &frames {
            let (patterns, photo) = measurement.photograph_frame(frame)?;
            for ((products, pattern), plane) in full.iter_mut().zip(patterns).zip(photo.planes) {
                products.push(Product { from: pattern, to: plane.values });
            }
        }
        // Of a run that did not measure it there are no photos to tell it from.
        let direct = measurement.direct().ok();
        Ok(Taken {
            global: vec![Vec::new(); full.len()],
            full,
            direct: direct.map(|photo| photo.planes.into_iter().map(|plane| plane.values).collect()),
            ambient: measurement.ambient()?.to_image()?,
        })
    }

    /// The rig of the run, without the rig.
    ///
    /// # Errors
    /// [`Error::Data`] where the run had none, but a scene.
    pub(super) fn measured(&self, channels: Option<Channels>, console: &Console) -> Result<Measured> {
        match self.light(channels.unwrap_or(Channels::of(self.about.channels)), console)? {
            Light::Measured(measured) => Ok(*measured),
            _ => Err(not_for_runs(&self.folder)),
        }
    }

    /// Notes what the run depends on.
    pub(super) fn describe(&self, manifest: &mut RunManifest) {
        let About { path, hash, .. } = &self.about;
        manifest.scene = Some(manifest::Scene { path: path.display().to_string(), hash: hash.clone() });
    }
}

fn read<T: serde::de::DeserializeOwned>(journal: &mut Journal, name: &str) -> Result<Option<T>> {
    let note = journal.read_note(name)?;
    Ok(note.map(|note| serde_json::from_slice(&note)).transpose()?)
}

fn unfinished(journal: &Journal, what: &str) -> Error {
    Error::Journal {
        path: journal.path().into(),
        fault: format!("it holds {} photos, but not {what}", journal.photos()),
        help: "go on with that run by the same command and --resume".into(),
    }
}

/// What a verb cannot ask of the photos of a run.
pub(super) fn not_for_runs(run: &Path) -> anyhow::Error {
    Error::Data {
        path: run.to_path_buf(),
        fault: "its photos do not answer this verb".into(),
        help: "give the scene or the rig".into(),
    }
    .into()
}
