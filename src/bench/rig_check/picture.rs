//! The check of the picture. It finds whether all of the frame is shown (overscan), whether the picture is sharp, and whether the back of a
//! beam splitter reflects a second image of the frame (ghost).

use rayon::prelude::*;

use crate::bench::rig_check::probe::{Probe, average, binned};
use crate::bench::rig_check::{Finding, Grade, Recorder};
use crate::error::Result;
use crate::finding::Ratio;
use crate::image::{Resolution, percentile};
use crate::measure::sight;

/// The check warns when the frame's border has less than this fraction of the expected light.
const BORDER: f64 = 0.5;

/// The check warns when stripes are blurred by more projector pixels than this. Camera pixels as large as projector pixels cause a blur of
/// up to 0.35.
const BLUR: f64 = 0.6;

/// The check warns when a second image has more than this fraction of the first image's light. A mirror ball in the scene and noise of an
/// 8-bit camera have caused a second image of 1.2 %.
const GHOST: f64 = 0.02;

/// The least number of pixels along an axis that the checks of sharpness and ghost need.
const LEAST_PIXELS: usize = 24;

/// The periods of fine and coarse stripes, in projector pixels.
const STRIPES: [usize; 2] = [4, 16];

/// The width of the examined border, as a fraction of the frame's shorter side.
const BORDER_SHARE: f64 = 0.0125;

