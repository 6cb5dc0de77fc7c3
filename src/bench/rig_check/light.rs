//! The check of the light: exposure, saturation and ambient light.

use super::sequence::{Photos, mean, percentile};
use super::thresholds::{AMBIENT, DIM_WHITE, INVISIBLE_WHITE, SATURATED_FAILURE, SATURATED_WARNING};
use super::{Finding, Grade, Recorder};
use crate::calibrate::WhiteExposure;
use crate::error::Result;
use crate::finding::Ratio;
use crate::finding::decimal;
use crate::measure::sight::judged;
use crate::measure::{Calibration, Registration};
use crate::rig::RawFrame;

/// How white was exposed.
pub(crate) struct Exposure {
    /// The exposure, in seconds.
    pub(crate) seconds: f64,
    /// Whether the camera's exposures suit white.
    pub(crate) outcome: WhiteExposure,
    /// The bits of a count.
    pub(crate) bits: u32,
}

/// Examines exposure, saturation, and whether the camera sees the projector where the pixel map says so; if it does, ambient light. Returns
/// whether white can be seen at all, and whether hardly any of its samples is saturated.
pub(crate) fn light(
    known: Option<&Calibration>,
    map: &Registration,
    photos: &Photos,
    exposure: Exposure,
    recorder: &mut Recorder<'_, '_>,
) -> Result<(bool, bool)> {
    let full = f64::from((1_u32 << exposure.bits) - 1);
    let limit = known.map_or(full, |known| known.camera.saturation);
    let (dark, white) = (photos.dark_count, &photos.whites[0][1]);
    // A camera that is saturated without a pattern has no range left.
    let reached = Ratio::of(percentile(white, 0.98) - dark, full - dark, 0.0).value().unwrap_or(0.0);
    recorder.add(range(reached, &exposure))?;
    let saturated = white.counts.iter().filter(|&&count| f64::from(count) >= limit).count() as f64;
    let saturated = saturated / white.counts.len() as f64;
    recorder.add(saturation(saturated))?;
    let sight = judged(map, white.channels, &above_black(photos));
    let is_seen = sight.grade == Grade::Ok && reached >= INVISIBLE_WHITE;
    recorder.add(sight)?;
    recorder.add(match Ratio::of(mean(&photos.black) - dark, mean(white) - dark, 0.0).value() {
        Some(share) if is_seen => ambient(share),
        _ => Finding::unmeasured("ambient", "the camera does not see the projector's white"),
    })?;
    Ok((is_seen, saturated <= SATURATED_WARNING))
}

/// White less black in each sample, and the variance that this would have without any light of the projector: that of white less black from
/// round to round.
fn above_black(photos: &Photos) -> Vec<[f64; 2]> {
    let rounds = photos.whites.len() as f64;
    let sample = |sample: usize| {
        let of = |frame: &RawFrame| f64::from(frame.counts[sample]);
        let white = photos.whites.iter().map(|[_, again]| of(again)).sum::<f64>() / rounds;
        let steps: Vec<f64> = photos
            .whites
            .iter()
            .zip(&photos.blacks)
            .map(|([_, white], black)| of(white) - of(black))
            .collect();
        let mean = steps.iter().sum::<f64>() / rounds;
        let scatter = steps.iter().map(|step| (step - mean).powi(2)).sum::<f64>() / (rounds - 1.0).max(1.0);
        // A difference has the noise of two photos, and the rounding of two counts.
        [white - of(&photos.black), 0.5 * scatter.max(1.0 / 6.0) * (1.0 + 1.0 / rounds)]
    };
    (0..photos.black.counts.len()).map(sample).collect()
}

/// The part of the camera's range that white fills: `reached` is its 98th percentile above black, as a share
/// of the range.
fn range(reached: f64, exposure: &Exposure) -> Finding {
    let found =
        format!("white reaches {:.0} % of the range in {} s", 100.0 * reached, decimal(exposure.seconds, 4));
    let expected = format!("{:.0} % to 90 %", 100.0 * DIM_WHITE);
    let (grade, help) = match (exposure.outcome, reached) {
        (WhiteExposure::TooBright, _) => {
            (Grade::Fails, "close the lens, lower the gain, or dim the projector")
        }
        (_, share) if share < INVISIBLE_WHITE => (
            Grade::Fails,
            "take off the lens cap, open the lens, or let the projector light what the camera sees",
        ),
        (_, share) if share < DIM_WHITE => (Grade::Warning, "expose longer, or open the lens"),
        _ => (Grade::Ok, ""),
    };
    Finding::graded("exposure", grade, found, expected, help)
}

