//! The check of the picture: whether all of the frame is shown (overscan), whether it is sharp, and whether there is a second image of it
//! (ghost).

use super::ghost::ghost;
use super::probe::{Probe, average};
use super::thresholds::{BLUR, BORDER};
use super::{Finding, Grade, Recorder};
use crate::error::Result;

/// A projector with fewer pixels along an axis has no room for the patterns of sharpness and ghost.
const LEAST_PIXELS: usize = 24;

/// The pixels of a period of fine and of coarse stripes.
const STRIPES: [usize; 2] = [4, 16];

/// The share of the frame's shorter side that is examined at each border.
const BORDER_SHARE: f64 = 0.0125;

/// Photographs the border, stripes and dots: five frames.
pub(super) fn picture(probe: &mut Probe<'_>, recorder: &mut Recorder<'_, '_>) -> Result<()> {
    let finding = border(probe)?;
    recorder.add(finding)?;
    let size = probe.projector();
    if size.width.min(size.height) < LEAST_PIXELS {
        return Ok(());
    }
    let finding = sharpness(probe)?;
    recorder.add(finding)?;
    let finding = ghost(probe)?;
    recorder.add(finding)
}

/// Whether the outermost rows and columns of the frame are seen. In a coaxial rig their light, summed over all of the photo, is the light
/// that white has where they should be seen.
fn border(probe: &mut Probe<'_>) -> Result<Finding> {
    let (projector, camera) = (probe.projector(), probe.camera());
    let wide = ((BORDER_SHARE * projector.width.min(projector.height) as f64).round() as usize).max(1);
    let light = probe
        .pattern(|x, y| x.min(projector.width - 1 - x) < wide || y.min(projector.height - 1 - y) < wide)?;
    let margin = [(camera.width, projector.width), (camera.height, projector.height)]
        .map(|(camera, projector)| wide as f64 * camera as f64 / projector as f64);
    // The part of a camera pixel, along an axis, that lies within the border.
    let within = |at: usize, of: usize, margin: f64| (margin - at.min(of - 1 - at) as f64).clamp(0.0, 1.0);
    let expected: f64 = (0..camera.pixels())
        .map(|pixel| {
            let across = within(pixel % camera.width, camera.width, margin[0]);
            let down = within(pixel / camera.width, camera.height, margin[1]);
            probe.white[pixel] * (across + down - across * down)
        })
        .sum();
    let even = (projector.pixels() - (projector.width - 2 * wide) * (projector.height - 2 * wide)) as f64
        / projector.pixels() as f64
        * probe.white.iter().sum::<f64>();
    if expected < 0.05 * even {
        return Ok(Finding::ok("border", "not examined: the scene is dark there"));
    }
    let share = light.iter().sum::<f64>() / expected;
    let rows = if wide == 1 { "row and column".into() } else { format!("{wide} rows and columns") };
    Ok(Finding::graded(
        "border",
        if share < BORDER { Grade::Warning } else { Grade::Ok },
        format!(
            "the outermost {rows} at each side give {:.0} % of the light that white has there",
            100.0 * share
        ),
        format!("at least {:.0} %", 100.0 * BORDER),
        "switch off overscan and keystone correction in the projector's menu, so that it shows its pixels one to one; or the camera \
         does not see all of the frame: then leave the border dark",
    ))
}

/// How sharp fine stripes are compared with coarse ones. The fine ones are shown in two positions, a quarter of a period apart, so that it
/// does not matter where the camera's pixels are.
fn sharpness(probe: &mut Probe<'_>) -> Result<Finding> {
    let [fine, coarse] = STRIPES;
    let ratio = probe.camera().width as f64 / probe.projector().width as f64;
    if ratio < 0.75 {
        return Ok(Finding::ok(
            "sharpness",
            "not examined: the camera's pixels are coarser than the projector's",
        ));
    }
    let mut stripes = |period: usize, from: usize| -> Result<Vec<f64>> {
        let light = probe.pattern(|x, _| (x + from) % period < period / 2)?;
        Ok(light.iter().zip(&probe.white).map(|(light, white)| 2.0 * light - white).collect())
    };
    let [even, odd, reference] = [stripes(fine, 0)?, stripes(fine, fine / 4)?, stripes(coarse, 0)?];
    let amplitudes: Vec<f64> = even.iter().zip(&odd).map(|(a, b)| a.hypot(*b)).collect();
    let reference = average(&reference.iter().map(|value| value.abs()).collect::<Vec<_>>());
    let contrast = average(&amplitudes) / reference.max(f64::MIN_POSITIVE);
    // The first harmonic of sharp stripes, averaged over a camera pixel.
    let pixel = std::f64::consts::PI / (fine as f64 * ratio);
    let sharp = 4.0 / std::f64::consts::PI * pixel.sin() / pixel;
    let frequency = std::f64::consts::TAU / fine as f64;
    let blur = (2.0 * (sharp / contrast).ln().max(0.0)).sqrt() / frequency;
    Ok(Finding::graded(
        "sharpness",
        if blur > BLUR { Grade::Warning } else { Grade::Ok },
        format!(
            "stripes of {} projector pixels are blurred by {blur:.2} projector pixels, or {:.2} of the camera's (standard deviation)",
            fine / 2,
            blur * ratio
        ),
        format!("at most {BLUR} projector pixels"),
        "focus the camera (`krylux rig preview`), then the projector, and close the camera's aperture; a scene of wax or marble blurs as well",
    ))
}
