//! Light, frames and noise, by a few photos of black and white.

use std::sync::Arc;

use anyhow::Result;

use super::super::bench::Bench;
use super::finding::{Finding, Findings, Grade};
use crate::measure::calibrate::{Observer, Reach};
use crate::measure::{CaptureRequest, Effort, FrameSource, repeat};
use crate::rig::{Frame, RawFrame};

/// Times that white is shown after black, and photographed twice.
const ROUNDS: u32 = 4;

/// White's 98th percentile, as a share of the range, below which most of the range is not used; and below which nothing is seen.
const DIM: [f64; 2] = [0.2, 0.01];

/// Share of white's samples that are saturated, from which on it is named; and fails.
const SATURATED: [f64; 2] = [0.01, 0.1];

/// Light without a pattern, as a share of white's: at so much it adds a tenth to the noise of white.
const AMBIENT: f64 = 0.2;

/// Relative change that drift and flicker may make from photo to photo; the audit's bound.
const STEADY: f64 = 0.01;

/// White right after black may lack so much of white again, as in calibration's latency.
const SETTLED: f64 = 2e-3;

/// Noise relative to what calibration predicts.
const AS_PREDICTED: [f64; 2] = [0.8, 1.25];

/// What a sequence of photos gave.
struct Session {
    black: RawFrame,
    /// The first photo after black and the one after that, of each round.
    whites: Vec<[RawFrame; 2]>,
    effort: Effort,
}

/// Looks at all of it; the exposure where white can be seen.
pub(super) fn photos(
    bench: &Bench,
    shots: &mut dyn FrameSource,
    findings: &mut Findings,
) -> Result<Option<f64>> {
    let (exposure, reach) = match bench.exposure(None) {
        Some(exposure) => (exposure, Reach::Filled),
        None => Observer::white_exposure(shots)?,
    };
    let before = shots.effort();
    let (session, floor) = session(shots, exposure, before)?;
    let is_seen = light(bench, shots, (&session, floor), (exposure, reach), findings)?;
    findings.add(frames(&session.effort))?;
    if !is_seen {
        return Ok(None);
    }
    let means = session
        .whites
        .iter()
        .map(|pair| pair.each_ref().map(|white| mean(white) - floor))
        .collect::<Vec<_>>();
    findings.add(settling(&means, bench.settle()))?;
    findings.add(steadiness(&means))?;
    if let Some(known) = &bench.known {
        let [first, second] = &session.whites[0];
        // A white that is saturated everywhere has been found fault with already.
        if let Some(found) = repeat(first, second, &known.camera, shots.camera().bits)? {
            findings.add(noise(found.z, found.error))?;
        }
    }
    Ok(Some(exposure))
}

/// The photos, and the count without light.
fn session(shots: &mut dyn FrameSource, exposure: f64, before: Effort) -> Result<(Session, f64)> {
    let info = shots.projector().clone();
    let frame = |level| Arc::new(Frame::filled(info.resolution, info.channels, level));
    let [black, white] = [frame(0), frame(info.highest())];
    let shortest = shots.camera().exposures[0];
    let mut shoot = |frame: &Arc<Frame>, exposure: f64, take: u32| {
        shots.capture(&CaptureRequest { frame: Arc::clone(frame), exposure, take })
    };
    let dark = shoot(&black, shortest, 0)?;
    let floor = percentile(&dark, 0.5);
    let mut whites = Vec::new();
    for round in 0..ROUNDS {
        shoot(&black, exposure, round)?;
        whites.push([shoot(&white, exposure, 2 * round)?, shoot(&white, exposure, 2 * round + 1)?]);
    }
    // What is left of white after a wait that is too short is no ambient light.
    shoot(&black, exposure, ROUNDS)?;
    let black = shoot(&black, exposure, ROUNDS + 1)?;
    let after = shots.effort();
    let effort = Effort {
        taken: after.taken - before.taken,
        dropped: after.dropped - before.dropped,
        repeated: after.repeated - before.repeated,
        late: after.late - before.late,
        restarts: after.restarts - before.restarts,
        resent: after.resent - before.resent,
        ..after
    };
    Ok((Session { black, whites, effort }, floor))
}

