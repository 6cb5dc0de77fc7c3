//! The check of light within the time of a frame: pulses of the projector (PWM, colour wheel), and the camera's rolling shutter.

use super::probe::{Probe, average};
use super::thresholds::{PULSES, PULSES_UNCALIBRATED, ROLLING};
use super::{Finding, Grade, Recorder};
use crate::error::Result;

/// Exposures in refreshes of the projector that are not whole multiples of it, or of its usual parts.
const EXPOSURES: [f64; 3] = [0.63, 1.37, 1.63];

/// A refresh in seconds, where the projector's is not known.
const REFRESH: f64 = 1.0 / 60.0;

/// By how many counts rounding may change the mean of a photo.
const ROUNDING: f64 = 0.3;

/// Takes six photos of white at short exposures.
pub(super) fn pulses(probe: &mut Probe<'_>, recorder: &mut Recorder<'_, '_>) -> Result<()> {
    let [shortest, _] = probe.frames.camera().exposures;
    let refresh = match probe.frames.projector().frame_time {
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
    let white = probe.filled(true);
    let [dark, black] = probe.unlit.clone();
    let mut rates: Vec<Vec<f64>> = Vec::new();
    let mut error = 0.0_f64;
    // The first photo of a frame may have light of the frame before.
    probe.capture(&white, probe.exposure)?;
    for exposure in EXPOSURES.iter().chain(&EXPOSURES).map(|share| share * base) {
        let photo = probe.capture(&white, exposure)?;
        let light = probe.channels(&photo);
        // Light per second above that of black.
        let rate = |channel: usize| {
            let [light, dark, black] = [light[channel], dark[channel], black[channel]];
            (light - dark) / photo.exposure - (black - dark) / probe.exposure
        };
        rates.push((0..light.len()).map(rate).collect());
        error = error.max(ROUNDING / (average(&light) - average(&dark)).max(ROUNDING));
    }
    let spread = (0..rates[0].len()).map(|channel| {
        let rates: Vec<f64> = rates.iter().map(|rates| rates[channel]).collect();
        let (least, most) =
            rates.iter().fold((f64::MAX, f64::MIN), |(low, high), &rate| (low.min(rate), high.max(rate)));
        (most - least) / average(&rates).max(f64::MIN_POSITIVE)
    });
    recorder.add(pulsed(probe, spread.fold(0.0, f64::max), error, base))
}

/// Whether white has the same light per second at exposures of parts of a refresh.
fn pulsed(probe: &Probe<'_>, spread: f64, error: f64, base: f64) -> Finding {
    let bound = if probe.is_known { PULSES } else { PULSES_UNCALIBRATED };
    let is_pulsed = spread - 3.0 * error > bound;
    let what = if is_pulsed { ": the projector's light is pulsed (PWM or a colour wheel)" } else { "" };
    Finding::graded(
        "pulses",
        if is_pulsed { Grade::Warning } else { Grade::Ok },
        format!(
            "white's light per second differs by {:.1} % between exposures of {:.4} to {:.4} s{what}",
            100.0 * spread,
            EXPOSURES[0] * base,
            EXPOSURES[2] * base
        ),
        format!("at most {:.0} %", 100.0 * bound),
        "use only exposures that are whole multiples of the projector's refresh (the program chooses such ones where frame_time is \
         right), and long ones; an LCD or LCoS projector shows steadily",
    )
}

/// Photographs white right after black, without waiting for it to settle: two photos. `settle` is restored.
pub(super) fn shutter(probe: &mut Probe<'_>, settle: f64, recorder: &mut Recorder<'_, '_>) -> Result<()> {
    let [black, white] = [probe.filled(false), probe.filled(true)];
    probe.capture(&black, probe.exposure)?;
    let dark = probe.capture(&black, probe.exposure)?;
    probe.frames.set_settle(0.0);
    let switched = probe.capture(&white, probe.exposure);
    probe.frames.set_settle(settle);
    let (light, dark) = (probe.light(&switched?), probe.light(&dark));
    let width = probe.camera().width;
    let rows = probe.camera().height;
    let share = |rows: std::ops::Range<usize>| {
        let pixels = rows.start * width..rows.end * width;
        let shown: f64 = pixels.clone().map(|pixel| light[pixel] - dark[pixel]).sum();
        shown / probe.white[pixels].iter().sum::<f64>().max(f64::MIN_POSITIVE)
    };
    let quarter = (rows / 4).max(1);
    let [first, last] = [share(0..quarter), share(rows - quarter..rows)];
    recorder.add(rolling(probe, first, last))
}

/// Whether the first rows of a photo see less of a frame that has just been shown than the last rows.
fn rolling(probe: &Probe<'_>, first: f64, last: f64) -> Finding {
    let is_rolling = last - first - probe.scatter > ROLLING;
    let found = if is_rolling {
        format!(
            "the first rows see {:.0} % of a frame that was just shown, and the last rows {:.0} %: the rows are exposed one after the \
             other (rolling shutter), the last at least {:.4} s after the first",
            100.0 * first,
            100.0 * last,
            (last - first) * probe.exposure
        )
    } else {
        format!(
            "all rows see the same of a frame that was just shown, within {:.1} %",
            100.0 * (last - first).abs()
        )
    };
    Finding::graded(
        "shutter",
        if is_rolling { Grade::Warning } else { Grade::Ok },
        found,
        format!("within {:.0} %", 100.0 * ROLLING),
        "set the camera to a global shutter; otherwise wait until the light has settled for all rows (settle in [measurement]), and use \
         exposures that are whole multiples of the refresh and of the mains period",
    )
}
