//! A rig file as a source: its devices, real or virtual, and what is known of them.

use std::path::Path;
use std::sync::Arc;

use anyhow::Result;

use super::console::Console;
use super::labels;
use super::measured::Measured;
use super::options::{SourceArgs, ViewArgs};
use super::simulation::{self, Simulation};
use super::trace::TraceArgs;
use crate::analysis::plan::Twin;
use crate::error::Error;
use crate::image::Resolution;
use crate::measure::{Calibration, Live, Measurement, Shots};
use crate::render::TraceSettings;
use crate::report::manifest::{self, Manifest};
use crate::report::segmentation::Truth;
use crate::report::sparse;
use crate::rig::{Bench, RigFile, RigKind, Stamp, VirtualRig, VirtualScene};
use crate::transport::{Channels, Given};

/// A rig that can be opened.
pub(super) struct RigSource {
    pub(super) file: RigFile,
    pub(super) calibration: Calibration,
    devices: VirtualRig,
    /// The virtual rig's scene, where it is to be traced.
    simulation: Option<Box<Simulation>>,
}

impl RigSource {
    /// Reads the file, what it names, and the calibration. Options of the tracer that are given stand in the place of what the file
    /// of a virtual rig says of its scene; where nothing is traced they are refused.
    pub(super) fn open(args: &SourceArgs, trace: &TraceArgs, console: &Console) -> Result<Self> {
        let file = RigFile::load(&args.source)?;
        let RigKind::Virtual(mut devices) = file.kind.clone();
        let simulation = scene_of(&mut devices.scene, &args.source, &args.view, trace, console)?;
        let calibration = match &file.calibration {
            Some(folder) => Calibration::load(folder)?,
            None => {
                console.note(format_args!(
                    "note: {} names no calibration, so its devices are taken as ideal; `krylux rig calibrate` measures them",
                    args.source.display()
                ));
                Calibration::ideal(&devices.projector_info(), &devices.camera_info())
            }
        };
        Ok(Self { file, calibration, devices, simulation })
    }

    /// Pixels of patterns and of photos, which are resampled to them.
    pub(super) fn resolution(&self) -> Resolution {
        self.devices.scene.size()
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
        let truth = self.simulation.as_mut().map(|simulation| labels::truth(simulation, resolution));
        Ok(truth.transpose()?.flatten())
    }

    /// The virtual devices.
    pub(super) fn devices(&self) -> &VirtualRig {
        &self.devices
    }

    /// The devices, ready to be used, as after the last frame of an earlier session if there is one.
    pub(super) fn bench(&mut self, after: Option<Stamp>, console: &Console) -> Result<Bench> {
        let light = self.twin(console)?.transport();
        Ok(self.devices.open(light, after)?)
    }

    /// What the virtual devices look at.
    pub(super) fn twin(&mut self, console: &Console) -> Result<Twin> {
        let channels = self.devices.channels();
        Ok(match (&mut self.simulation, &self.devices.scene) {
            (Some(simulation), _) => Twin::Traced(Arc::new(simulation.assemble(channels, console)?)),
            (None, VirtualScene::Matrix { path, size }) => {
                Twin::Given(Given::new(sparse::read(path)?, *size)?)
            }
            (None, VirtualScene::File { .. }) => return Err(no_scene(&self.file.path).into()),
        })
    }

    /// Raw frames from the open rig.
    fn shots(&mut self, console: &Console) -> Result<Box<dyn Shots>> {
        let bench = self.bench(None, console)?;
        let options = &self.file.measurement;
        let settle = options.settle.unwrap_or(self.calibration.stability.settle);
        Ok(Box::new(Live::new(bench, settle, options.tries)))
    }

    /// Opens the rig, and the stages behind it.
    pub(super) fn measured(&mut self, channels: Option<Channels>, console: &Console) -> Result<Measured> {
        let shots = self.shots(console)?;
        let mut measurement =
            Measurement::new(shots, self.calibration.clone(), self.file.measurement.clone())?;
        match channels {
            Some(Channels::Luma) => measurement = measurement.in_luma(),
            Some(Channels::Rgb) if measurement.channels() != 3 => {
                return Err(Error::Option {
                    option: "--channels".into(),
                    fault: format!("the camera of {} sees no colours", self.file.path.display()),
                    help: "give --channels luma".into(),
                }
                .into());
            }
            _ => {}
        }
        let calibration = self.file.calibration.as_ref().map(|folder| folder.display().to_string());
        Ok(Measured { measurement, calibration })
    }

    /// Notes what a run depends on.
    pub(super) fn describe(&self, manifest: &mut Manifest) {
        let hash = self.file.hash.iter().map(|byte| format!("{byte:02x}")).collect();
        if let Some(simulation) = &self.simulation {
            super::source::describe_simulation(simulation, manifest);
        }
        manifest.scene = Some(manifest::Scene { path: self.file.path.display().to_string(), hash });
    }
}

fn no_scene(path: &Path) -> Error {
    Error::Data {
        path: path.to_path_buf(),
        fault: "there is no scene in it that could be traced".into(),
        help: "give a rig whose [scene] names a scene's `file`".into(),
    }
}

/// Opens the scene of a virtual rig with what is given in the place of what its file says; none where its matrix is there.
fn scene_of(
    scene: &mut VirtualScene,
    rig: &Path,
    view: &ViewArgs,
    trace: &TraceArgs,
    console: &Console,
) -> Result<Option<Box<Simulation>>> {
    let refuse = |option: &str, fault: String, help: &str| {
        Err(Error::Option { option: option.into(), fault, help: help.into() }.into())
    };
    match scene {
        VirtualScene::File { path, camera, camera_file, size, samples, max_bounces, seed } => {
            let wanted = ViewArgs {
                camera: view.camera.clone().or(camera.take()),
                camera_file: view.camera_file.clone().or(camera_file.take()),
            };
            let said = TraceSettings {
                max_bounces: *max_bounces,
                seed: *seed,
                ..TraceSettings::new(*size, *samples)
            };
            let settings = trace.settings_of_rig(said);
            if settings.projector.is_some() {
                let fault = format!("{} has as many projector pixels as its scene has", rig.display());
                return refuse("--projector-size", fault, "leave it out, or give --size");
            }
            (*size, *samples, *max_bounces) = (settings.resolution, settings.samples, settings.max_bounces);
            let simulation = Simulation::open(path, &wanted, settings, trace, console)?;
            Ok(Some(Box::new(simulation)))
        }
        VirtualScene::Matrix { .. } => {
            let option = trace.given().or(view.given());
            match option {
                Some(option) => {
                    let fault = format!("nothing is traced for {}", rig.display());
                    refuse(option, fault, "leave it out: the rig file says what is seen")
                }
                None => Ok(None),
            }
        }
    }
}
