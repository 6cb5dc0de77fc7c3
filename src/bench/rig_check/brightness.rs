//! The check of the projector's brightness. It finds whether the brightness depends on the frame (automatic iris), whether all levels are
//! shown (limited-range video), and whether light reaches the camera without the scene (stray light).

use crate::bench::rig_check::probe::{Probe, average, binned};
use crate::bench::rig_check::{Finding, Grade, Recorder};
use crate::error::Result;
use crate::finding::{Ratio, SIGMAS};
use crate::image::percentile;

/// The bound on an automatic iris: the sum of the quadrants of white may differ from white by this fraction.
const IRIS: f64 = 0.02;

/// The bound on an automatic iris where the camera's response is not known. A response of `x^0.95` causes a difference of 4 %.
const IRIS_UNCALIBRATED: f64 = 0.05;

/// The bound on the white segment of a colour wheel: the sum of red, green and blue may differ from gray by this fraction.
const COLOURS: f64 = 0.02;

/// The bound on a white segment where the camera's response is not known. With a monochrome camera, `x^0.95` causes a difference of 5.6 %.
const COLOURS_UNCALIBRATED: f64 = 0.07;

/// The bound on stray light: the fraction of white's light that reaches all pixels evenly and follows the pattern.
const STRAY: f64 = 0.02;

/// The check warns when level 235 of 255 is darker than white by less than this fraction. With a linear response, this level is 8 % darker.
const CLIPPED: f64 = 0.01;

/// The levels by which limited-range video is recognized, as fractions of the highest level.
const VIDEO_ENDS: [f64; 2] = [16.0 / 255.0, 235.0 / 255.0];

/// The number of blocks along an axis into which the picture is divided to detect stray light.
const BLOCKS: usize = 24;

/// The exponent that distinguishes stray light from light of the scene. The light of the darkest blocks is compared with their light under
/// white. Stray light grows at most as this power of the light under white, whereas light of the scene grows in proportion to it.
const EVEN: f64 = 0.5;

/// The smallest standard deviation of the logarithms of brightness from which the exponent can be determined.
const LEAST_SPREAD: f64 = 0.05;

/// The approximate time that an iris needs to adapt to a frame, in seconds.
const IRIS_SECONDS: f64 = 1.5;

/// Photographs white, its four quadrants, white again, and two levels near black and white: eight frames. `settle` is the usual wait.
pub(crate) fn brightness(probe: &mut Probe<'_>, settle: f64, recorder: &mut Recorder<'_, '_>) -> Result<()> {
    probe.session.set_settle(settle.max(IRIS_SECONDS));
    let photos = quadrants(probe);
    probe.session.set_settle(settle);
    let (whites, quadrants) = photos?;
    recorder.add(iris(probe, whites.each_ref().map(|white| average(white)), &quadrants))?;
    recorder.add(stray(probe, &quadrants))?;
    if probe.session.projector().bits >= 6 {
        let ends = [probe.gray(VIDEO_ENDS[0])?, probe.gray(VIDEO_ENDS[1])?];
        let white = average(&probe.white);
        recorder.add(match ends.map(|light| Ratio::of(average(&light), white, 0.0).value()) {
            [Some(low), Some(high)] => levels(probe, [low, high]),
            _ => Finding::unmeasured("levels", "white has no more light than black"),
        })?;
    }
    Ok(())
}

/// The light of each pixel of a photo.
type Light = Vec<f64>;

/// Photos of white before and after the quadrants, and of each quadrant.
fn quadrants(probe: &mut Probe<'_>) -> Result<([Light; 2], Vec<Light>)> {
    let size = probe.projector();
    let quadrant =
        |x: usize, y: usize| usize::from(2 * x >= size.width) + 2 * usize::from(2 * y >= size.height);
    let before = probe.gray(1.0)?;
    let quadrants =
        (0..4).map(|index| probe.pattern(|x, y| quadrant(x, y) == index)).collect::<Result<Vec<_>>>()?;
    Ok(([before, probe.gray(1.0)?], quadrants))
}