/// Exposure, saturation and ambient light; whether white can be seen at all.
fn light(
    bench: &Bench,
    shots: &dyn FrameSource,
    (session, floor): (&Session, f64),
    (exposure, reach): (f64, Reach),
    findings: &mut Findings,
) -> Result<bool> {
    let full = f64::from((1_u32 << shots.camera().bits) - 1);
    let limit = bench.known.as_ref().map_or(full, |known| known.camera.saturation);
    let white = &session.whites[0][1];
    let reached = (percentile(white, 0.98) - floor) / (full - floor);
    let over = white.counts.iter().filter(|&&count| f64::from(count) >= limit).count() as f64;
    let over = over / white.counts.len() as f64;
    let found = format!("white reaches {:.0} % of the range in {exposure:.4} s", 100.0 * reached);
    let expected = format!("{:.0} % to 90 %", 100.0 * DIM[0]);
    let (grade, help) = match (reach, reached) {
        (Reach::TooBright, _) => (Grade::Fails, "close the lens, lower the gain, or dim the projector"),
        (_, share) if share < DIM[1] => (
            Grade::Fails,
            "take off the lens cap, open the lens, or let the projector light what the camera sees",
        ),
        (_, share) if share < DIM[0] => (Grade::Warning, "expose longer, or open the lens"),
        _ => (Grade::Ok, ""),
    };
    let is_seen = reached >= DIM[1];
    findings.add(Finding::graded("exposure", grade, found, expected, help))?;
    let grade = match over {
        share if share > SATURATED[1] => Grade::Fails,
        share if share > SATURATED[0] => Grade::Warning,
        _ => Grade::Ok,
    };
    findings.add(Finding::graded(
        "saturation",
        grade,
        format!("{:.2} % of white's samples", 100.0 * over),
        format!("at most {:.0} %", 100.0 * SATURATED[0]),
        "give a shorter exposure beside, close the lens, or take glints out of the scene",
    ))?;
    let dark = (mean(&session.black) - floor) / (mean(white) - floor).max(1.0);
    let grade = if dark > AMBIENT { Grade::Warning } else { Grade::Ok };
    findings.add(Finding::graded(
        "ambient",
        grade,
        format!("black has {:.1} % of white's light", 100.0 * dark),
        format!("less than {:.0} %", 100.0 * AMBIENT),
        "darken the room: what is subtracted leaves its noise",
    ))?;
    Ok(is_seen)
}

/// Whether frames came in order, each exposed after its pattern had settled.
fn frames(effort: &Effort) -> Finding {
    let refused = effort.dropped + effort.repeated + effort.late;
    let found = match refused {
        0 => format!("{} came in order, each exposed after its pattern", effort.taken),
        _ => format!(
            "of {} frames {} did not come, {} came twice, {} were exposed too early, {} restarts of the camera",
            effort.taken + refused,
            effort.dropped,
            effort.repeated,
            effort.late,
            effort.restarts
        ),
    };
    let grade = if refused == 0 { Grade::Ok } else { Grade::Warning };
    let resent = match effort.resent {
        0 => String::new(),
        packets => format!("; {packets} packets were lost, and sent again"),
    };
    Finding::graded(
        "frames",
        grade,
        found + &resent,
        "none refused: they are taken again, which costs time",
        "check cable and network; a camera that runs free must be triggered",
    )
}

/// Whether all light of white is there when it is photographed right after black.
fn settling(means: &[[f64; 2]], settle: f64) -> Finding {
    let missing: Vec<f64> = means.iter().map(|[first, again]| 1.0 - first / again).collect();
    let (average, error) = average(&missing);
    let is_short = average.abs() - 3.0 * error > SETTLED;
    Finding::graded(
        "settling",
        if is_short { Grade::Fails } else { Grade::Ok },
        format!(
            "{settle:.4} s after a frame, white after black has {:.2} ± {:.2} % less light than white again",
            100.0 * average,
            100.0 * error
        ),
        format!("at most {} %", 100.0 * SETTLED),
        "give a longer settle in [measurement], or calibrate",
    )
}

/// Whether photos of one shot are of one brightness.
fn steadiness(means: &[[f64; 2]]) -> Finding {
    let again: Vec<f64> = means.iter().map(|[_, again]| *again).collect();
    let (middle, _) = average(&again);
    let most = again.iter().map(|value| (value / middle - 1.0).abs()).fold(0.0, f64::max);
    Finding::graded(
        "repeatability",
        if most > STEADY { Grade::Warning } else { Grade::Ok },
        format!("white's light changes by {:.3} % from photo to photo", 100.0 * most),
        format!("at most {:.0} %", 100.0 * STEADY),
        "expose for whole multiples of the refresh and of the mains' period; let the lamp warm up",
    )
}

/// Whether the noise of a photo is what calibration says.
fn noise(z: f64, error: f64) -> Finding {
    let [least, most] = AS_PREDICTED;
    let is_off = z - 3.0 * error > most || z + 3.0 * error < least;
    Finding::graded(
        "noise",
        if is_off { Grade::Warning } else { Grade::Ok },
        format!("two photos of white differ by {z:.3} ± {error:.3} times what calibration predicts"),
        format!("{least} to {most}"),
        "more is vibration or flicker; less or more may be another gain: calibrate again",
    )
}

fn mean(frame: &RawFrame) -> f64 {
    frame.counts.iter().map(|&count| f64::from(count)).sum::<f64>() / frame.counts.len() as f64
}

/// The mean of a few values, and its standard error.
fn average(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0).max(1.0) / count).sqrt())
}

/// The count below which the share `rank` lies.
fn percentile(frame: &RawFrame, rank: f64) -> f64 {
    let mut counts = frame.counts.clone();
    let at = ((counts.len() - 1) as f64 * rank).round() as usize;
    f64::from(*counts.select_nth_unstable(at).1)
}
