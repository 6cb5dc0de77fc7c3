//! The check by photos of black and white: exposure, saturation, ambient light, frames, settling, repeatability and noise.

use std::borrow::Cow;

use crate::bench::rig_check::probe::{Photos, take};
use crate::bench::rig_check::{Finding, Grade, Recorder};
use crate::calibrate::{StructuredLight, WhiteExposure};
use crate::error::Result;
use crate::finding::{Ratio, SIGMAS, decimal};
use crate::measure::sight::judged;
use crate::measure::{Calibration, Effort, FrameSource, Registration, noise_ratio};
use crate::rig::RawFrame;

/// The check warns when white's 98th percentile is below this fraction of the camera's range. Most of the range is then unused.
const DIM_WHITE: f64 = 0.2;

/// The check fails when white's 98th percentile is below this fraction of the camera's range. The camera then does not see the projector.
const INVISIBLE_WHITE: f64 = 0.01;

/// The check warns when more than this fraction of white's samples is saturated.
const SATURATED_WARNING: f64 = 0.01;

/// The check fails when more than this fraction of white's samples is saturated.
const SATURATED_FAILURE: f64 = 0.1;

/// The check warns when light without a pattern exceeds this fraction of white's light. It then adds a tenth to the noise of white.
const AMBIENT: f64 = 0.2;

/// The check warns when drift and flicker change white by more than this fraction between photos. `krylux audit` has the same bound.
const REPEATABILITY: f64 = 0.01;

/// The check fails when the first white after black differs from a repeated white by more than this fraction. The latency measurement of
/// the calibration has the same tolerance.
const SETTLING: f64 = 2e-3;

/// The check warns when a photo's noise, divided by the noise that the calibration predicts, is outside this interval.
const NOISE_RATIO: [f64; 2] = [0.8, 1.25];

const NO_WHITE: &str = "white has no more light than black";

pub(crate) struct Setup<'a> {
    /// Seconds between the confirmation of a frame and its photo.
    pub(crate) settle: f64,
    /// The exposure in the rig file, in seconds.
    pub(crate) exposure: Option<f64>,
    pub(crate) known: Option<&'a Calibration>,
}

/// The photos of black and white, and the conditions for further checks.
pub(crate) struct Seen {
    pub(crate) exposure: f64,
    pub(crate) photos: Photos,
    /// Whether the first photo of a frame already has all of the frame's light.
    pub(crate) settled: bool,
    pub(crate) in_range: bool,
}

/// Takes and examines photos of black and white. Returns the photos if white can be seen.
pub(crate) fn photos(
    setup: &Setup<'_>,
    frames: &mut dyn FrameSource,
    recorder: &mut Recorder<'_, '_>,
) -> Result<Option<Seen>> {
    let (seconds, outcome) = StructuredLight::white_exposure(setup.exposure, frames)?;
    let photos = take(frames, seconds)?;
    let bits = frames.camera().bits;
    let [projector, camera] = [frames.projector().resolution, frames.camera().resolution];
    let map = match setup.known {
        Some(known) => Cow::Borrowed(&known.registration),
        // A run without a calibration uses the same map.
        None => Cow::Owned(Registration::by_area(projector, camera)),
    };
    let (is_visible, in_range) = light((setup.known, &map), &photos, (seconds, outcome), bits, recorder)?;
    recorder.add(sequence(&photos.effort))?;
    if !is_visible {
        let because = "the camera does not see the projector's white";
        for name in ["settling", "repeatability", "devices", "picture"] {
            recorder.add(Finding::unmeasured(name, because))?;
        }
        return Ok(None);
    }
    let means: Vec<[f64; 2]> = photos
        .whites
        .iter()
        .map(|pair| pair.each_ref().map(|white| white.mean() - photos.dark_count))
        .collect();
    let settling = settling(&means, setup.settle);
    let settled = settling.grade == Grade::Ok;
    recorder.add(settling)?;
    recorder.add(repeatability(&means))?;
    if let Some(known) = setup.known {
        let [first, second] = &photos.whites[0];
        // If white is saturated everywhere, this has already been reported.
        if let Some(found) = noise_ratio(first, second, &known.camera, bits)? {
            recorder.add(noise(found.ratio, found.error))?;
        }
    }
    Ok(Some(Seen { exposure: seconds, photos, settled, in_range }))
}

