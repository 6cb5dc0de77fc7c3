//! A rig file as a source: its devices, real or virtual, and their calibration.

use std::path::Path;

use super::scene::SceneSource;
use super::virtual_scene::{no_scene, not_virtual, refuse_tracing, scene_of, traced_scene, twin};
use crate::analysis::plan::Twin;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::io::manifest::SourceFile;
use crate::journal::{Identity, Journal};
use crate::lab::layout::{calibration_folder, short_name};
use crate::lab::measured::{MeasuredRig, measured};
use crate::lab::notes;
use crate::lab::settings::Settings;
use crate::lab::{Log, SharedObserver, Truth, layout};
use crate::measure::{
    Calibration, FrameSource, JournaledFrames, LiveFrames, Opener, RigFile, RigKind, RunManifest,
};
use crate::rig::{DeviceOpener, Helper, VirtualRig, VirtualScene};
use crate::transport::Channels;

/// The largest relative difference between the aspect ratios of two devices of the same shape. A difference of one row in 64 is 1.6 %.
const SAME_SHAPE: f64 = 0.02;

/// A rig that can be opened.
#[derive(Clone)]
pub struct RigSource {
    /// The file.
    pub file: RigFile,
    /// The calibration of the devices. Without a calibration in the file, the devices are taken as ideal.
    pub calibration: Calibration,
    /// Whether the calibration was measured.
    pub is_calibrated: bool,
    /// The devices. Tracer settings that the caller gives have replaced the settings in the file of a virtual rig.
    devices: RigKind,
    /// The virtual rig's scene, if it must be traced.
    scene: Option<SceneSource>,
    /// The parts of the rig that a program supplies: the devices, and the text of the rig file if there is no such file.
    program: Handed,
    /// Whether projector and camera have the same pose and lens. An explicit matrix is assumed to be from such a rig.
    symmetric: bool,
    observer: SharedObserver,
}

#[derive(Clone, Debug, Default)]
pub(in crate::lab) struct Handed {
    /// The text of the rig file, if it is not in a file.
    pub(in crate::lab) text: Option<String>,
    pub(in crate::lab) opener: Option<DeviceOpener>,
    pub(in crate::lab) allows_programs: bool,
}

impl RigSource {
    /// Reads the rig file, the files that it names, and the calibration. Tracer settings that the caller gives replace the settings in the
    /// file of a virtual rig. They are refused if nothing is traced. Fails if the file, the calibration or the scene cannot be loaded.
    pub(in crate::lab) fn open(
        path: &Path,
        program: &Handed,
        settings: &Settings,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let mut source = Self::uncalibrated(path, program, settings, observer)?;
        if !source.load_calibration()? {
            observer.note(format_args!(
                "note: {} names no calibration, so its devices are taken as ideal; `krylux rig calibrate` measures them",
                path.display()
            ));
            let [camera, pattern] = [source.devices.camera_info().resolution, source.resolution()];
            let shapes = [camera, pattern].map(|size| size.width as f64 / size.height as f64);
            if (shapes[0] / shapes[1] - 1.0).abs() > SAME_SHAPE {
                observer.note(format_args!(
                    "note: without a calibration the camera's {camera} pixels are taken for all of the pattern's {pattern}, so that photos are stretched; calibrate the rig, or give both the same shape"
                ));
            }
        }
        Ok(source)
    }

    /// Opens the rig as [`Self::open`], but with ideal devices. A calibration that the file names is ignored, since it may not exist yet.
    pub(in crate::lab) fn uncalibrated(
        path: &Path,
        program: &Handed,
        settings: &Settings,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let file = match &program.text {
            Some(text) => RigFile::from_bytes(path, text.as_bytes())?,
            None => RigFile::load(path)?,
        };
        let mut devices = file.kind.clone();
        let scene = match &mut devices {
            RigKind::Virtual(rig) => scene_of(&mut rig.scene, path, settings, observer)?,
            _ => refuse_tracing(path, settings).map(|()| None)?,
        };
        let source = Self::of_devices(file, devices, scene, observer);
        Ok(Self { program: program.clone(), ..source })
    }

