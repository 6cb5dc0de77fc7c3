//! The choice of exposures, from test photos of white.
//!
//! The shortest exposure brings the brightest pixel near saturation. Longer exposures follow, up to the allowed number, until the darkest
//! pixel is well above its noise.

use std::sync::Arc;

use super::frame_source::FrameSource;
use super::hdr::{AveragedExposure, average};
use super::response::CameraCurve;
use crate::error::{Error, Result};
use crate::rig::Frame;

/// The brightest pixel of the white photo, as a fraction of saturation. No pattern is brighter than white. The remaining range up to
/// saturation is for noise, for a lamp that becomes brighter, and for the light of the black photo.
const TARGET: f64 = 0.8;

/// The factor from the exposure of a saturated test photo to the next exposure.
const DOWN: f64 = 1.0 / 8.0;

/// The largest factor from the exposure of a test photo that is too dark to the next exposure.
const UP: f64 = 64.0;

/// A test photo is too dark to predict the exposure when its brightest pixel is below this fraction of saturation.
const DARK: f64 = 0.05;

/// The factor from one exposure of a bracket to the next. If the best exposure of a pixel lies between two exposures, the pixel gets at
/// most this factor less light.
const BRACKET: f64 = 4.0;

/// The darkest pixel is well exposed when it is this many standard deviations above black.
const WELL: f64 = 20.0;

/// The largest number of test photos. This number suffices to go from the shortest to the longest exposure of any camera.
const TEST_PHOTOS: usize = 24;

/// Chooses up to `brackets` exposures in seconds, the shortest first. Only the camera pixels that are `used` count.
pub(crate) fn choose(
    frames: &mut dyn FrameSource,
    curve: &CameraCurve,
    white: &Arc<Frame>,
    used: &[bool],
    brackets: u32,
) -> Result<Vec<f64>> {
    let [shortest, longest] = frames.camera().exposures;
    let channels = frames.camera().channels;
    let frame_time = frames.projector().frame_time;
    let fit = |seconds: f64| {
        let seconds = seconds.clamp(shortest, longest);
        let whole = (seconds / frame_time).floor() * frame_time;
        if frame_time > 0.0 && whole >= shortest { whole.max(frame_time) } else { seconds }
    };
    let range = curve.brightest() - curve.zero;
    let mut exposure = fit(if frame_time > 0.0 { frame_time } else { (shortest * longest).sqrt() });
    let mut chosen = None;
    for _ in 0..TEST_PHOTOS {
        let photo = average(frames, curve, white, exposure, 0..1)?;
        let peak = brightest(&photo, used, channels).map(|peak| (peak - curve.zero) / range);
        let next = match peak {
            None if exposure <= shortest => return Err(too_bright(shortest)),
            None => exposure * DOWN,
            Some(peak) if peak < DARK && exposure < fit(longest) => {
                exposure * UP.min(TARGET / peak.max(1e-9))
            }
            Some(peak) => {
                chosen = Some(fit(exposure * TARGET / peak.max(1e-9)));
                break;
            }
        };
        // If one whole refresh of the projector is too long, exposures shorter than a refresh follow.
        exposure = if fit(next) == exposure { next.clamp(shortest, longest) } else { fit(next) };
    }
    let mut exposures = vec![chosen.unwrap_or(exposure)];
    while exposures.len() < brackets as usize {
        let last = exposures[exposures.len() - 1];
        let next = fit(last * BRACKET);
        if next <= last || darkest_is_well(&average(frames, curve, white, last, 0..1)?, curve, used, channels)
        {
            break;
        }
        exposures.push(next);
    }
    Ok(exposures)
}

/// The linear DN of the brightest sample. It is `None` when a sample is saturated.
fn brightest(photo: &AveragedExposure, used: &[bool], channels: usize) -> Option<f64> {
    let mut brightest = f64::NEG_INFINITY;
    for (sample, &mean) in photo.mean.iter().enumerate().filter(|(sample, _)| used[sample / channels]) {
        if photo.saturated[sample] {
            return None;
        }
        brightest = brightest.max(mean);
    }
    Some(brightest)
}