fn sequence(effort: &Effort) -> Finding {
    let refused = effort.dropped + effort.incomplete + effort.repeated + effort.late;
    let found = match refused {
        0 => format!("{} came in order, each exposed after its pattern", effort.taken),
        _ => format!(
            "of {} frames {} did not arrive, {} lacked packets ({} in all), {} arrived twice, {} were exposed too early; {} restarts of the camera",
            effort.taken + refused,
            effort.dropped,
            effort.incomplete,
            effort.missing,
            effort.repeated,
            effort.late,
            effort.restarts
        ),
    };
    let grade = if refused == 0 { Grade::Ok } else { Grade::Warning };
    let resent = match effort.resent {
        0 => String::new(),
        packets => format!("; {packets} packets were lost and sent again"),
    };
    let found = found + &resent;
    let expected = "no refused frames: each is taken again, which costs time";
    let help = "check cable and network (a smaller packet_size in [camera] where packets are lost); a free-running camera must be triggered";
    Finding::graded("frames", grade, found, expected, help)
}

/// Checks whether white has all of its light right after black. `means` are the mean counts of the two photos of white in each round.
fn settling(means: &[[f64; 2]], settle: f64) -> Finding {
    let missing: Option<Vec<f64>> =
        means.iter().map(|[first, again]| Ratio::of(again - first, *again, 0.0).value()).collect();
    let Some(missing) = missing else { return Finding::unmeasured("settling", NO_WHITE) };
    let (average, error) = average(&missing);
    let found = format!(
        "{} s after a frame, white after black has {:.2} ± {:.2} % less light than a repeated white",
        decimal(settle, 4),
        100.0 * average,
        100.0 * error
    );
    let expected = format!("at most {} %", 100.0 * SETTLING);
    let help = "give a longer settle in [measurement], or calibrate";
    Finding::at_most("settling", [average.abs(), error, SETTLING], Grade::Fails, found, expected, help)
}

fn repeatability(means: &[[f64; 2]]) -> Finding {
    let repeated: Vec<f64> = means.iter().map(|[_, again]| *again).collect();
    let (middle, _) = average(&repeated);
    let off = repeated.iter().map(|value| (value - middle).abs()).fold(0.0, f64::max);
    let Some(most) = Ratio::of(off, middle, 0.0).value() else {
        return Finding::unmeasured("repeatability", NO_WHITE);
    };
    let found = format!("white's light changes by {:.3} % from photo to photo", 100.0 * most);
    let expected = format!("at most {:.0} %", 100.0 * REPEATABILITY);
    let help =
        "use exposures that are whole multiples of the refresh and of the mains period; let the lamp warm up";
    Finding::at_most("repeatability", [most, 0.0, REPEATABILITY], Grade::Warning, found, expected, help)
}

/// Checks whether the noise of a photo agrees with the calibration. `ratio` is the measured noise divided by the predicted noise.
fn noise(ratio: f64, error: f64) -> Finding {
    let [least, most] = NOISE_RATIO;
    let is_off = ratio - SIGMAS * error > most || ratio + SIGMAS * error < least;
    let found =
        format!("two photos of white differ by {ratio:.3} ± {error:.3} times what the calibration predicts");
    let expected = format!("{least} to {most}");
    let help = "more noise may be vibration or flicker; more or less may be another gain: calibrate again";
    let finding =
        Finding::graded("noise", if is_off { Grade::Warning } else { Grade::Ok }, found, expected, help);
    finding.measured(ratio, error, if ratio < 1.0 { least } else { most })
}

fn average(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0).max(1.0) / count).sqrt())
}

