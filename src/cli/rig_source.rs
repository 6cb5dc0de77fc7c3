//! A rig file as a source: its devices, real or virtual, and what is known of them.

use std::path::Path;

use anyhow::Result;

use super::about::{self, About, Kind};
use super::console::Console;
use super::journal;
use super::measured::Measured;
use super::options::SourceArgs;
use super::rig_scene::{refuse_tracing, scene_of};
use super::rig_twin::{into_error, no_scene, not_virtual, twin};
use super::run_folder::RunFolder;
use super::simulation::{self, Simulation};
use super::trace::TraceArgs;
use super::truth;
use crate::analysis::plan::Twin;
use crate::error::Error;
use crate::image::Resolution;
use crate::io::manifest;
use crate::journal::{Identity, Journal};
use crate::measure::RunManifest;
use crate::measure::{Calibration, FrameSource, JournaledFrames, LiveFrames, Measurement, Opener};
use crate::measure::{RigFile, RigKind};
use crate::operator::Symmetry;
use crate::report::segmentation::Truth;
use crate::rig::{Helper, VirtualRig, VirtualScene};
use crate::transport::Channels;

/// A rig that can be opened.
pub(super) struct RigSource {
    pub(super) file: RigFile,
    pub(super) calibration: Calibration,
    devices: RigKind,
    /// The virtual rig's scene, where it is to be traced.
    simulation: Option<Box<Simulation>>,
    /// Symmetric where projector and camera have the same pose and lens. A given matrix is taken for that of such a rig.
    symmetry: Symmetry,
}

impl RigSource {
    /// Reads the file, what it names, and the calibration. Options of the tracer that are given stand in the place of what the file
    /// of a virtual rig says of its scene; where nothing is traced they are refused.
    pub(super) fn open(args: &SourceArgs, trace: &TraceArgs, console: &Console) -> Result<Self> {
        let mut source = Self::uncalibrated(args, trace, console)?;
        match &source.file.calibration {
            Some(folder) => {
                source.calibration = Calibration::load(folder)?;
                let devices = &source.devices;
                source.calibration.check(&devices.projector_info(), &devices.camera_info())?;
            }
            None => console.note(format_args!(
                "note: {} names no calibration, so its devices are taken as ideal; `krylux rig calibrate` measures them",
                args.source.display()
            )),
        }
        Ok(source)
    }

    /// As [`Self::open`], with devices taken as ideal whatever the file says of a calibration: there may be none yet.
    pub(super) fn uncalibrated(args: &SourceArgs, trace: &TraceArgs, console: &Console) -> Result<Self> {
        let file = RigFile::load(&args.source)?;
        let mut devices = file.kind.clone();
        let simulation = match &mut devices {
            RigKind::Virtual(rig) => scene_of(&mut rig.scene, &args.source, &args.view, trace, console)?,
            RigKind::Hardware(_) => refuse_tracing(&args.source, &args.view, trace).map(|()| None)?,
        };
        let calibration = Calibration::ideal(&devices.projector_info(), &devices.camera_info());
        let symmetric = simulation.as_ref().is_none_or(|simulation| simulation.is_symmetric());
        let symmetry = if symmetric { Symmetry::Symmetric } else { Symmetry::General };
        Ok(Self { file, calibration, devices, simulation, symmetry })
    }

    /// Pixels of patterns and of photos, which are resampled to them.
    pub(super) fn resolution(&self) -> Resolution {
        self.devices.projector_info().resolution
    }

    /// What its devices see and show: coloured as soon as one of them is.
    pub(super) fn channels(&self) -> Channels {
        self.devices.channels()
    }

    /// The rig file's name.
    pub(super) fn name(&self) -> String {
        simulation::short_name(&self.file.path)
    }

    /// The scene that a virtual rig looks at.
    ///
    /// # Errors
    /// [`Error::Data`] where there is none.
    pub(super) fn simulation(&mut self) -> Result<&mut Simulation> {
        let path = &self.file.path;
        self.simulation.as_deref_mut().ok_or_else(|| no_scene(path).into())
    }

    /// Whether its devices are virtual, and a scene has to be traced first.
    pub(super) fn is_traced(&self) -> bool {
        self.simulation.is_some()
    }

    /// The labels of a virtual scene's author.
    pub(super) fn truth(&mut self) -> Result<Option<Truth>> {
        let resolution = self.resolution();
        let truth = self.simulation.as_mut().map(|simulation| truth::truth(simulation, resolution));
        Ok(truth.transpose()?.flatten())
    }

    /// The virtual devices.
    ///
    /// # Errors
    /// [`Error::Data`] where they are real.
    pub(super) fn devices(&self) -> Result<&VirtualRig> {
        match &self.devices {
            RigKind::Virtual(rig) => Ok(rig),
            RigKind::Hardware(_) => Err(not_virtual(&self.file.path).into()),
        }
    }

    /// What the virtual devices look at.
    pub(super) fn twin(&mut self, console: &Console) -> Result<Twin> {
        let RigKind::Virtual(rig) = &self.devices else { return Err(not_virtual(&self.file.path).into()) };
        twin(&mut self.simulation, rig, &self.file.path, console)
    }

