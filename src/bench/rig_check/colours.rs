//! The check of the projector's colours: whether red, green and blue add up to gray of the same level.
//!
//! A colour wheel with a white segment makes gray brighter than its colours together, and so does a projector that trades saturation for
//! brightness. Gray patterns are still in proportion to their photos; colours are not.

use super::probe::{Probe, average};
use super::thresholds::{COLOURS, COLOURS_UNCALIBRATED};
use super::{Finding, Grade, Recorder};
use crate::error::Result;

/// The levels of the colours, as shares of the highest: a white segment may be used for bright colours only.
const LEVELS: [f64; 2] = [1.0, 0.5];

/// Photographs gray, red, green and blue at two levels: eight frames. There is nothing to photograph of a gray projector.
pub(crate) fn colours(probe: &mut Probe<'_>, recorder: &mut Recorder<'_, '_>) -> Result<()> {
    if probe.frames.projector().channels != 3 {
        return Ok(());
    }
    let is_pulsed = |finding: &Finding| finding.name == "pulses" && finding.grade != Grade::Ok;
    if recorder.findings.all.iter().any(is_pulsed) {
        return recorder.add(Finding::ok("colours", "not examined, because light is pulsed"));
    }
    let mut off = [0.0; 2];
    for (off, level) in off.iter_mut().zip(LEVELS) {
        let gray = average(&probe.gray(level)?);
        let mut sum = 0.0;
        for colour in 0..3 {
            sum += average(&probe.colour(colour, level)?);
        }
        *off = sum / gray - 1.0;
    }
    recorder.add(sum(probe, off))
}

/// Judges by which shares the three colours together differ from gray, at both levels.
fn sum(probe: &Probe<'_>, off: [f64; 2]) -> Finding {
    let bound = if probe.is_known { COLOURS } else { COLOURS_UNCALIBRATED };
    // The scatter of a photo of gray, and of the sum of three that have a third of its light each.
    let is_off = |off: f64| off.abs() - 1.5 * probe.scatter > bound || off.is_nan();
    let [full, half] = off.map(|off| 100.0 * off);
    let is_less = off.iter().any(|&off| is_off(off) && off < 0.0);
    let found = match (off.iter().any(|&off| is_off(off)), is_less) {
        (false, _) => format!(
            "red, green and blue add up to gray within {:.2} % at the highest level and at half of it",
            full.abs().max(half.abs())
        ),
        (true, true) => format!(
            "gray is brighter than red, green and blue together: they differ by {full:.1} % at the highest level and by {half:.1} % at half of it \
             (a white segment of the colour wheel)"
        ),
        (true, false) => format!(
            "gray is darker than red, green and blue together: they differ by {full:.1} % at the highest level and by {half:.1} % at half of it \
             (a limit of power, or colours that are enhanced)"
        ),
    };
    let grade = if off.iter().any(|&off| is_off(off)) { Grade::Warning } else { Grade::Ok };
    let help = "choose a mode for photos or sRGB in the projector's menu, without BrilliantColor and enhanced colours; otherwise measure with gray \
                patterns alone (--channels luma)";
    let unknown = "; if the camera's counts are not in proportion to light, calibrate first and check again";
    let help = if probe.is_known { help.to_owned() } else { format!("{help}{unknown}") };
    Finding::graded("colours", grade, found, format!("within {:.0} %", 100.0 * bound), help)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::image::Resolution;
    use crate::measure::CaptureRequest;
    use crate::measure::simulated::Simulated;

    /// The finding of a gray camera, without a calibration, before a projector whose white segment adds this share to gray above this level.
    fn found(segment: f64, above: f64) -> Vec<Finding> {
        let photo = move |request: &CaptureRequest, _| {
            let light = |levels: &[u16]| {
                let colours: Vec<f64> = levels.iter().map(|&level| f64::from(level) / 255.0).collect();
                let gray = colours.iter().copied().fold(1.0, f64::min);
                colours.iter().sum::<f64>() + 3.0 * segment * (gray - above).max(0.0)
            };
            // Forty counts for each level, so that none is rounded where no segment shines.
            let count = |levels: &[u16]| (100.0 + 40.0 * 255.0 * light(levels)).round() as u16;
            request.frame.levels().chunks_exact(request.frame.channels()).map(count).collect()
        };
        let size = Resolution::new(6, 4);
        let mut frames = Simulated::new(size, size, 16, photo);
        frames.projector.channels = 3;
        let photos = super::super::sequence::take(&mut frames, 0.1).expect("it never fails");
        let mut report = |_: &Finding| ControlFlow::Continue(());
        let mut recorder = Recorder::new(&mut report);
        let mut probe = Probe::new(&mut frames, None, &photos, 0.1, true);
        colours(&mut probe, &mut recorder).expect("it never fails");
        recorder.findings.all
    }

    #[test]
    fn a_white_segment_is_found_at_the_level_where_it_shines() {
        for (segment, above, grade, text) in [
            (0.0, 0.0, Grade::Ok, "add up to gray within 0.00 % at the highest level and at half of it"),
            // 1/1.06 − 1.
            (0.06, 0.0, Grade::Ok, "within 5.66 %"),
            // 1/1.1 − 1 at every level.
            (0.1, 0.0, Grade::Warning, "by -9.1 % at the highest level and by -9.1 % at half of it"),
            // 1/1.2 − 1 at the highest level, where four tenths of the segment shine, and none of it at half.
            (
                0.5,
                0.6,
                Grade::Warning,
                "by -16.7 % at the highest level and by 0.0 % at half of it (a white segment",
            ),
            (-0.1, 0.0, Grade::Warning, "gray is darker than red, green and blue together"),
        ] {
            let all = found(segment, above);
            assert!(
                all.len() == 1 && all[0].grade == grade && all[0].found.contains(text),
                "{segment}: {all:?}"
            );
        }
    }
}
