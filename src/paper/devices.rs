//! Virtual devices for the figures' scenes. The shipped rig files are embedded, so that no files are needed at run time.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use super::stage::Stage;
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::measure::calibrate::{CalibrateOptions, calibrate};
use crate::measure::{Calibration, FrameSource, LiveFrames, MeasureOptions, Measurement};
use crate::measure::{RigFile, RigKind};
use crate::operator::Operator;
use crate::rig::VirtualRig;
use crate::transport::{Channels, Part, Transport};

const REALISTIC: &[u8] = include_bytes!("../../assets/rigs/realistic.toml");
const ONE_BIT: &[u8] = include_bytes!("../../assets/rigs/one-bit.toml");

/// Captures averaged per pattern; the virtual rig runs unattended.
const TAKES: u32 = 2;

/// An 8-bit projector with gamma 2.2 and a 14-bit camera, both with realistic errors, set up for one stage.
pub(super) struct Devices {
    rig: VirtualRig,
    calibration: Calibration,
    options: MeasureOptions,
}

impl Devices {
    /// Sets up the rig for `stage` and calibrates it from captures alone. `go_on` is called between steps.
    pub(super) fn set_up(stage: &Arc<Stage>, go_on: &mut dyn FnMut() -> ControlFlow<()>) -> Result<Self> {
        let (mut rig, options) = read("realistic.toml", REALISTIC)?;
        resize(&mut rig, stage.resolution, 2.5);
        let mut live = open(&rig, stage, &options)?;
        let (calibration, _) = calibrate(live.as_mut(), &CalibrateOptions::default(), &mut |_| go_on())?;
        let options = MeasureOptions { takes: TAKES, ..options };
        Ok(Self { rig, calibration, options })
    }

    /// A measurement with the calibrated rig, before any photo.
    pub(super) fn measurement(&self, stage: &Arc<Stage>) -> Result<Measurement> {
        let live = open(&self.rig, stage, &self.options)?;
        let measurement = Measurement::new(live, self.calibration.clone(), self.options.clone())?;
        Ok(measurement.declared(stage.ideal(Part::Full).symmetry()))
    }
}

/// The shipped rig whose projector has one bit, for scenes of `resolution`, and its measurement options. It uses a known
/// calibration: a calibration of two levels would add little.
pub(super) fn one_bit(resolution: Resolution) -> Result<(VirtualRig, MeasureOptions)> {
    let (mut rig, options) = read("one-bit.toml", ONE_BIT)?;
    resize(&mut rig, resolution, 1.0);
    // Any exposure time is allowed: the figure compares photos at equal total exposure.
    rig.camera.exposure_step = 0.0;
    rig.camera.exposures = [1e-7, 10.0];
    Ok((rig, options))
}

/// Opens the rig for `stage`, with the calibration that follows from the rig's own description.
pub(super) fn measure_known(
    rig: &VirtualRig,
    stage: &Arc<Stage>,
    options: MeasureOptions,
) -> Result<Measurement> {
    let live = open(rig, stage, &options)?;
    let mut calibration = Calibration::ideal(&rig.projector_info(), &rig.camera_info());
    let highest = f64::from((1_u32 << rig.camera.bits) - 1);
    calibration.camera.black = rig.camera.black_level;
    calibration.camera.saturation = highest;
    calibration.camera.gain = rig.camera.full_well / (highest - rig.camera.black_level);
    calibration.camera.read_noise = rig.camera.read_noise / calibration.camera.gain;
    Measurement::new(live, calibration, options)
}

fn read(name: &str, bytes: &[u8]) -> Result<(VirtualRig, MeasureOptions)> {
    let file = RigFile::from_bytes(Path::new(name), bytes)?;
    match file.kind {
        RigKind::Virtual(rig) => Ok((rig, file.measurement)),
        RigKind::Hardware(_) => Err(Error::Data {
            path: name.into(),
            fault: "its devices are real".into(),
            help: "the figures are made by virtual devices".into(),
        }),
    }
}

/// Sets the resolution of projector and scene; the camera gets `finer` times as many pixels per side.
fn resize(rig: &mut VirtualRig, resolution: Resolution, finer: f64) {
    if let crate::rig::VirtualScene::File { size, .. } = &mut rig.scene {
        *size = resolution;
    }
    let side = |pixels: usize| (finer * pixels as f64).round() as usize;
    rig.camera.size = Some([side(resolution.width), side(resolution.height)]);
}

fn open(rig: &VirtualRig, stage: &Arc<Stage>, options: &MeasureOptions) -> Result<Box<dyn FrameSource>> {
    let bench = rig.open(Box::new(Seen(Arc::clone(stage))), None)?;
    Ok(Box::new(LiveFrames::new(bench, options.settle.unwrap_or(0.0), options.tries)))
}

/// A stage as a light transport source for the devices.
struct Seen(Arc<Stage>);

impl Transport for Seen {
    fn pattern_resolution(&self) -> Resolution {
        self.0.resolution
    }

    fn photo_resolution(&self) -> Resolution {
        self.0.resolution
    }

    fn channels(&self) -> Channels {
        Channels::Luma
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        let mut photo = vec![0.0; self.0.pixels()];
        self.0.traced.matrix.apply(Part::Full, 0, &pattern.plane(0), &mut photo);
        Image::new(self.0.resolution, 1, photo.iter().map(|&value| value as f32).collect())
    }
}
