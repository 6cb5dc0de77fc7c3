//! An open rig with the stages behind it, what it has cost so far, and what its photos say of it.

mod symmetry;

use crate::error::{Error, Result};
use crate::finding::{Finding, Ratio};
use crate::measure::{Calibration, FrameSource, Measurement, RigFile, RigRecord};
use crate::operator::Symmetry;
use crate::transport::Channels;
use symmetry::Products;

/// A rig as a linear operator.
pub(super) struct MeasuredRig {
    pub(super) measurement: Measurement,
    /// The calibration's folder, if there is one.
    calibration: Option<String>,
    /// Whether the pixel map fits, where that was looked at.
    pub(super) map: Option<Finding>,
    /// The products so far, by which its symmetry is judged.
    pub(super) products: Products,
}

impl MeasuredRig {
    /// What the rig has cost so far, for a run's record; if `is_complete`, with the noise and drift that its photos show, and with findings. This
    /// takes one photo of white where patterns were shown.
    pub(super) fn record(&mut self, is_complete: bool) -> Result<RigRecord> {
        let mut record = RigRecord {
            calibration: self.calibration.clone(),
            measurement: self.measurement.options().clone(),
            patterns: 0,
            effort: self.measurement.effort(),
            noise: None,
            drift: None,
            findings: Vec::new(),
        };
        if is_complete {
            record.findings = vec![self.measurement.sight()?, self.measurement.steadiness()?];
            record.findings.extend(self.map.clone().into_iter().chain(self.products.symmetry()));
            (record.noise, record.drift) = self.noise_and_drift()?;
        }
        record.patterns = self.measurement.patterns() as u64;
        record.effort = self.measurement.effort();
        Ok(record)
    }

    fn noise_and_drift(&mut self) -> Result<(Option<f64>, Option<f64>)> {
        let white = self.measurement.white()?;
        let error = white.planes.iter().map(|plane| plane.standard_error()).fold(0.0, f64::hypot);
        let pixels = white.planes.iter().flat_map(|plane| plane.values.iter().zip(&plane.variance));
        let noise = Ratio::to_length(error, pixels.map(|(&value, &variance)| [value, variance]));
        let drift = self.measurement.drift()?;
        Ok((noise.value(), (drift.sentinels.len() > 1).then_some(drift.largest)))
    }
}

/// The stages behind raw frames; `channels` is `None` for what the devices see.
pub(super) fn measured(
    frames: Box<dyn FrameSource>,
    calibration: &Calibration,
    file: &RigFile,
    (channels, symmetry): (Option<Channels>, Symmetry),
) -> Result<MeasuredRig> {
    let mut measurement =
        Measurement::new(frames, calibration.clone(), file.measurement.clone())?.declared(symmetry);
    match channels {
        Some(Channels::Luma) => measurement = measurement.in_luma(),
        Some(Channels::Rgb) if measurement.channels() != 3 => {
            return Err(Error::Option {
                option: "--channels".into(),
                fault: format!("the camera of {} sees no colours", file.path.display()),
                help: "give --channels luma".into(),
            });
        }
        _ => {}
    }
    let calibration = file.calibration.as_ref().map(|folder| folder.display().to_string());
    let products = Products::new(&measurement);
    Ok(MeasuredRig { measurement, calibration, map: None, products })
}
