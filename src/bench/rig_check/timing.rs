//! The check of changes of light during one frame: pulses of the projector (PWM, colour wheel), and the camera's rolling shutter.

use super::probe::{Probe, average};
use super::{Finding, Grade, Recorder};
use crate::error::Result;
use crate::finding::{Ratio, SIGMAS, decimal};

/// The bound on pulses of light. White's light per second may differ by this fraction between exposures that are not whole multiples of a
/// refresh.
const PULSES: f64 = 0.02;

/// The bound on pulses where the camera's response is not known. A response of `x^0.95` causes a difference of 5 %.
const PULSES_UNCALIBRATED: f64 = 0.08;

/// The bound on a rolling shutter. The check warns when the last rows of a photo see more of a newly shown frame than the first rows, by
/// more than this fraction.
const ROLLING: f64 = 0.02;

/// Exposures in refreshes of the projector. No exposure is a whole multiple of a refresh or of the parts into which projectors usually
/// divide a refresh.
const EXPOSURES: [f64; 3] = [0.63, 1.37, 1.63];

/// The assumed refresh time in seconds, if the projector's refresh time is not known.
const REFRESH: f64 = 1.0 / 60.0;

/// Rows with less than this fraction of the mean light are too dark to be compared.
const LEAST_LIGHT: f64 = 0.02;

/// The largest change of a photo's mean due to rounding, in counts.
const ROUNDING: f64 = 0.3;

/// Takes six photos of white at short exposures.
pub(crate) fn pulses(probe: &mut Probe<'_>, recorder: &mut Recorder<'_, '_>) -> Result<()> {
    let [shortest, _] = probe.session.camera().exposures;
    let refresh = match probe.session.projector().frame_time {
        0.0 => REFRESH,
        seconds => seconds,
    };
    let base = refresh.min(probe.exposure / EXPOSURES[2]);
    if EXPOSURES[0] * base < shortest {
        return recorder.add(Finding::ok(
            "pulses",
            format!("not examined: the camera cannot expose for {:.5} s", EXPOSURES[0] * base),
        ));
    }
    let white = probe.session.filled(probe.session.top());
    let [dark, black] = probe.unlit.clone();
    let mut rates: Vec<Vec<f64>> = Vec::new();
    let mut error = 0.0_f64;
    // The first photo of white may contain light of the previous frame.
    probe.session.capture(&white, probe.exposure)?;
    for exposure in EXPOSURES.iter().chain(&EXPOSURES).map(|share| share * base) {
        let photo = probe.session.capture(&white, exposure)?;
        let light = probe.channels(&photo);
        let rate = |channel: usize| {
            let [light, dark, black] = [light[channel], dark[channel], black[channel]];
            (light - dark) / photo.exposure - (black - dark) / probe.exposure
        };
        rates.push((0..light.len()).map(rate).collect());
        error = error.max(ROUNDING / (average(&light) - average(&dark)).max(ROUNDING));
    }
    let spread = (0..rates[0].len()).filter_map(|channel| {
        let rates: Vec<f64> = rates.iter().map(|rates| rates[channel]).collect();
        let (least, most) =
            rates.iter().fold((f64::MAX, f64::MIN), |(low, high), &rate| (low.min(rate), high.max(rate)));
        // A channel may see none of the projector's light. Its counts then change only by rounding.
        Ratio::of(most - least, average(&rates), ROUNDING / (EXPOSURES[0] * base)).value()
    });
    recorder.add(match spread.reduce(f64::max) {
        Some(spread) => pulsed(probe, spread, error, base),
        None => Finding::unmeasured("pulses", "the short exposures show none of white's light"),
    })
}

