//! An open rig with the stages behind it, and what it has cost so far.

use crate::error::{Error, Result};
use crate::measure::{Calibration, FrameSource, Measurement, RigFile, RigRecord};
use crate::operator::Symmetry;
use crate::transport::Channels;

/// A rig as a linear operator.
pub(super) struct MeasuredRig {
    pub(super) measurement: Measurement,
    /// The calibration's folder, if there is one.
    calibration: Option<String>,
}

impl MeasuredRig {
    /// What the rig has cost so far, for a run's record; if `is_complete`, with the noise and drift that its photos show. This takes no photo
    /// where some product has been taken.
    pub(super) fn record(&mut self, is_complete: bool) -> Result<RigRecord> {
        let effort = self.measurement.effort();
        let (noise, drift) = if is_complete { self.noise_and_drift()? } else { (None, None) };
        Ok(RigRecord {
            calibration: self.calibration.clone(),
            measurement: self.measurement.options().clone(),
            patterns: self.measurement.patterns() as u64,
            effort,
            noise,
            drift,
        })
    }

    fn noise_and_drift(&mut self) -> Result<(Option<f64>, Option<f64>)> {
        let white = self.measurement.white()?;
        let [mut error, mut light] = [0.0, 0.0];
        for plane in &white.planes {
            error += plane.variance.iter().sum::<f64>();
            light += plane.values.iter().map(|value| value * value).sum::<f64>();
        }
        let noise = Some((error / light).sqrt()).filter(|noise| noise.is_finite());
        let drift = self.measurement.drift()?;
        Ok((noise, (drift.sentinels.len() > 1).then_some(drift.largest)))
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
    Ok(MeasuredRig { measurement, calibration })
}