/// Examines exposure, saturation, whether the camera sees the projector where the pixel map predicts, and then ambient light. Returns
/// whether white can be seen, and whether only a few of its samples are saturated. `exposure` is in seconds, with the outcome of its choice.
fn light(
    (known, map): (Option<&Calibration>, &Registration),
    photos: &Photos,
    exposure: (f64, WhiteExposure),
    bits: u32,
    recorder: &mut Recorder<'_, '_>,
) -> Result<(bool, bool)> {
    let full = f64::from((1_u32 << bits) - 1);
    let limit = known.map_or(full, |known| known.camera.saturation);
    let (dark, white) = (photos.dark_count, &photos.whites[0][1]);
    // A camera that is saturated without a pattern has no range left.
    let reached = Ratio::of(white.percentile(0.98) - dark, full - dark, 0.0).value().unwrap_or(0.0);
    recorder.add(range(reached, exposure))?;
    let saturated = white.counts.iter().filter(|&&count| f64::from(count) >= limit).count() as f64;
    let saturated = saturated / white.counts.len() as f64;
    recorder.add(saturation(saturated))?;
    let sight = judged(map, white.channels, &above_black(photos));
    let is_seen = sight.grade == Grade::Ok && reached >= INVISIBLE_WHITE;
    recorder.add(sight)?;
    recorder.add(match Ratio::of(photos.black.mean() - dark, white.mean() - dark, 0.0).value() {
        Some(share) if is_seen => ambient(share),
        _ => Finding::unmeasured("ambient", "the camera does not see the projector's white"),
    })?;
    Ok((is_seen, saturated <= SATURATED_WARNING))
}

/// For each sample, white minus black and the variance that this difference would have without light of the projector. The variance is
/// computed from the changes of white minus black between rounds.
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
        // The difference has the noise of two photos and the rounding errors of two counts.
        [white - of(&photos.black), 0.5 * scatter.max(1.0 / 6.0) * (1.0 + 1.0 / rounds)]
    };
    (0..photos.black.counts.len()).map(sample).collect()
}