fn iris(probe: &Probe<'_>, [before, after]: [f64; 2], quadrants: &[Vec<f64>]) -> Finding {
    let sum: f64 = quadrants.iter().map(|light| average(light)).sum();
    let white = 0.5 * (before + after);
    let shares = [sum - white, before - after].map(|off| Ratio::of(off, white, 0.0).value());
    let [Some(off), Some(change)] = shares else {
        return Finding::unmeasured("iris", "white has no more light than black");
    };
    let bound = if probe.is_known { IRIS } else { IRIS_UNCALIBRATED };
    // Pulses and flicker change each photo by the scatter. The sum of the four quadrants changes by half of the scatter.
    let scatter = (0.5 * probe.scatter).max(change.abs());
    let is_off = off.abs() - 1.5 * scatter > bound;
    let found = match (is_off, off < 0.0) {
        (false, _) => format!("the quadrants of white add up to it within {:.2} %", 100.0 * off.abs()),
        (_, true) => format!(
            "the projector dims dark frames: the quadrants of white together have {:.1} % less light than white (automatic iris)",
            -100.0 * off
        ),
        (_, false) => format!(
            "the projector dims bright frames: the quadrants of white together have {:.1} % more light than white (automatic iris, \
             or a limit of its power)",
            100.0 * off
        ),
    };
    let help = "switch off the automatic iris, dynamic contrast and eco mode in the projector's menu";
    let help = calibrated_or(probe, help);
    let beyond = if probe.is_known { Grade::Fails } else { Grade::Warning };
    let expected = format!("within {:.0} %", 100.0 * bound);
    Finding::at_most("iris", [off.abs(), 0.5 * scatter, bound], beyond, found, expected, help)
}

/// Checks whether a part of the light reaches all pixels evenly, in proportion to the mean of the pattern. Light of the scene is uneven:
/// light from far away is weak somewhere, and is proportional to the pixel's reflectance.
fn stray(probe: &Probe<'_>, quadrants: &[Vec<f64>]) -> Finding {
    let side = (probe.camera().width.min(probe.camera().height) / BLOCKS).max(1);
    let small = |light: &[f64]| binned(light, probe.camera(), side).0;
    let white = small(&probe.white);
    let quadrants: Vec<Vec<f64>> = quadrants.iter().map(|light| small(light)).collect();
    let unit = average(&white);
    // The mean light of a quadrant is a quarter of the mean light of white.
    let least =
        |block: usize| quadrants.iter().map(|light| 4.0 * light[block]).fold(f64::MAX, f64::min) / unit;
    let floor: Vec<f64> = (0..white.len()).map(least).collect();
    let share = percentile(floor.iter().copied(), 0.02).max(0.0);
    let limit = percentile(floor.iter().copied(), 0.25);
    let points: Vec<[f64; 2]> = white
        .iter()
        .zip(&floor)
        .filter(|&(&white, &floor)| white > 0.0 && floor > 0.0 && floor <= limit)
        .map(|(white, floor)| [white.ln(), floor.ln()])
        .collect();
    let is_even = slope(&points).is_none_or(|[slope, error]| slope + 2.0 * error < EVEN);
    let is_stray = is_even && share - probe.scatter > STRAY;
    let found = if is_stray {
        format!(
            "{:.1} % of white's light reaches all pixels evenly, and follows the pattern: stray light",
            100.0 * share
        )
    } else if share > STRAY {
        format!("{:.1} % of white's light reaches all pixels by way of the scene", 100.0 * share)
    } else {
        format!("{:.1} % of white's light reaches all pixels evenly, at most", 100.0 * share)
    };
    let grade = if is_stray { Grade::Warning } else { Grade::Ok };
    let expected = format!("at most {:.0} %", 100.0 * STRAY);
    let help = "cover the scene with black cloth: if that light remains, blacken or tilt the light trap behind the beam splitter, and shade \
                the lens; otherwise the scene itself exchanges that light";
    let finding = Finding::graded("stray light", grade, found, expected, help);
    finding.measured(share, probe.scatter / SIGMAS, STRAY)
}

/// The slope of a line through points, and its standard error. `None` for fewer than nine points or nearly equal first coordinates.
fn slope(points: &[[f64; 2]]) -> Option<[f64; 2]> {
    let count = points.len() as f64;
    let mean = |axis: usize| points.iter().map(|point| point[axis]).sum::<f64>() / count;
    let [mean_x, mean_y] = [mean(0), mean(1)];
    let spread: f64 = points.iter().map(|[x, _]| (x - mean_x).powi(2)).sum();
    if points.len() < 9 || spread < LEAST_SPREAD.powi(2) * count {
        return None;
    }
    let slope = points.iter().map(|[x, y]| (x - mean_x) * (y - mean_y)).sum::<f64>() / spread;
    let residual: f64 = points.iter().map(|[x, y]| (y - mean_y - slope * (x - mean_x)).powi(2)).sum();
    Some([slope, (residual / (count - 2.0) / spread).sqrt()])
}

