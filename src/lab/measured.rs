//! An open rig with its processing stages, its costs so far, and the findings of its photos.

mod symmetry;

use crate::error::{Error, Result};
use crate::finding::{Finding, Ratio};
use crate::measure::{Calibration, FrameSource, Measurement, RigFile, RigRecord};
use crate::operator::Symmetry;
use crate::transport::Channels;
use symmetry::Products;

pub(super) struct MeasuredRig {
    pub(super) measurement: Measurement,
    calibration: Option<String>,
    /// Whether the pixel map fits, if that was examined.
    pub(super) map: Option<Finding>,
    /// The products so far. They show whether the matrix is symmetric.
    pub(super) products: Products,
}

impl MeasuredRig {
    /// The costs of the rig so far, for a run's record. If `is_complete`, the record includes findings and the noise and drift that the
    /// photos show. This takes one photo of white if patterns were shown.
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

/// The stages that process raw frames. If `channels` is `None`, the channels are those of the devices.
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
            return Err(Error::option(
                "--channels",
                format!("the camera of {} sees no colours", file.path.display()),
            )
            .help("give --channels luma"));
        }
        _ => {}
    }
    let calibration = file.calibration.as_ref().map(|folder| folder.display().to_string());
    let products = Products::new(&measurement);
    Ok(MeasuredRig { measurement, calibration, map: None, products })
}
