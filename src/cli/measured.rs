//! An open rig with the stages behind it, and what it has cost so far.

use anyhow::Result;

use super::console::Console;
use crate::measure::{Measurement, RigRecord};

/// Photos of a rig.
pub(super) struct Measured {
    pub(super) measurement: Measurement,
    /// The calibration's folder, if there is one.
    pub(super) calibration: Option<String>,
}

impl Measured {
    /// What it has cost so far, for a run's record; if `whole`, with what the photos say of noise and drift. Where some product
    /// has been taken that takes no photo more.
    pub(super) fn record(&mut self, whole: bool) -> Result<RigRecord> {
        let effort = self.measurement.effort();
        let (noise, drift) = match whole {
            false => (None, None),
            true => {
                let white = self.measurement.white()?;
                let [mut error, mut light] = [0.0, 0.0];
                for plane in &white.planes {
                    error += plane.variance.iter().sum::<f64>();
                    light += plane.values.iter().map(|value| value * value).sum::<f64>();
                }
                let drift = self.measurement.drift()?;
                (Some((error / light).sqrt()), (drift.sentinels.len() > 1).then_some(drift.largest))
            }
        };
        Ok(RigRecord {
            calibration: self.calibration.clone(),
            measurement: self.measurement.options().clone(),
            patterns: self.measurement.patterns() as u64,
            effort,
            noise: noise.filter(|noise| noise.is_finite()),
            drift,
        })
    }
}

/// The lines about it.
pub(super) fn say(rig: &RigRecord, console: &Console) -> Result<()> {
    let effort = &rig.effort;
    console.say(format_args!(
        "rig       {} patterns, {} frames shown, {} taken, {} from the journal, in {:.1} s of the rig's time",
        rig.patterns, effort.shown, effort.taken, effort.replayed, effort.seconds
    ))?;
    if effort.taken > 0 {
        console.say(format_args!("time      {} (each photo)", effort.times.each(effort.taken)))?;
    }
    let refused = effort.dropped + effort.repeated + effort.late + effort.restarts;
    if refused > 0 {
        console.say(format_args!(
            "faults    {} frames dropped, {} repeated, {} late, {} restarts of the camera",
            effort.dropped, effort.repeated, effort.late, effort.restarts
        ))?;
    }
    if effort.resent > 0 {
        console.say(format_args!("network   {} packets were lost, and sent again", effort.resent))?;
    }
    if let Some(noise) = rig.noise {
        console.say(format_args!("noise     {} % of the white photo", super::noise::percent(noise)))?;
    }
    if let Some(drift) = rig.drift {
        console.say(format_args!("drift     {} % of white at most", super::noise::percent(drift)))?;
    }
    Ok(())
}