/// Checks whether the highest levels differ. `ends` is the light of levels 16 and 235 of 255, relative to white.
fn levels(probe: &Probe<'_>, ends: [f64; 2]) -> Finding {
    let [low, high] = ends;
    let is_clipped = (1.0 - high).abs() + 1.5 * probe.scatter < CLIPPED;
    let found = if is_clipped {
        format!(
            "levels from 235 to 255 are equally bright, and level 16 has {:.2} % of white's light: the signal is taken for limited-range \
             video, or the contrast is set too high",
            100.0 * low
        )
    } else {
        format!(
            "of 255, level 16 has {:.2} % of white's light, and level 235 {:.1} %",
            100.0 * low,
            100.0 * high
        )
    };
    let expected = format!("level 235 at least {:.0} % darker than level 255", 100.0 * CLIPPED);
    let help = "set the projector's input and the graphics card to full range (0 to 255, \"PC\"), lower the contrast, and calibrate again";
    let darker = [(1.0 - high).abs(), 0.5 * probe.scatter, CLIPPED];
    Finding::at_least("levels", darker, Grade::Warning, found, expected, help)
}

// The check of the projector's colours: whether red, green and blue add up to gray of the same level.
//
// If a colour wheel has a white segment, gray is brighter than the sum of its colours. The same is true of a projector that trades
// saturation for brightness. Photos are then linear in gray patterns, but not in coloured patterns.

/// The levels of the colours, as fractions of the highest level. A projector may use its white segment for bright colours only.
const LEVELS: [f64; 2] = [1.0, 0.5];