/// Photographs the border, stripes and dots: five frames.
pub(crate) fn picture(probe: &mut Probe<'_>, recorder: &mut Recorder<'_, '_>) -> Result<()> {
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

/// Checks whether the outermost rows and columns of the frame are seen. In a coaxial rig, the total light of a photo of the border equals
/// the light of white in the area where the border should be seen.
fn border(probe: &mut Probe<'_>) -> Result<Finding> {
    let (projector, camera) = (probe.projector(), probe.camera());
    let wide = ((BORDER_SHARE * projector.width.min(projector.height) as f64).round() as usize).max(1);
    let light = probe
        .pattern(|x, y| x.min(projector.width - 1 - x) < wide || y.min(projector.height - 1 - y) < wide)?;
    let margin = [(camera.width, projector.width), (camera.height, projector.height)]
        .map(|(camera, projector)| wide as f64 * camera as f64 / projector as f64);
    // The fraction of a camera pixel, along an axis, that lies within the border.
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
    let found = format!(
        "the outermost {rows} at each side give {:.0} % of the light that white has there",
        100.0 * share
    );
    let expected = format!("at least {:.0} %", 100.0 * BORDER);
    let help = "switch off overscan and keystone correction in the projector's menu, so that it shows its pixels one to one; or the camera \
                does not see all of the frame: then leave the border dark";
    Ok(Finding::at_least("border", [share, 0.0, BORDER], Grade::Warning, found, expected, help))
}

/// Compares the sharpness of fine stripes and coarse stripes. The fine stripes are shown in two positions, a quarter of a period apart, so
/// that the positions of the camera's pixels do not matter.
fn sharpness(probe: &mut Probe<'_>) -> Result<Finding> {
    let [fine, coarse] = STRIPES;
    let ratio = probe.camera().width as f64 / probe.projector().width as f64;
    if ratio < sight::LEAST_PIXELS {
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
    let contrast = Ratio::of(average(&amplitudes), reference, 0.0).value().filter(|&contrast| contrast > 0.0);
    let Some(contrast) = contrast else {
        return Ok(Finding::unmeasured("sharpness", "the photo shows no stripes"));
    };
    // The amplitude of the first harmonic of sharp stripes, averaged over a camera pixel.
    let pixel = std::f64::consts::PI / (fine as f64 * ratio);
    let sharp = 4.0 / std::f64::consts::PI * pixel.sin() / pixel;
    let frequency = std::f64::consts::TAU / fine as f64;
    let blur = (2.0 * (sharp / contrast).ln().max(0.0)).sqrt() / frequency;
    let found = format!(
        "stripes of {} projector pixels are blurred by {blur:.2} projector pixels, or {:.2} of the camera's (standard deviation)",
        fine / 2,
        blur * ratio
    );
    let expected = format!("at most {BLUR} projector pixels");
    let help = "focus the camera (`krylux rig preview`), then the projector, and close the camera's aperture; a scene of wax or marble blurs as well";
    Ok(Finding::at_most("sharpness", [blur, 0.0, BLUR], Grade::Warning, found, expected, help))
}

/// The distance between dots and the side of a dot, in projector pixels. A ghost repeats all dots with the same displacement, whereas light
/// of the scene differs between dots.
const DOTS: [usize; 2] = [16, 2];

/// The range of distances of a second image, in projector pixels. A nearer second image cannot be distinguished from the first image, and a
/// farther one not from the second image of the next dot.
const RANGE: [f64; 2] = [3.5, 7.5];

/// A second image is a ghost if it is this many times as strong as any other one. Mirrors in the scene cause several second images.
const STANDS_OUT: f64 = 2.5;

/// The largest relative strength of a second image. A stronger image is another dot, which is nearer than expected if the camera sees more
/// than the frame.
const LARGEST: f64 = 0.4;

/// The largest number of photo pixels per projector pixel. A finer photo is first downsampled.
const FINEST: f64 = 3.0;

/// Photographs dots, and correlates the photo with displaced copies of itself.
pub(crate) fn ghost(probe: &mut Probe<'_>) -> Result<Finding> {
    let [distance, side] = DOTS;
    let light = probe.pattern(|x, y| [x, y].iter().all(|at| (at + distance / 2) % distance < side))?;
    let ratio = probe.camera().width as f64 / probe.projector().width as f64;
    let (light, size) = binned(&light, probe.camera(), ((ratio / FINEST).ceil() as usize).max(1));
    let ratio = size.width as f64 / probe.projector().width as f64;
    let found = second(&light, size, ratio);
    let is_double = found.is_some_and(|[share, ..]| share > GHOST);
    let text = match found {
        Some([share, right, down]) => format!(
            "a second image of dots has {:.1} % of their light, {:.1} projector pixels away{}",
            100.0 * share,
            right.hypot(down),
            if is_double { ": a ghost, as of the beam splitter's back" } else { "" }
        ),
        None => "dots have no second image that stands out".into(),
    };
    let grade = if is_double { Grade::Warning } else { Grade::Ok };
    let help = "use a beam splitter with an anti-reflection coating on its back, or a pellicle; clean the lenses; glass in front of the scene \
                has the same effect";
    Ok(Finding::graded("ghost", grade, text, format!("at most {:.0} %", 100.0 * GHOST), help))
}

/// The strongest second image of a photo of dots: its strength relative to the first image, and its displacement in projector pixels. The
/// sign of the displacement is unknown. `ratio` is the number of photo pixels per projector pixel.
fn second(light: &[f64], size: Resolution, ratio: f64) -> Option<[f64; 3]> {
    let background = percentile(light.iter().copied(), 0.5);
    let light: Vec<f64> = light.iter().map(|value| value - background).collect();
    let reach = (DOTS[0] as f64 / 2.0 * ratio).ceil() as i64;
    let side = 2 * reach + 1;
    let correlation: Vec<f64> = (0..side * side)
        .into_par_iter()
        .map(|at| correlation(&light, size, [at % side - reach, at / side - reach]))
        .collect();
    let whole = correlation[(reach * side + reach) as usize];
    let at = |[x, y]: [i64; 2]| correlation[((y + reach) * side + x + reach) as usize] / whole;
    let ring = |[x, y]: [i64; 2], near: f64, far: f64| {
        let far = (far * ratio).ceil() as i64;
        let points = (-far..=far).flat_map(move |v| (-far..=far).map(move |u| [u, v]));
        let inside =
            |&[u, v]: &[i64; 2]| (x + u).abs() <= reach && (y + v).abs() <= reach && [u, v] != [0, 0];
        let distant = move |&[u, v]: &[i64; 2]| u.abs().max(v.abs()) as f64 >= near * ratio;
        points.filter(inside).filter(distant).map(|[u, v]| at([x + u, y + v])).collect::<Vec<f64>>()
    };
    // A displacement and its opposite have the same correlation, so only half of all displacements are tried.
    let lags = (0..=reach).flat_map(|y| (-reach..=reach).map(move |x| [x, y]));
    let is_in_range = |&[x, y]: &[i64; 2]| {
        let distance = x.abs().max(y.abs()) as f64 / ratio;
        (y > 0 || x > 0) && distance > RANGE[0] && distance < RANGE[1]
    };
    let mut peaks: Vec<(f64, [i64; 2])> = lags
        .filter(is_in_range)
        .filter(|&lag| {
            let value = at(lag);
            value <= LARGEST && ring(lag, 0.0, 1.5).iter().all(|&other| other <= value)
        })
        .map(|lag| (at(lag) - percentile(ring(lag, 2.0, 3.5), 0.5), lag))
        .collect();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let &(share, [x, y]) = peaks.first()?;
    let next = peaks.iter().skip(1).find(|(_, [u, v])| {
        // Neighbouring displacements belong to the same peak. Opposite displacements also belong to the same peak, where both are tried: on
        // the horizontal axis.
        let near = |sign: i64| (u - sign * x).abs().max((v - sign * y).abs()) as f64 <= 1.5 * ratio;
        !near(1) && !near(-1)
    });
    let stands_out = next.is_none_or(|(next, _)| share > STANDS_OUT * next);
    stands_out.then_some([share, x as f64 / ratio, y as f64 / ratio])
}

/// The sum of the products of a picture's pixels with the pixels that are displaced by `[right, down]`.
fn correlation(light: &[f64], size: Resolution, [right, down]: [i64; 2]) -> f64 {
    // The first column or row of the overlap, in the picture and in its displaced copy.
    let starts = |by: i64| [by.min(0).unsigned_abs() as usize, by.max(0) as usize];
    let ([x0, x1], [y0, y1]) = (starts(right), starts(down));
    let [columns, rows] = [size.width.saturating_sub(x0 + x1), size.height.saturating_sub(y0 + y1)];
    if columns == 0 {
        return 0.0;
    }
    let line = |x: usize, y: usize| &light[y * size.width + x..][..columns];
    (0..rows)
        .map(|row| line(x0, y0 + row).iter().zip(line(x1, y1 + row)).map(|(a, b)| a * b).sum::<f64>())
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::rig_check::probe::take;
    use crate::bench::rig_check::recorded;
    use crate::image::Resolution;
    use crate::measure::CaptureRequest;
    use crate::measure::simulated::Simulated;

    /// For each of `coarse` pixels in a row, the weights of the `fine` pixels that it covers. The two kinds of pixels span the same field.
    fn shares(coarse: usize, fine: usize) -> Vec<Vec<(usize, f64)>> {
        let scale = fine as f64 / coarse as f64;
        let one = |at: usize| {
            let [from, to] = [at as f64 * scale, (at + 1) as f64 * scale];
            let share = |pixel: usize| (to.min((pixel + 1) as f64) - from.max(pixel as f64)) / scale;
            (0..fine).map(|pixel| (pixel, share(pixel))).filter(|(_, share)| *share > 0.0).collect()
        };
        (0..coarse).map(one).collect()
    }

    /// Resamples a picture to the pixels of `to`. Each new pixel is the mean over its area.
    fn resampled(light: &[f64], from: Resolution, to: Resolution) -> Vec<f64> {
        let [across, down] = [shares(to.width, from.width), shares(to.height, from.height)];
        let value = |pixel: usize| {
            let row = |&(y, b): &(usize, f64)| -> f64 {
                let row = across[pixel % to.width].iter();
                row.map(|&(x, a)| a * b * light[y * from.width + x]).sum()
            };
            down[pixel / to.width].iter().map(row).sum()
        };
        (0..to.pixels()).map(value).collect()
    }

    /// The finding of `check` on a bench without a calibration. `optics` converts the projector's light to the light in the camera's
    /// pixels. White has 50,000 counts above 100.
    fn found<T>(
        [projector, camera]: [Resolution; 2],
        optics: impl Fn(&[f64]) -> Vec<f64> + Send,
        check: impl FnOnce(&mut Probe<'_>) -> Result<T>,
    ) -> T {
        let photo = move |request: &CaptureRequest, _| {
            let light: Vec<f64> =
                request.frame.levels().iter().map(|&level| f64::from(level) / 255.0).collect();
            optics(&light).iter().map(|light| (100.0 + 50_000.0 * light).round() as u16).collect()
        };
        let mut frames = Simulated::new(projector, camera, 16, photo);
        let photos = take(&mut frames, 0.1).expect("a simulated bench never fails");
        let mut probe = Probe::new(&mut frames, None, &photos, 0.1, true);
        check(&mut probe).expect("a simulated bench never fails")
    }

    fn numbers(finding: &Finding) -> Vec<f64> {
        finding.found.split(' ').filter_map(|word| word.parse().ok()).collect()
    }

    #[test]
    fn a_border_that_is_seen_has_all_of_its_light_whatever_the_pixels_are() {
        let projector = Resolution::new(48, 32);
        for camera in [projector, Resolution::new(72, 64), Resolution::new(40, 28)] {
            // The scene is three times as bright at one side as at the other.
            let scene = |light: &[f64]| {
                let lit = light.iter().enumerate().map(|(pixel, l)| l * (0.25 + (pixel % 48) as f64 / 96.0));
                resampled(&lit.collect::<Vec<f64>>(), projector, camera)
            };
            let finding = found([projector, camera], scene, border);
            assert!(finding.grade == Grade::Ok && finding.found.contains("row and column at"), "{finding}");
            // The border covers some camera pixels in part. The scene is assumed to be even within them, although it changes by up to 5 %.
            assert!((numbers(&finding)[0] - 100.0).abs() <= 1.0, "{finding}");
        }
    }

    /// With overscan, the projector enlarges its frame, so the outermost columns or rows are not shown. Here these are two at each side, as
    /// wide as the pattern's border. The border has 240 · 160 − 236 · 156 = 1584 pixels.
    #[test]
    fn a_border_that_is_cut_off_at_two_sides_has_the_light_of_the_other_two() {
        let size = Resolution::new(240, 160);
        for (lost, share, grade) in [
            ([0, 0], 100.0, Grade::Ok),
            ([2, 0], 100.0 * 2.0 * 2.0 * 240.0 / 1584.0, Grade::Ok),
            ([0, 2], 100.0 * 2.0 * 2.0 * 160.0 / 1584.0, Grade::Warning),
            ([2, 2], 0.0, Grade::Warning),
        ] {
            let inside = |at: usize, lost: usize, of: usize| at.clamp(lost, of - 1 - lost);
            let from =
                |pixel: usize| inside(pixel / 240, lost[1], 160) * 240 + inside(pixel % 240, lost[0], 240);
            let overscan = |light: &[f64]| (0..size.pixels()).map(|pixel| light[from(pixel)]).collect();
            let finding = found([size; 2], overscan, border);
            assert!(
                finding.grade == grade && finding.found.contains("outermost 2 rows and columns"),
                "{finding}"
            );
            // The finding states an integer percentage. The first number is the width.
            assert!((numbers(&finding)[1] - share).abs() <= 0.5, "{finding}");
        }
    }

    /// The border has 1584 of 38,400 pixels, or 4.1 %. If the border's reflectance is `b` times the reflectance of the other pixels, the
    /// border has `b / (0.959 + 0.041 b)` of the light that it would have in an even scene: 5.5 and 4.5 %.
    #[test]
    fn a_border_is_not_examined_where_the_scene_is_dark_there() {
        let size = Resolution::new(240, 160);
        for (b, is_examined) in [(0.053, true), (0.043, false)] {
            let is_border = |pixel: usize| {
                let [x, y] = [pixel % 240, pixel / 240];
                x.min(239 - x) < 2 || y.min(159 - y) < 2
            };
            let scene = |light: &[f64]| {
                let lit = |(pixel, light): (usize, &f64)| light * if is_border(pixel) { b } else { 1.0 };
                light.iter().enumerate().map(lit).collect()
            };
            let finding = found([size; 2], scene, border);
            assert_eq!(!finding.found.contains("not examined"), is_examined, "{finding}");
        }
    }

    fn blurred(light: &[f64], width: i64, deviation: f64) -> Vec<f64> {
        let weight = |by: i64| (-0.5 * (by as f64 / deviation).powi(2)).exp();
        let sum: f64 = (-20..=20).map(weight).sum();
        let one = |pixel: i64| {
            let at = |by: i64| pixel / width * width + (pixel % width + by).clamp(0, width - 1);
            (-20..=20).map(|by| weight(by) * light[at(by) as usize]).sum::<f64>() / sum
        };
        (0..light.len() as i64).map(one).collect()
    }

    /// Stripes blurred by `σ` keep the fraction `exp(−f² σ² / 2)` of their first harmonic, with f = π/2 for a period of four. The coarse
    /// stripes have an edge every eight pixels, and lose `2 σ √(2/π)` of their light at each edge. The check finds the blur from the ratio
    /// of the fine stripes' harmonic to the coarse stripes' light.
    #[test]
    fn the_blur_of_stripes_is_found_in_pixels_of_both_devices() {
        let [projector, camera] = [Resolution::new(96, 24), Resolution::new(384, 24)];
        for (deviation, grade) in [(0.6, Grade::Ok), (0.8, Grade::Warning), (1.0, Grade::Warning)] {
            let optics = |light: &[f64]| blurred(&resampled(light, projector, camera), 384, 4.0 * deviation);
            let finding = found([projector, camera], optics, sharpness);
            let left = 1.0 - 2.0 * deviation * (2.0 / std::f64::consts::PI).sqrt() / 8.0;
            let expected = (deviation.powi(2) + 2.0 * left.ln() / std::f64::consts::FRAC_PI_2.powi(2)).sqrt();
            let said = numbers(&finding);
            assert_eq!(said.len(), 3, "{finding}");
            let (period, blur, of_camera) = (said[0], said[1], said[2]);
            // The tolerance allows for the higher harmonics, and for the borders of the picture, which are blurred differently.
            assert!((blur - expected).abs() < 0.02, "{finding}; expected {expected}");
            assert!(
                period == 2.0 && (of_camera - 4.0 * blur).abs() < 0.03 && finding.grade == grade,
                "{finding}"
            );
        }
    }

    #[test]
    fn stripes_are_sharp_where_each_pixel_is_seen_and_not_examined_where_the_camera_is_coarser() {
        let projector = Resolution::new(32, 24);
        for (width, text) in
            [(32, "blurred by 0.00 projector pixels"), (24, "blurred by"), (23, "not examined")]
        {
            let camera = Resolution::new(width, 24);
            let optics = |light: &[f64]| resampled(light, projector, camera);
            let finding = found([projector, camera], optics, sharpness);
            assert!(finding.grade == Grade::Ok && finding.found.contains(text), "{finding}");
        }
    }

    #[test]
    fn a_small_projector_has_room_for_the_border_alone() {
        for (height, names) in [(23, &["border"][..]), (24, &["border", "sharpness", "ghost"])] {
            let size = Resolution::new(32, height);
            let all =
                found([size; 2], <[f64]>::to_vec, |probe| Ok(recorded(|recorder| picture(probe, recorder))));
            assert_eq!(all.iter().map(|finding| &*finding.name).collect::<Vec<_>>(), names);
        }
    }

    /// A photo of dots and their second image on a varying background, with two photo pixels per projector pixel.
    fn dots(share: f64) -> (Vec<f64>, Resolution) {
        let size = Resolution::new(128, 128);
        let dot =
            |x: i64, y: i64| [x, y].iter().all(|at| (0..128).contains(at) && (at + 16) % 32 < 4) as u8 as f64;
        let light = (0..size.pixels()).map(|pixel| {
            let [x, y] = [(pixel % 128) as i64, (pixel / 128) as i64];
            dot(x, y) + share * dot(x - 10, y + 4) + 0.004 * (0.3 * x as f64 + 0.2 * y as f64).sin()
        });
        (light.collect(), size)
    }

    /// The correlation is compared with sums of products of integers, for every displacement and some that exceed the picture.
    #[test]
    fn a_correlation_is_the_sum_over_all_pairs_of_pixels_that_far_apart() {
        let size = Resolution::new(5, 4);
        let light: Vec<f64> = (0..20).map(|pixel| f64::from(pixel * pixel % 13)).collect();
        for (right, down) in (-6..=6).flat_map(|right| (-5..=5).map(move |down| (right, down))) {
            let mut sum = 0.0;
            for (y, x) in (0..4_i64).flat_map(|y| (0..5_i64).map(move |x| (y, x))) {
                let (u, v) = (x + right, y + down);
                if (0..5).contains(&u) && (0..4).contains(&v) {
                    sum += light[(y * 5 + x) as usize] * light[(v * 5 + u) as usize];
                }
            }
            assert_eq!(correlation(&light, size, [right, down]), sum, "{right} {down}");
        }
    }

    #[test]
    fn a_second_image_is_found_with_its_share_and_place_and_its_absence_too() {
        let (light, size) = dots(0.03);
        let [share, right, down] = second(&light, size, 2.0).expect("it is there");
        assert!((share - 0.03).abs() < 0.005, "{share}");
        assert_eq!(
            (right.abs(), down.abs(), right * down < 0.0),
            (5.0, 2.0, true),
            "two to the top, five to the right"
        );
        let (light, size) = dots(0.0);
        assert!(second(&light, size, 2.0).is_none_or(|[share, ..]| share < 0.005));
    }
}