/// Judges how much of the camera's range white fills. `reached` is white's 98th percentile above black, as a fraction of the range.
fn range(reached: f64, (seconds, outcome): (f64, WhiteExposure)) -> Finding {
    let found = format!("white reaches {:.0} % of the range in {} s", 100.0 * reached, decimal(seconds, 4));
    let expected = format!("{:.0} % to 90 %", 100.0 * DIM_WHITE);
    let (grade, help) = match (outcome, reached) {
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
    Finding::graded("exposure", grade, found, expected, help).measured(reached, 0.0, DIM_WHITE)
}

fn saturation(share: f64) -> Finding {
    let grade = match share {
        share if share > SATURATED_FAILURE => Grade::Fails,
        share if share > SATURATED_WARNING => Grade::Warning,
        _ => Grade::Ok,
    };
    let found = format!("{:.2} % of white's samples", 100.0 * share);
    let expected = format!("at most {:.0} %", 100.0 * SATURATED_WARNING);
    let help = "add a shorter exposure, close the lens, or remove highlights from the scene";
    Finding::graded("saturation", grade, found, expected, help).measured(share, 0.0, SATURATED_WARNING)
}

fn ambient(share: f64) -> Finding {
    let found = format!("black has {:.1} % of white's light", 100.0 * share);
    let expected = format!("less than {:.0} %", 100.0 * AMBIENT);
    let help = "darken the room: ambient light is subtracted, but its noise remains";
    Finding::at_most("ambient", [share, 0.0, AMBIENT], Grade::Warning, found, expected, help)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::rig_check::probe::take;
    use crate::bench::rig_check::recorded;
    use crate::image::Resolution;
    use crate::measure::CaptureRequest;
    use crate::measure::simulated::Simulated;
    use crate::rig::RawFrame;

    #[test]
    fn refused_frames_are_counted_by_their_reason() {
        let whole = Effort { taken: 40, ..Effort::default() };
        let found = sequence(&whole);
        assert_eq!(
            (found.grade, found.found.as_str()),
            (Grade::Ok, "40 came in order, each exposed after its pattern")
        );
        let refused = Effort {
            dropped: 1,
            repeated: 2,
            late: 4,
            restarts: 8,
            resent: 16,
            incomplete: 3,
            missing: 32,
            ..whole
        };
        let found = sequence(&refused);
        assert_eq!(found.grade, Grade::Warning);
        assert_eq!(
            found.found,
            "of 50 frames 1 did not arrive, 3 lacked packets (32 in all), 2 arrived twice, 4 were exposed too early; 8 restarts of the camera; 16 packets were lost and sent again"
        );
    }

    #[test]
    fn a_frame_that_has_not_settled_fails_beyond_its_error() {
        // Two rounds with 1 % and 2 % less light give 1.5 ± 0.5 %. In the later cases, the rounds have no scatter.
        let found = settling(&[[99.0, 100.0], [98.0, 100.0]], 0.25);
        assert_eq!(found.grade, Grade::Ok, "three errors are as much as is missing");
        assert!(
            found.found.contains("0.2500 s") && found.found.contains("1.50 ± 0.50 % less"),
            "{}",
            found.found
        );
        assert_eq!(settling(&[[98.5, 100.0], [98.5, 100.0]], 0.25).grade, Grade::Fails);
        assert_eq!(settling(&[[101.5, 100.0], [101.5, 100.0]], 0.25).grade, Grade::Fails, "or too much");
        assert_eq!(settling(&[[99.9, 100.0], [99.9, 100.0]], 0.25).grade, Grade::Ok);
    }

    #[test]
    fn the_largest_change_of_white_is_compared_with_its_mean() {
        let found = repeatability(&[[0.0, 99.5], [0.0, 100.0], [0.0, 100.5]]);
        assert!(found.grade == Grade::Ok && found.found.contains("changes by 0.500 %"), "{}", found.found);
        let found = repeatability(&[[0.0, 96.0], [0.0, 100.0], [0.0, 101.0]]);
        assert!(
            found.grade == Grade::Warning && found.found.contains("changes by 3.030 %"),
            "{}",
            found.found
        );
    }

    #[test]
    fn noise_is_off_where_three_errors_do_not_reach_the_bounds() {
        for (ratio, error, grade) in [
            (1.0, 0.0, Grade::Ok),
            (1.3, 0.01, Grade::Warning),
            (1.3, 0.02, Grade::Ok),
            (0.7, 0.02, Grade::Warning),
            (0.7, 0.04, Grade::Ok),
        ] {
            let found = noise(ratio, error);
            assert_eq!(found.grade, grade, "{ratio} ± {error}");
            assert!(found.found.contains(&format!("{ratio:.3} ± {error:.3} times")), "{}", found.found);
        }
    }

    #[test]
    fn means_errors_and_percentiles_are_those_of_the_counts() {
        let counts = vec![9, 1, 7, 3, 5];
        let resolution = Resolution::new(5, 1);
        let frame = RawFrame { resolution, channels: 1, counts, exposure: 0.1, id: 0, started: 0.0 };
        assert_eq!(frame.mean(), 5.0);
        assert_eq!([0.0, 0.3, 0.5, 0.98].map(|at| frame.percentile(at)), [1.0, 3.0, 5.0, 9.0]);
        // The deviations are −3, 0 and 3. The variance is 9, and the variance of the mean is 9/3.
        assert_eq!(average(&[1.0, 4.0, 7.0]), (4.0, 3.0_f64.sqrt()));
        assert_eq!(average(&[4.0]), (4.0, 0.0));
    }

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
        let graded = |outcome, reached| range(reached, (0.5, outcome)).grade;
        for (reached, grade) in
            [(0.0099, Grade::Fails), (0.01, Grade::Warning), (0.199, Grade::Warning), (0.2, Grade::Ok)]
        {
            assert_eq!(graded(WhiteExposure::Filled, reached), grade, "{reached}");
        }
        assert_eq!(graded(WhiteExposure::TooBright, 1.0), Grade::Fails);
    }

    /// Photos of a hundred pixels have 5 counts without light, 30 for black, and 155 for white. In white, `saturated` pixels have 255.
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
            let map = Registration::by_area(size, size);
            let all = recorded(|recorder| {
                let seen = light((None, &map), &photos, (0.5, WhiteExposure::Filled), 8, recorder)?;
                assert_eq!(seen, (true, in_range), "{saturated}");
                Ok(())
            });
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
            // Black has 25 counts above dark, and white 150. Saturated pixels raise the mean of white.
            let black = 100.0 * 25.0 / (150.0 + f64::from(saturated));
            assert!(ambient.found.contains(&format!("black has {black:.1} %")), "{ambient}");
            assert_eq!(ambient.grade, Grade::Ok);
        }
        assert_eq!((ambient(0.2).grade, ambient(0.21).grade), (Grade::Ok, Grade::Warning));
    }
}