/// Photographs gray, red, green and blue at two levels: eight frames. A gray projector needs no photos.
pub(crate) fn colours(probe: &mut Probe<'_>, recorder: &mut Recorder<'_, '_>) -> Result<()> {
    if probe.session.projector().channels != 3 {
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

/// Judges the sum of the three colours: its relative differences from gray at both levels.
fn sum(probe: &Probe<'_>, off: [f64; 2]) -> Finding {
    let bound = if probe.is_known { COLOURS } else { COLOURS_UNCALIBRATED };
    // The allowance is the scatter of a photo of gray, plus the scatter of the sum of three photos with a third of gray's light each.
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
    let expected = format!("within {:.0} %", 100.0 * bound);
    let largest = off[0].abs().max(off[1].abs());
    let finding = Finding::graded("colours", grade, found, expected, calibrated_or(probe, help));
    finding.measured(largest, 0.5 * probe.scatter, bound)
}

/// The remedy, with another one where the camera's response is not known.
fn calibrated_or(probe: &Probe<'_>, help: &str) -> String {
    let unknown = "; if the camera's counts are not in proportion to light, calibrate first and check again";
    if probe.is_known { help.to_owned() } else { format!("{help}{unknown}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::rig_check::probe::take;
    use crate::bench::rig_check::recorded;
    use crate::image::Resolution;
    use crate::measure::simulated::Simulated;
    use crate::measure::{CaptureRequest, FrameSource};

    #[test]
    fn the_slope_of_a_line_is_found_with_its_error() {
        let off = |at: usize| if at.is_multiple_of(2) { 1e-3 } else { -1e-3 };
        let points: Vec<[f64; 2]> =
            (0..20).map(|at| [0.05 * at as f64, 0.1 + 0.3 * 0.05 * at as f64 + off(at)]).collect();
        let [value, error] = slope(&points).expect("the points are apart");
        assert!((value - 0.3).abs() < 3.0 * error && error < 2e-3, "{value} ± {error}");
        assert_eq!(slope(&[[1.0, 2.0]; 20]), None);
        // The points rise by 2 per step. The first is 3 too high and the last is 3 too low, which lowers the slope by 0.4.
        let mut points: Vec<[f64; 2]> = (0..9).map(|at| [f64::from(at), 2.0 * f64::from(at)]).collect();
        points[0][1] += 3.0;
        points[8][1] -= 3.0;
        let [value, error] = slope(&points).expect("the points are apart");
        // The sum of the squared residuals is 18 − 24²/60, with seven degrees of freedom.
        assert!((value - 1.6).abs() < 1e-12 && (error - (8.4_f64 / 7.0 / 60.0).sqrt()).abs() < 1e-12);
        assert_eq!(slope(&points[1..]), None, "eight are too few");
    }

    /// A probe of an uncalibrated bench whose camera sees each of five by four pixels separately. All photos of white are equal.
    fn with_probe<T>(bits: u32, check: impl FnOnce(&mut Probe<'_>) -> T) -> T {
        let top = f64::from((1_u32 << bits) - 1);
        let photo = move |request: &CaptureRequest, _| {
            request
                .frame
                .levels()
                .iter()
                .map(|&level| (100.0 + 50_000.0 * f64::from(level) / top).round() as u16)
                .collect()
        };
        let size = Resolution::new(5, 4);
        let mut frames = Simulated::new(size, size, 16, photo);
        frames.projector.bits = bits;
        let photos = take(&mut frames, 0.1).expect("it never fails");
        check(&mut Probe::new(&mut frames, None, &photos, 0.1, true))
    }

    /// Photos taken before the check are not counted.
    #[test]
    fn a_check_counts_its_own_photos() {
        let size = Resolution::new(2, 2);
        let mut frames = Simulated::new(size, size, 8, |_: &CaptureRequest, _| vec![9; 4]);
        let black = std::sync::Arc::new(crate::rig::Frame::filled(size, 1, 0));
        for take in 0..7 {
            let request = CaptureRequest { frame: std::sync::Arc::clone(&black), exposure: 0.1, take };
            frames.capture(&request).expect("it never fails");
        }
        let photos = take(&mut frames, 0.1).expect("it never fails");
        // One photo at the shortest exposure, four rounds of one black and two white photos, and two black photos.
        assert_eq!(photos.effort.taken, 1 + 4 * 3 + 2);
    }

    #[test]
    fn the_light_of_a_pixel_is_the_mean_of_its_channels() {
        with_probe(8, |probe| {
            let frame = probe.session.filled(0);
            let gray = probe.session.capture(&frame, 0.1).expect("it never fails");
            let photo = crate::rig::RawFrame { channels: 3, counts: vec![1, 2, 6, 10, 20, 60], ..gray };
            assert_eq!(probe.light(&photo), [3.0, 30.0]);
            assert_eq!(probe.channels(&photo), [5.5, 11.0, 33.0]);
        });
    }

    #[test]
    fn the_quadrants_of_a_frame_have_no_pixel_in_common_and_make_up_all_of_it() {
        with_probe(8, |probe| {
            let (whites, quadrants) = quadrants(probe).expect("it never fails");
            // The third of five columns belongs to the left quadrants, because its left edge lies in them.
            let lit = |light: &[f64]| {
                light.iter().map(|light| (light / 50_000.0).round() as u8).collect::<Vec<u8>>()
            };
            let [left, right] = [[1, 1, 1, 0, 0], [0, 0, 0, 1, 1]].map(|row| [row; 2].concat());
            let dark = vec![0; 10];
            let expected = [[&left, &dark], [&right, &dark], [&dark, &left], [&dark, &right]];
            for (found, [above, below]) in quadrants.iter().zip(expected) {
                assert_eq!(lit(found), [above.as_slice(), below].concat());
            }
            assert!(whites.iter().all(|white| lit(white) == [1; 20]));
        });
    }

    /// Without a calibration, the sum may differ by 5 % plus one and a half times the scatter.
    #[test]
    fn an_iris_is_found_where_the_quadrants_do_not_add_up_to_white() {
        with_probe(8, |probe| {
            for ([before, after], sum, grade, text) in [
                ([2.0, 2.0], 2.09, Grade::Ok, "within 4.50 %"),
                (
                    [2.0, 2.0],
                    2.11,
                    Grade::Warning,
                    "dims bright frames: the quadrants of white together have 5.5 % more",
                ),
                ([2.0, 2.0], 1.91, Grade::Ok, "within 4.50 %"),
                (
                    [2.0, 2.0],
                    1.89,
                    Grade::Warning,
                    "dims dark frames: the quadrants of white together have 5.5 % less",
                ),
                // Two photos of white that differ by 4 % of their mean allow another 6 %.
                ([1.96, 2.04], 2.21, Grade::Ok, "within 10.50 %"),
                ([1.96, 2.04], 2.23, Grade::Warning, "11.5 % more"),
            ] {
                let quadrants: Vec<Vec<f64>> = [0.1, 0.2, 0.3, 0.4].map(|part| vec![part * sum; 20]).to_vec();
                let finding = iris(probe, [before, after], &quadrants);
                assert!(finding.grade == grade && finding.found.contains(text), "{finding}");
            }
            // If photos scatter by 8 %, the sum of the quadrants scatters by 4 %.
            probe.scatter = 0.08;
            for (sum, grade) in [(2.21, Grade::Ok), (2.23, Grade::Warning)] {
                let quadrants = vec![vec![0.25 * sum; 20]; 4];
                assert_eq!(iris(probe, [2.0, 2.0], &quadrants).grade, grade, "{sum}");
            }
        });
    }

    /// Light of 3 % of white's mean reaches all pixels evenly. If the scatter exceeds 1 %, less than the bound of 2 % remains.
    #[test]
    fn stray_light_is_what_exceeds_the_scatter_of_photos() {
        with_probe(8, |probe| {
            probe.white = (0..20).map(|pixel| 10.0 + f64::from(pixel % 3)).collect();
            let mean = probe.white.iter().sum::<f64>() / 20.0;
            let quadrants = vec![vec![0.03 * mean / 4.0; 20]; 4];
            for (scatter, grade, text) in [
                (
                    0.0,
                    Grade::Warning,
                    "3.0 % of white's light reaches all pixels evenly, and follows the pattern",
                ),
                (0.005, Grade::Warning, "3.0 %"),
                (0.028, Grade::Ok, "3.0 % of white's light reaches all pixels by way of the scene"),
            ] {
                probe.scatter = scatter;
                let finding = stray(probe, &quadrants);
                assert!(finding.grade == grade && finding.found.contains(text), "{scatter}: {finding}");
            }
        });
    }

    #[test]
    fn levels_that_are_all_as_bright_as_white_are_those_of_limited_range_video() {
        with_probe(8, |probe| {
            for (scatter, high, grade) in [
                (0.0, 0.991, Grade::Warning),
                (0.0, 1.009, Grade::Warning),
                (0.0, 0.989, Grade::Ok),
                (0.0, 1.011, Grade::Ok),
                (0.004, 0.997, Grade::Warning),
                (0.004, 0.995, Grade::Ok),
            ] {
                probe.scatter = scatter;
                let finding = levels(probe, [0.0123, high]);
                assert_eq!(finding.grade, grade, "{finding}");
                assert!(finding.found.contains("level 16 has 1.23 % of white's light"), "{finding}");
            }
        });
    }

    #[test]
    fn a_projector_of_few_levels_has_none_near_black_and_white() {
        for (bits, names) in [(5, &["iris", "stray light"][..]), (6, &["iris", "stray light", "levels"])] {
            with_probe(bits, |probe| {
                let all = recorded(|recorder| brightness(probe, 0.1, recorder));
                assert_eq!(all.iter().map(|finding| &*finding.name).collect::<Vec<_>>(), names);
                assert!(all.iter().all(|finding| finding.grade == Grade::Ok), "{all:?}");
            });
        }
    }

    /// The findings for a gray camera without a calibration. Above level `above`, the white segment adds the fraction `segment` of gray.
    fn found(segment: f64, above: f64) -> Vec<Finding> {
        let photo = move |request: &CaptureRequest, _| {
            let light = |levels: &[u16]| {
                let colours: Vec<f64> = levels.iter().map(|&level| f64::from(level) / 255.0).collect();
                let gray = colours.iter().copied().fold(1.0, f64::min);
                colours.iter().sum::<f64>() + 3.0 * segment * (gray - above).max(0.0)
            };
            // Forty counts for each level avoid rounding where the segment adds no light.
            let count = |levels: &[u16]| (100.0 + 40.0 * 255.0 * light(levels)).round() as u16;
            request.frame.levels().chunks_exact(request.frame.channels()).map(count).collect()
        };
        let size = Resolution::new(6, 4);
        let mut frames = Simulated::new(size, size, 16, photo);
        frames.projector.channels = 3;
        let photos = take(&mut frames, 0.1).expect("it never fails");
        let mut probe = Probe::new(&mut frames, None, &photos, 0.1, true);
        recorded(|recorder| colours(&mut probe, recorder))
    }

    #[test]
    fn a_white_segment_is_found_at_the_level_where_it_shines() {
        for (segment, above, grade, text) in [
            (0.0, 0.0, Grade::Ok, "add up to gray within 0.00 % at the highest level and at half of it"),
            // The difference is 1/1.06 − 1.
            (0.06, 0.0, Grade::Ok, "within 5.66 %"),
            // The difference is 1/1.1 − 1 at every level.
            (0.1, 0.0, Grade::Warning, "by -9.1 % at the highest level and by -9.1 % at half of it"),
            // At the highest level, four tenths of the segment add light, which gives 1/1.2 − 1. At half of this level, it adds no light.
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