/// The share of white's samples that are saturated.
fn saturation(share: f64) -> Finding {
    let grade = match share {
        share if share > SATURATED_FAILURE => Grade::Fails,
        share if share > SATURATED_WARNING => Grade::Warning,
        _ => Grade::Ok,
    };
    Finding::graded(
        "saturation",
        grade,
        format!("{:.2} % of white's samples", 100.0 * share),
        format!("at most {:.0} %", 100.0 * SATURATED_WARNING),
        "add a shorter exposure, close the lens, or remove highlights from the scene",
    )
}

/// The light of black, as a share of white's.
fn ambient(share: f64) -> Finding {
    Finding::graded(
        "ambient",
        if share > AMBIENT { Grade::Warning } else { Grade::Ok },
        format!("black has {:.1} % of white's light", 100.0 * share),
        format!("less than {:.0} %", 100.0 * AMBIENT),
        "darken the room: ambient light is subtracted, but its noise remains",
    )
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::super::sequence::take;
    use super::*;
    use crate::image::Resolution;
    use crate::measure::CaptureRequest;
    use crate::measure::simulated::Simulated;

    #[test]
    fn saturation_up_to_each_bound_is_within_it() {
        for (share, grade) in [
            (SATURATED_WARNING, Grade::Ok),
            (1.001 * SATURATED_WARNING, Grade::Warning),
            (SATURATED_FAILURE, Grade::Warning),
            (1.001 * SATURATED_FAILURE, Grade::Fails),
        ] {
            assert_eq!(saturation(share).grade, grade, "{share}");
        }
    }

    #[test]
    fn a_white_that_fills_little_of_the_range_is_a_warning_and_an_invisible_one_fails() {
        let graded = |outcome, reached| range(reached, &Exposure { seconds: 0.5, outcome, bits: 8 }).grade;
        for (reached, grade) in
            [(0.0099, Grade::Fails), (0.01, Grade::Warning), (0.199, Grade::Warning), (0.2, Grade::Ok)]
        {
            assert_eq!(graded(WhiteExposure::Filled, reached), grade, "{reached}");
        }
        assert_eq!(graded(WhiteExposure::TooBright, 1.0), Grade::Fails);
    }

    /// Photos of a hundred pixels: 5 counts without light, 30 for black, 155 for white, and `saturated` pixels at 255.
    #[test]
    fn range_saturation_and_ambient_light_are_those_of_the_counts() {
        for (saturated, in_range, grade) in
            [(1, true, Grade::Ok), (2, false, Grade::Warning), (11, false, Grade::Fails)]
        {
            let photo = move |request: &CaptureRequest, _| {
                let lit = if request.frame.levels()[0] > 0 { 155 } else { 30 };
                let count = |pixel| match pixel {
                    _ if request.exposure < 0.1 => 5,
                    pixel if pixel < saturated && lit > 30 => 255,
                    _ => lit,
                };
                (0..100).map(count).collect()
            };
            let size = Resolution::new(10, 10);
            let mut frames = Simulated::new(size, size, 8, photo);
            let photos = take(&mut frames, 0.5).expect("it never fails");
            let exposure = Exposure { seconds: 0.5, outcome: WhiteExposure::Filled, bits: 8 };
            let mut report = |_: &Finding| ControlFlow::Continue(());
            let mut recorder = Recorder::new(&mut report);
            let map = Registration::by_area(size, size);
            let seen = light(None, &map, &photos, exposure, &mut recorder).expect("nobody stops it");
            assert_eq!(seen, (true, in_range), "{saturated}");
            let all = recorder.findings.all;
            assert_eq!(all.len(), 4);
            let (range, saturation, ambient) = (&all[0], &all[1], &all[3]);
            assert_eq!((&*all[2].name, all[2].value), ("light", Some(1.0)));
            let share = if saturated > 2 { 100 } else { 60 };
            assert!(
                range.found.contains(&format!("white reaches {share} % of the range in 0.5000 s")),
                "{range}"
            );
            assert_eq!(saturation.grade, grade, "{saturation}");
            assert!(saturation.found.starts_with(&format!("{saturated}.00 %")), "{saturation}");
            // 25 of 150, and of more where there are saturated pixels.
            let black = 100.0 * 25.0 / (150.0 + f64::from(saturated));
            assert!(ambient.found.contains(&format!("black has {black:.1} %")), "{ambient}");
            assert_eq!(ambient.grade, Grade::Ok);
        }
        assert_eq!((ambient(0.2).grade, ambient(0.21).grade), (Grade::Ok, Grade::Warning));
    }
}