    /// All that the photos of this rig depend on.
    pub(super) fn identity(&self) -> Result<Identity> {
        let identity = Identity::new()
            .with("rig file", blake3::Hash::from_bytes(self.file.hash).to_string())
            .with("calibration", blake3::Hash::from_bytes(self.calibration.identity()).to_string());
        // Of real devices nothing more is known; what they are is noted in the journal when they are opened.
        let RigKind::Virtual(rig) = &self.devices else { return Ok(identity) };
        Ok(match (&self.simulation, &rig.scene) {
            (Some(simulation), _) => simulation.identity(identity, rig.channels()),
            (None, VirtualScene::Matrix { path, .. }) => {
                let bytes = std::fs::read(path).map_err(Error::reading(path))?;
                identity.with("matrix file", blake3::hash(&bytes).to_hex())
            }
            (None, VirtualScene::File { .. }) => return Err(no_scene(&self.file.path).into()),
        })
    }

    /// Opens the rig whenever raw frames are wanted of it; whatever is traced for that is traced then, and kept. The scene behind it
    /// is handed over.
    pub(super) fn opener(&mut self, console: &Console) -> Opener<'static> {
        let options = &self.file.measurement;
        let settle = options.settle.unwrap_or(self.calibration.stability.settle);
        let tries = options.tries;
        let rig = match self.devices.clone() {
            RigKind::Virtual(rig) => rig,
            RigKind::Hardware(rig) => {
                return Box::new(move |after| {
                    let bench = rig.open(&Helper::find()?, after)?;
                    Ok(Box::new(LiveFrames::new(bench, settle, tries)))
                });
            }
        };
        let mut simulation = self.simulation.take();
        let (path, console) = (self.file.path.clone(), console.clone());
        let mut known: Option<Twin> = None;
        Box::new(move |after| {
            let light = match &known {
                Some(known) => known.transport(),
                None => {
                    let found = twin(&mut simulation, &rig, &path, &console).map_err(into_error)?;
                    known.insert(found).transport()
                }
            };
            Ok(Box::new(LiveFrames::new(rig.open(light, after)?, settle, tries)))
        })
    }

    /// Opens the rig, and the stages behind it; with a journal, only once a photo is not in it.
    pub(super) fn measured(
        &mut self,
        channels: Option<Channels>,
        journal: Option<Journal>,
        console: &Console,
    ) -> Result<Measured> {
        let mut opener = self.opener(console);
        let shots: Box<dyn FrameSource> = match journal {
            Some(journal) => {
                let warn = journal::warning(&journal, console);
                Box::new(JournaledFrames::new(journal, opener)?.reporting(warn))
            }
            None => opener(None)?,
        };
        measured(shots, &self.calibration, &self.file, (channels, self.symmetry))
    }

    /// Keeps beside the journal of the run in `folder` what a replay needs of the rig.
    fn keep(&self, folder: &Path, journal: &mut Journal) -> Result<()> {
        let path = &self.file.path;
        let bytes = std::fs::read(path).map_err(Error::reading(path))?;
        journal.note(about::RIG_FILE, &bytes)?;
        let calibration = about::calibration(folder);
        let kept =
            Calibration::load(&calibration).is_ok_and(|kept| kept.identity() == self.calibration.identity());
        if !kept {
            self.calibration.save(&calibration)?;
        }
        Ok(())
    }

    /// The journal of a run on this rig, with what a replay has to know.
    pub(super) fn journal(
        &self,
        folder: &RunFolder,
        channels: Channels,
        console: &Console,
    ) -> Result<Journal> {
        let mut journal = folder.journal(&self.identity()?, console)?;
        journal.note(about::ABOUT, &serde_json::to_vec(&self.about(channels))?)?;
        self.keep(&folder.path, &mut journal)?;
        Ok(journal)
    }

    /// What a replay has to know of it.
    pub(super) fn about(&self, channels: Channels) -> About {
        About {
            kind: Kind::Rig,
            name: self.name(),
            path: self.file.path.clone(),
            hash: blake3::Hash::from_bytes(self.file.hash).to_string(),
            photos: self.resolution(),
            patterns: self.resolution(),
            symmetric: self.symmetry == Symmetry::Symmetric,
            channels: channels.count(),
        }
    }

    /// Notes what a run depends on.
    pub(super) fn describe(&self, manifest: &mut RunManifest) {
        let hash = blake3::Hash::from_bytes(self.file.hash).to_string();
        if let Some(simulation) = &self.simulation {
            simulation.describe(manifest);
        }
        manifest.scene = Some(manifest::Scene { path: self.file.path.display().to_string(), hash });
    }
}

/// The stages behind raw frames.
pub(super) fn measured(
    shots: Box<dyn FrameSource>,
    calibration: &Calibration,
    file: &RigFile,
    (channels, symmetry): (Option<Channels>, Symmetry),
) -> Result<Measured> {
    let mut measurement =
        Measurement::new(shots, calibration.clone(), file.measurement.clone())?.declared(symmetry);
    match channels {
        Some(Channels::Luma) => measurement = measurement.in_luma(),
        Some(Channels::Rgb) if measurement.channels() != 3 => {
            return Err(Error::Option {
                option: "--channels".into(),
                fault: format!("the camera of {} sees no colours", file.path.display()),
                help: "give --channels luma".into(),
            }
            .into());
        }
        _ => {}
    }
    let calibration = file.calibration.as_ref().map(|folder| folder.display().to_string());
    Ok(Measured { measurement, calibration })
}