    /// The virtual devices of `file` in front of an open scene, which replaces the scene that the file names. Errors:
    /// [`crate::Error::Data`] if the devices are real; [`crate::Error::Option`] if the scene's projector and camera differ in pixels; those
    /// of [`Calibration::load`].
    pub(in crate::lab) fn in_front_of(
        scene: &SceneSource,
        file: RigFile,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let RigKind::Virtual(mut rig) = file.kind.clone() else { return Err(not_virtual(&file.path)) };
        rig.scene = traced_scene(scene, &file.path)?;
        let mut source = Self::of_devices(file, RigKind::Virtual(rig), Some(scene.clone()), observer);
        source.load_calibration()?;
        Ok(source)
    }

    fn of_devices(
        file: RigFile,
        devices: RigKind,
        scene: Option<SceneSource>,
        observer: &SharedObserver,
    ) -> Self {
        let calibration = Calibration::ideal(&devices.projector_info(), &devices.camera_info());
        let symmetric = scene.as_ref().is_none_or(SceneSource::is_symmetric);
        let program = Handed::default();
        let observer = observer.clone();
        Self { file, calibration, is_calibrated: false, devices, scene, program, symmetric, observer }
    }

    /// Loads the calibration, if the file names one. Returns whether the file names a calibration.
    fn load_calibration(&mut self) -> Result<bool> {
        let Some(folder) = &self.file.calibration else { return Ok(false) };
        let calibration = Calibration::load(folder)?;
        self.calibrated_by(calibration).map(|()| true)
    }

    /// Replaces the calibration. Errors: [`crate::Error::Rig`] when the calibration belongs to other devices.
    pub(in crate::lab) fn calibrated_by(&mut self, calibration: Calibration) -> Result<()> {
        calibration.check(&self.devices.projector_info(), &self.devices.camera_info())?;
        self.calibration = calibration;
        self.is_calibrated = true;
        Ok(())
    }

    /// The observer.
    pub fn observer(&self) -> &SharedObserver {
        &self.observer
    }

    /// Whether projector and camera have the same pose and lens, so that the matrix is symmetric.
    pub fn is_symmetric(&self) -> bool {
        self.symmetric
    }

    /// The resolution of patterns and of photos. Photos are resampled to this resolution.
    pub fn resolution(&self) -> Resolution {
        self.devices.projector_info().resolution
    }

    /// The channels of the devices. They are coloured if any device has colours.
    pub fn channels(&self) -> Channels {
        self.devices.channels()
    }

    /// The rig file's name.
    pub fn name(&self) -> String {
        short_name(&self.file.path)
    }

    /// The scene in front of a virtual rig, if this scene must be traced.
    pub(in crate::lab) fn scene(&self) -> Result<&SceneSource> {
        self.scene.as_ref().ok_or_else(|| no_scene(&self.file.path))
    }

    /// Whether the devices are virtual, with a scene that must be traced first.
    pub(in crate::lab) fn is_traced(&self) -> bool {
        self.scene.is_some()
    }

    pub(in crate::lab) fn truth(&self) -> Result<Option<Truth>> {
        Ok(self.scene.as_ref().map(|scene| scene.truth(self.resolution())).transpose()?.flatten())
    }

    pub(in crate::lab) fn kind(&self) -> &RigKind {
        &self.devices
    }

    /// The virtual devices.
    ///
    /// # Errors
    /// [`crate::Error::Data`] if they are real.
    pub fn devices(&self) -> Result<&VirtualRig> {
        match &self.devices {
            RigKind::Virtual(rig) => Ok(rig),
            _ => Err(not_virtual(&self.file.path)),
        }
    }

    /// The scene or matrix in front of the virtual devices. A scene is traced now if necessary.
    ///
    /// # Errors
    /// [`crate::Error::Data`] if the devices are real; the errors of tracing.
    pub fn twin(&self) -> Result<Twin> {
        twin(self.scene.as_ref(), self.devices()?, &self.file.path)
    }