fn pulsed(probe: &Probe<'_>, spread: f64, error: f64, base: f64) -> Finding {
    let bound = if probe.is_known { PULSES } else { PULSES_UNCALIBRATED };
    let is_pulsed = spread - 3.0 * error > bound;
    let what = if is_pulsed { ": the projector's light is pulsed (PWM or a colour wheel)" } else { "" };
    let found = format!(
        "white's light per second differs by {:.1} % between exposures of {} to {} s{what}",
        100.0 * spread,
        decimal(EXPOSURES[0] * base, 4),
        decimal(EXPOSURES[2] * base, 4)
    );
    let expected = format!("at most {:.0} %", 100.0 * bound);
    let help = "use only exposures that are whole multiples of the projector's refresh (the program chooses such ones where frame_time is \
                right), and long ones; an LCD or LCoS projector shows steadily";
    Finding::at_most("pulses", [spread, error, bound], Grade::Warning, found, expected, help)
}

/// Photographs black, and then white right after it without waiting for white to settle. Restores `settle`.
pub(crate) fn shutter(probe: &mut Probe<'_>, settle: f64, recorder: &mut Recorder<'_, '_>) -> Result<()> {
    let [black, white] = [probe.session.filled(0), probe.session.filled(probe.session.top())];
    probe.session.capture(&black, probe.exposure)?;
    let dark = probe.session.capture(&black, probe.exposure)?;
    probe.session.set_settle(0.0);
    let switched = probe.session.capture(&white, probe.exposure);
    probe.session.set_settle(settle);
    let (light, dark) = (probe.light(&switched?), probe.light(&dark));
    let width = probe.camera().width;
    let rows = probe.camera().height;
    let share = |rows: std::ops::Range<usize>| {
        let pixels = rows.start * width..rows.end * width;
        let shown: f64 = pixels.clone().map(|pixel| light[pixel] - dark[pixel]).sum();
        let least = LEAST_LIGHT * average(&probe.white) * pixels.len() as f64;
        Ratio::of(shown, probe.white[pixels].iter().sum(), least / SIGMAS).value()
    };
    let quarter = (rows / 4).max(1);
    recorder.add(match (share(0..quarter), share(rows - quarter..rows)) {
        (Some(first), Some(last)) => rolling(probe, first, last),
        _ => Finding::unmeasured("shutter", "the first or the last rows of the photo are dark"),
    })
}