/// Whether every used sample is either saturated or well above its noise.
fn darkest_is_well(photo: &AveragedExposure, curve: &CameraCurve, used: &[bool], channels: usize) -> bool {
    photo.mean.iter().enumerate().filter(|(sample, _)| used[sample / channels]).all(|(sample, &mean)| {
        photo.saturated[sample] || mean - curve.zero >= WELL * photo.variance(curve, sample, mean).sqrt()
    })
}

fn too_bright(shortest: f64) -> Error {
    Error::saturated(
        "camera",
        format!("a white frame saturates it even at its shortest exposure, {shortest} s"),
    )
    .help("close the lens, or darken the projector or the room")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use crate::measure::CaptureRequest;
    use crate::measure::calibration::CameraResponse;
    use crate::measure::simulated::Simulated;

    /// A scene whose samples have this light, in counts per second. The camera's counts go from 10 in the dark to 1000 at saturation. The
    /// exposure that brings light `L` to 0.8 of the range is 0.8 · 990 / L seconds.
    struct Scene {
        light: Vec<f64>,
        channels: usize,
        used: Vec<bool>,
        exposures: [f64; 2],
        frame_time: f64,
    }

    impl Scene {
        fn of(light: &[f64]) -> Self {
            let used = vec![true; light.len()];
            Self { light: light.to_vec(), channels: 1, used, exposures: [1e-3, 100.0], frame_time: 0.0 }
        }

        /// The chosen exposures and the exposures of all test photos. They do not depend on whether the black level is corrected.
        fn choose(&self, brackets: u32) -> (Result<Vec<f64>>, Vec<f64>) {
            let chosen = [true, false].map(|undo| {
                let light = self.light.clone();
                let photo = move |request: &CaptureRequest, _| {
                    light.iter().map(|l| (10.0 + l * request.exposure).round().min(1023.0) as u16).collect()
                };
                let pixels = Resolution::new(self.light.len() / self.channels, 1);
                let mut frames = Simulated::new(pixels, pixels, 10, photo);
                frames.camera.channels = self.channels;
                frames.camera.exposures = self.exposures;
                frames.projector.frame_time = self.frame_time;
                let response = CameraResponse {
                    black: 10.0,
                    saturation: 1000.0,
                    gain: 1.0,
                    read_noise: 1.0,
                    curve: None,
                };
                let curve = CameraCurve::new(&response, 10, undo).expect("a linear camera");
                let white = Arc::new(Frame::filled(pixels, 1, 255));
                let exposures = choose(&mut frames, &curve, &white, &self.used, brackets);
                (exposures, frames.asked.iter().map(|asked| asked.exposure).collect::<Vec<f64>>())
            });
            let [corrected, raw] = chosen;
            assert_eq!(corrected.1, raw.1);
            assert_eq!(corrected.0.as_ref().ok(), raw.0.as_ref().ok());
            corrected
        }
    }

    /// Whether values are equal up to the rounding of a test photo's brightest count. That count is at least 32 above black.
    fn near(found: &[f64], expected: &[f64]) -> bool {
        found.len() == expected.len() && found.iter().zip(expected).all(|(f, e)| (f / e - 1.0).abs() < 0.02)
    }

    #[test]
    fn the_brightest_pixel_comes_to_four_fifths_of_saturation() {
        // The search begins at the geometric mean of the range. This photo has 3 % of the range, which is too dark. The next photo has 80
        // %.
        let (chosen, asked) = Scene::of(&[100.0, 25.0]).choose(1);
        assert!(
            near(&chosen.expect("there is light"), &[7.92]) && near(&asked, &[0.1_f64.sqrt(), 7.92]),
            "{asked:?}"
        );
        // A photo with 6 % of the range suffices.
        let (chosen, asked) = Scene::of(&[190.0]).choose(1);
        assert!(
            near(&chosen.expect("there is light"), &[4.17]) && near(&asked, &[0.1_f64.sqrt()]),
            "{asked:?}"
        );
        let scene = Scene { used: vec![false, true], ..Scene::of(&[1e6, 190.0]) };
        assert!(near(&scene.choose(1).0.expect("there is light"), &[4.17]));
        // There are two pixels of three channels. The second pixel is not used.
        let colored = Scene::of(&[10.0, 190.0, 20.0, 1e6, 0.0, 1e6]);
        let colored = Scene { channels: 3, used: vec![true, false], ..colored };
        assert!(near(&colored.choose(1).0.expect("there is light"), &[4.17]));
    }

    #[test]
    fn too_much_light_shortens_the_exposure_by_eighths_and_too_little_lengthens_it_to_the_longest() {
        let start = 0.1_f64.sqrt();
        // At a 64th of the first exposure, 1581 counts are too many. The shortest exposure gives 320 counts, a third of the range.
        let (chosen, asked) = Scene::of(&[320e3]).choose(1);
        assert!(near(&chosen.expect("it is not too bright"), &[792.0 / 320e3]), "{asked:?}");
        assert!(near(&asked, &[start, start / 8.0, start / 64.0, 1e-3]), "{asked:?}");
        let (chosen, asked) = Scene::of(&[0.0]).choose(1);
        assert!(
            near(&chosen.expect("dark is no error"), &[100.0]) && near(&asked, &[start, 64.0 * start, 100.0])
        );
        let (chosen, asked) = Scene::of(&[1e9]).choose(1);
        assert!(matches!(chosen, Err(Error::Saturated { .. })), "{chosen:?}");
        assert_eq!(asked.last(), Some(&1e-3));
    }

    #[test]
    fn exposures_are_whole_refreshes_of_the_projector_or_else_parts_of_one() {
        let refresh = 1.0 / 60.0;
        let flickering = |light: f64| Scene { frame_time: refresh, ..Scene::of(&[light]) };
        // 0.264 s would be 15.8 refreshes, so 15 refreshes are chosen. The first test photo takes one refresh.
        let (chosen, asked) = flickering(3000.0).choose(1);
        assert!((chosen.expect("there is light")[0] - 15.0 * refresh).abs() < 1e-12);
        assert_eq!(asked, [refresh]);
        // One refresh is too long. An eighth of a refresh follows, then the exposure for 0.8 of the range.
        let (chosen, asked) = flickering(3e5).choose(1);
        assert!(near(&chosen.expect("it is not too bright"), &[792.0 / 3e5]));
        assert!(near(&asked, &[refresh, refresh / 8.0]), "{asked:?}");
    }

    #[test]
    fn a_camera_that_states_no_shortest_exposure_exposes_for_some_time() {
        let scene = Scene { frame_time: 1.0 / 60.0, exposures: [0.0, 100.0], ..Scene::of(&[3e5]) };
        let (chosen, asked) = scene.choose(1);
        assert!(
            chosen.expect("it is not too bright")[0] > 0.0 && asked.iter().all(|&asked| asked > 0.0),
            "{asked:?}"
        );
    }

    #[test]
    fn longer_exposures_follow_by_factors_of_four_until_the_darkest_pixel_is_well_exposed() {
        let brackets = |light: &[f64], most: u32| Scene::of(light).choose(most).0.expect("there is light");
        // The darkest pixel never reaches 20 standard deviations above black. Exposures grow up to the longest exposure that is allowed.
        assert!(near(&brackets(&[100.0, 0.01], 5), &[7.92, 31.68, 100.0]));
        assert!(near(&brackets(&[100.0, 0.01], 2), &[7.92, 31.68]));
        assert!(near(&brackets(&[100.0, 0.01], 1), &[7.92]));
        // x counts above black have the variance x + 1 + 1/12, so 20 standard deviations are reached at x = 401.1.
        assert!(near(&brackets(&[100.0, 406.0 / 7.92], 5), &[7.92]));
        assert!(near(&brackets(&[100.0, 395.0 / 7.92], 5), &[7.92, 31.68]));
        // In the second exposure, the pixel of 25 counts per second has 792 counts, and the other pixel is saturated.
        assert!(near(&brackets(&[100.0, 25.0], 5), &[7.92, 31.68]));
        let scene = Scene { used: vec![true, true, false], ..Scene::of(&[100.0, 60.0, 0.01]) };
        assert!(near(&scene.choose(5).0.expect("there is light"), &[7.92]));
    }
}