    /// All facts that the photos of this rig depend on.
    pub(in crate::lab) fn identity(&self) -> Result<Identity> {
        let identity = Identity::new()
            .with("rig file", blake3::Hash::from_bytes(self.file.hash).to_string())
            .with("calibration", blake3::Hash::from_bytes(self.calibration.identity()).to_string());
        // No further facts are known about real devices before they are opened. The journal then records these facts.
        let RigKind::Virtual(rig) = &self.devices else { return Ok(identity) };
        Ok(match (&self.scene, &rig.scene) {
            (Some(scene), _) => scene.identity(identity, rig.channels()),
            (None, VirtualScene::Matrix { path, .. }) => {
                let bytes = crate::file::read(path)?;
                identity.with("matrix file", blake3::hash(&bytes).to_hex())
            }
            (None, VirtualScene::File { .. }) => return Err(no_scene(&self.file.path)),
        })
    }

    /// The waiting time in seconds between the confirmation of a frame and its photo.
    pub(in crate::lab) fn settle(&self) -> f64 {
        self.file.measurement.settle.unwrap_or(self.calibration.stability.settle)
    }

    /// Checks that the programs that the rig file names may run, and reports these programs. If a program supplied the text of the rig
    /// file, that program chose them itself, and no check is needed. Fails as [`RigFile::require_programs_allowed`].
    pub fn require_programs_allowed(&self) -> Result<()> {
        let is_ours = self.program.text.is_some();
        self.file.require_programs_allowed(is_ours || self.program.allows_programs)?;
        for program in self.file.named_programs() {
            self.observer
                .note(format_args!("note: {} runs the program `{program}`", self.file.path.display()));
        }
        Ok(())
    }

    /// Opens the rig on each request for its raw frames. A scene is traced on the first request, and its matrix is kept.
    pub fn opener(&self) -> Opener<'static> {
        let (settle, tries) = (self.settle(), self.file.measurement.tries);
        let rig = match self.devices.clone() {
            RigKind::Virtual(rig) => rig,
            RigKind::Program(_) => {
                let opener = self.program.opener.clone();
                return Box::new(move |after| {
                    let opener = opener.as_ref().ok_or_else(DeviceOpener::missing)?;
                    Ok(Box::new(LiveFrames::new(opener.open(after)?, settle, tries)))
                });
            }
            RigKind::Hardware(rig) => {
                let source = self.clone();
                return Box::new(move |after| {
                    source.require_programs_allowed()?;
                    let devices = rig.open(&Helper::find()?, after)?;
                    Ok(Box::new(LiveFrames::new(devices, settle, tries)))
                });
            }
        };
        let (scene, path) = (self.scene.clone(), self.file.path.clone());
        let mut known: Option<Twin> = None;
        Box::new(move |after| {
            let light = match &known {
                Some(known) => known.transport(),
                None => known.insert(twin(scene.as_ref(), &rig, &path)?).transport(),
            };
            Ok(Box::new(LiveFrames::new(rig.open(light, after)?, settle, tries)))
        })
    }

    /// The rig with its processing stages. With a journal, the devices are opened only for a photo that is not in the journal.
    pub(in crate::lab) fn measured(
        &self,
        channels: Option<Channels>,
        journal: Option<Journal>,
    ) -> Result<MeasuredRig> {
        let mut opener = self.opener();
        let frames: Box<dyn FrameSource> = match journal {
            Some(journal) => {
                let warn = layout::warn_of_damage(&journal, &self.observer);
                Box::new(JournaledFrames::new(journal, opener)?.reporting(warn))
            }
            None => opener(None)?,
        };
        measured(frames, &self.calibration, &self.file, (channels, self.symmetric))
    }

    /// Stores the data of the rig that a replay needs beside the journal in `folder`: the note, the rig file and the calibration.
    pub(in crate::lab) fn keep(&self, folder: &Path, journal: &mut Journal) -> Result<()> {
        let path = &self.file.path;
        let bytes = match &self.program.text {
            Some(text) => text.clone().into_bytes(),
            None => crate::file::read(path)?,
        };
        if RigFile::from_bytes(path, &bytes)? != self.file {
            let fault = "the file is not what the rig was opened by, and a run keeps the file";
            return Err(Error::data(path.clone(), fault)
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

    /// Adds the rig to a run's record: the rig file, and the scene in front of virtual devices.
    pub(in crate::lab) fn describe(&self, manifest: &mut RunManifest) {
        if let Some(scene) = &self.scene {
            scene.describe(manifest);
        }
        let hash = blake3::Hash::from_bytes(self.file.hash).to_string();
        manifest.scene = Some(SourceFile { path: (&self.file.path).into(), hash });
    }
}