fn rolling(probe: &Probe<'_>, first: f64, last: f64) -> Finding {
    let is_rolling = last - first - probe.scatter > ROLLING;
    let found = if is_rolling {
        format!(
            "the first rows see {:.0} % of a frame that was just shown, and the last rows {:.0} %: the rows are exposed one after the \
             other (rolling shutter), the last at least {} s after the first",
            100.0 * first,
            100.0 * last,
            decimal((last - first) * probe.exposure, 4)
        )
    } else {
        let off = 100.0 * (last - first).abs();
        format!("all rows see the same of a frame that was just shown, within {off:.1} %")
    };
    let grade = if is_rolling { Grade::Warning } else { Grade::Ok };
    let expected = format!("within {:.0} %", 100.0 * ROLLING);
    let help = "set the camera to a global shutter; otherwise wait until the light has settled for all rows (settle in [measurement]), and use \
                exposures that are whole multiples of the refresh and of the mains period";
    let finding = Finding::graded("shutter", grade, found, expected, help);
    finding.measured(last - first, probe.scatter / SIGMAS, ROLLING)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::rig_check::probe::take;
    use crate::bench::rig_check::recorded;
    use crate::image::Resolution;
    use crate::measure::CaptureRequest;
    use crate::measure::simulated::Simulated;

    /// The finding of `check` on a bench of four by eight pixels. Photos with an exposure of one second have 100 counts without light and
    /// 300 more for black. White adds 40,000 counts times the fraction that `share` gives for the row, the exposure and the wait.
    fn found(
        share: impl Fn(usize, f64, f64) -> f64 + Send,
        check: impl FnOnce(&mut Probe<'_>, &mut Recorder<'_, '_>) -> Result<()>,
    ) -> Finding {
        let photo = move |request: &CaptureRequest, wait: f64| {
            let white = if request.frame.levels()[0] > 0 { 40_000.0 } else { 0.0 };
            let light = |row| 300.0 + white * share(row, request.exposure, wait);
            (0..32).map(|pixel| (100.0 + request.exposure * light(pixel / 4)).round() as u16).collect()
        };
        let size = Resolution::new(4, 8);
        let mut frames = Simulated::new(size, size, 16, photo);
        frames.settle = 0.25;
        let photos = take(&mut frames, 1.0).expect("it never fails");
        let mut probe = Probe::new(&mut frames, None, &photos, 1.0, true);
        let mut all = recorded(|recorder| check(&mut probe, recorder));
        assert_eq!(all.len(), 1);
        assert_eq!(frames.settle, 0.25, "the wait is restored");
        all.remove(0)
    }

    #[test]
    fn rows_that_are_exposed_one_after_the_other_see_less_of_a_new_frame_above() {
        let rolling = |slope: f64| {
            let share = move |row: usize, _, wait| if wait > 0.0 { 1.0 } else { 0.2 + slope * row as f64 };
            found(share, |probe, recorder| shutter(probe, 0.25, recorder))
        };
        // The first two of eight rows have 0.25 of the light of white, and the last two have 0.85.
        let finding = rolling(0.1);
        assert_eq!(finding.grade, Grade::Warning);
        let text = "the first rows see 25 % of a frame that was just shown, and the last rows 85 %";
        assert!(
            finding.found.contains(text) && finding.found.contains("at least 0.6000 s after"),
            "{finding}"
        );
        // A difference of 2 % passes. Less light in the last rows is not a rolling shutter.
        for (slope, text) in [(0.0, "within 0.0 %"), (0.003, "within 1.8 %"), (-0.01, "within 6.0 %")] {
            let finding = rolling(slope);
            assert!(finding.grade == Grade::Ok && finding.found.contains(text), "{finding}");
        }
        assert_eq!(rolling(0.004).grade, Grade::Warning);
    }

    /// Exposures of 0.63, 1.37 and 1.63 refreshes of 1/60 s give 420, 913 and 1087 counts of white.
    #[test]
    fn light_that_is_pulsed_is_not_in_proportion_to_exposures_of_parts_of_a_refresh() {
        let pulsed = |more: f64| {
            let share = move |_, exposure: f64, _| {
                if (exposure * 60.0 - 1.37).abs() < 0.1 { 1.0 + more } else { 1.0 }
            };
            found(share, pulses)
        };
        let finding = pulsed(0.15);
        assert_eq!(finding.grade, Grade::Warning);
        // The rates differ by 0.15, and their mean is 1.05.
        assert!(
            finding.found.contains("differs by 14.3 % between exposures of 0.0105 to 0.0272 s"),
            "{finding}"
        );
        let steady = pulsed(0.0);
        assert!(steady.grade == Grade::Ok && steady.found.contains("differs by 0."), "{steady}");
        // The bound is 8 % plus three times the rounding of 0.3 counts in 425, which is 0.2 %.
        assert_eq!((pulsed(0.0835).grade, pulsed(0.0875).grade), (Grade::Ok, Grade::Warning));
    }

    #[test]
    fn pulses_are_not_examined_where_the_camera_cannot_expose_so_briefly() {
        let limited = |shortest: f64| {
            found(
                |_, _, _| 1.0,
                move |probe, recorder| {
                    probe.exposure = shortest;
                    pulses(probe, recorder)
                },
            )
        };
        // The exposures are limited to the exposure of white, so the shortest is 0.63 / 1.63 of white's exposure. If white is exposed for
        // less than 2.59 ms, this is shorter than the camera's shortest exposure of one millisecond.
        assert!(limited(2.5e-3).found.contains("not examined: the camera cannot expose for 0.00097 s"));
        assert!(!limited(2.7e-3).found.contains("not examined"));
    }
}
