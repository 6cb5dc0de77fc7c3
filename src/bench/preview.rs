//! The live preview of a rig: one pattern is photographed repeatedly while a person sets up projector and camera. All figures are computed
//! from the camera's counts, which are not converted to light.

use std::sync::Arc;

use serde::Serialize;

use crate::calibrate::{StructuredLight, WhiteExposure};
use crate::error::Result;
use crate::finding::decimal;
use crate::image::Image;
use crate::io::raster::{Raster, encode_srgb};
use crate::measure::{CameraResponse, CaptureRequest, FrameSource};
use crate::rig::{Frame, ProjectorInfo, RawFrame};

/// Colour of pixels with a saturated sample.
pub const SATURATED: [u8; 3] = [0xff, 0x20, 0x10];

/// Colour of pixels whose samples are all 0.
pub const CRUSHED: [u8; 3] = [0x20, 0x50, 0xff];

/// The meaning of a camera's counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CountRange {
    /// The count without light.
    pub black: f64,
    /// Counts of at least this value are saturated.
    pub limit: f64,
    /// The largest count.
    pub full: f64,
}

impl CountRange {
    /// Takes the range from a calibration. Without a calibration, a frame of the black projector is taken at the shortest exposure. Its
    /// median is then the count without light, and only the largest count is regarded as saturated.
    pub fn measure(known: Option<&CameraResponse>, frames: &mut dyn FrameSource) -> Result<Self> {
        let camera = frames.camera();
        let full = f64::from((1_u32 << camera.bits) - 1);
        if let Some(known) = known {
            return Ok(Self { black: known.black, limit: known.saturation, full });
        }
        let (shortest, projector) = (camera.exposures[0], frames.projector());
        let dark = Frame::filled(projector.resolution, projector.channels, 0);
        let raw = frames.capture(&CaptureRequest { frame: Arc::new(dark), exposure: shortest, take: 0 })?;
        Ok(Self { black: raw.percentile(0.5), limit: full, full })
    }

    /// Paints a frame in sRGB. The count without light is black, and the largest count is white. A pixel with a saturated sample is
    /// [`SATURATED`]. A pixel whose samples are all 0 is [`CRUSHED`].
    pub fn paint(&self, frame: &RawFrame) -> Raster {
        let range = (self.full - self.black).max(1.0);
        let pixels = frame.counts.chunks_exact(frame.channels).map(|pixel| {
            if pixel.iter().any(|&count| f64::from(count) >= self.limit) {
                return SATURATED;
            }
            if pixel.iter().all(|&count| count == 0) {
                return CRUSHED;
            }
            let level = |channel: usize| {
                let count = pixel[channel.min(pixel.len() - 1)];
                encode_srgb(((f64::from(count) - self.black) / range).clamp(0.0, 1.0) as f32)
            };
            [level(0), level(1), level(2)]
        });
        Raster::from_pixels(frame.resolution, pixels)
    }
}

/// Converts an image to the frame that shows its values as levels. The value 0 becomes level 0, and 1 becomes the highest level. Values
/// outside this range are clamped, and the projector's response is not corrected. Fails with [`Error::Dimension`](crate::Error::Dimension)
/// when the image has another resolution than the projector.
pub fn level_frame(image: &Image, projector: &ProjectorInfo) -> Result<Frame> {
    let (size, channels, top) = (projector.resolution, projector.channels, f32::from(projector.highest()));
    if image.resolution() != size {
        return Err(crate::Error::dimension("pixels of the pattern", size, image.resolution()));
    }
    let level = |sample: usize| {
        let channel = (sample % channels).min(image.channels() - 1);
        let value = image.samples()[sample / channels * image.channels() + channel];
        (value.clamp(0.0, 1.0) * top).round() as u16
    };
    Frame::new(size, channels, (0..size.pixels() * channels).map(level).collect())
}

/// A running preview.
pub struct LivePreview {
    frames: Box<dyn FrameSource>,
    frame: Arc<Frame>,
    exposure: f64,
    range: CountRange,
    /// The time on the rig's clock when the preview began, in seconds.
    began: f64,
    taken: u64,
    last: Option<RawFrame>,
    figures: Option<FrameFigures>,
}

impl LivePreview {
    /// Starts a preview of a pattern, which is shown as levels, with this exposure in seconds. If no exposure is given, it is chosen so
    /// that white fills the camera's range, and the returned [`WhiteExposure`] says whether there is such an exposure. If the camera's
    /// response is `known`, it determines the meaning of the counts. Fails as [`level_frame`] does, and when the rig fails.
    pub fn new(
        mut frames: Box<dyn FrameSource>,
        known: Option<&CameraResponse>,
        pattern: &Image,
        exposure: Option<f64>,
    ) -> Result<(Self, WhiteExposure)> {
        let frame = Arc::new(level_frame(pattern, frames.projector())?);
        let (exposure, outcome) = StructuredLight::white_exposure(exposure, frames.as_mut())?;
        let range = CountRange::measure(known, frames.as_mut())?;
        let began = frames.effort().seconds;
        let preview = Self { frames, frame, exposure, range, began, taken: 0, last: None, figures: None };
        Ok((preview, outcome))
    }

    /// Takes the next frame.
    pub fn capture(&mut self) -> Result<FrameFigures> {
        let request = CaptureRequest {
            frame: Arc::clone(&self.frame),
            exposure: self.exposure,
            take: self.taken as u32,
        };
        let raw = self.frames.capture(&request)?;
        self.taken += 1;
        let last = self.last.as_ref();
        let score = last.and_then(|last| focus(last, &raw, self.range.black, self.range.limit));
        let best = self.figures.as_ref().and_then(|figures| figures.best_focus);
        let best = best.into_iter().chain(score).reduce(f64::max);
        let seconds = self.frames.effort().seconds - self.began;
        let per_second = self.taken as f64 / seconds.max(f64::MIN_POSITIVE);
        let figures = FrameFigures::of(&raw, &self.range, (self.taken, per_second), [score, best]);
        self.last = Some(raw);
        self.figures = Some(figures.clone());
        Ok(figures)
    }

    /// The exposure of the frames, in seconds.
    pub fn exposure(&self) -> f64 {
        self.exposure
    }

    /// The number of frames taken.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// The figures of the frame that was taken last.
    pub fn figures(&self) -> Option<&FrameFigures> {
        self.figures.as_ref()
    }

    /// The frame that was taken last.
    pub fn last(&self) -> Option<&RawFrame> {
        self.last.as_ref()
    }

    /// The meaning of the counts.
    pub fn range(&self) -> &CountRange {
        &self.range
    }
}

/// The figures of one frame. All fractions are relative to the number of samples.
#[derive(Clone, Debug, Serialize)]
pub struct FrameFigures {
    /// The number of the frame, from 1.
    pub frame: u64,
    /// The largest count.
    pub brightest: u16,
    /// The mean count above black, as a fraction of the range above black.
    pub mean: f64,
    /// The fraction of saturated samples.
    pub saturated: f64,
    /// The fraction of samples whose count is 0.
    pub black: f64,
    /// The [focus score](focus()) of this frame and the previous one. The first frame has no score.
    pub focus: Option<f64>,
    /// The best focus score so far.
    pub best_focus: Option<f64>,
    /// Frames per second.
    pub per_second: f64,
    /// The exposure of the frame, in seconds.
    pub exposure: f64,
}

impl FrameFigures {
    /// Computes the figures of frame number `frame`. `per_second` is the rate of frames, and `best_focus` the best focus score so far.
    pub(crate) fn of(
        raw: &RawFrame,
        range: &CountRange,
        (frame, per_second): (u64, f64),
        [focus, best_focus]: [Option<f64>; 2],
    ) -> Self {
        let samples = raw.counts.len() as f64;
        let share =
            |of: &dyn Fn(u16) -> bool| raw.counts.iter().filter(|&&count| of(count)).count() as f64 / samples;
        Self {
            frame,
            brightest: raw.counts.iter().copied().max().unwrap_or(0),
            mean: (raw.mean() - range.black) / (range.full - range.black),
            saturated: share(&|count| f64::from(count) >= range.limit),
            black: share(&|count| count == 0),
            focus,
            best_focus,
            per_second,
            exposure: raw.exposure,
        }
    }

    /// One line with all figures: `frame     12: focus 5.951e-2, best 6.012e-2; saturated 0.0 %, black 0.0 %, brightest 2900 of 4095, mean
    /// 34.0 %; 20.1 a second of 0.0333 s`.
    pub fn line(&self, range: &CountRange) -> String {
        format!(
            "frame     {}: focus {}, best {}; saturated {}, black {}, brightest {} of {}, mean {}; {:.1} a second of {} s",
            self.frame,
            score(self.focus),
            score(self.best_focus),
            percent(self.saturated),
            percent(self.black),
            self.brightest,
            range.full,
            percent(self.mean),
            self.per_second,
            decimal(self.exposure, 4),
        )
    }

    /// One line with the figures that fit into a terminal of 80 columns.
    pub fn short_line(&self, range: &CountRange) -> String {
        format!(
            "focus {}, best {}, saturated {}, black {}, peak {:.0} %, {:.1}/s",
            score(self.focus),
            score(self.best_focus),
            percent(self.saturated),
            percent(self.black),
            100.0 * f64::from(self.brightest) / range.full,
            self.per_second,
        )
    }
}

fn score(score: Option<f64>) -> String {
    score.map_or("–".into(), |score| format!("{score:.2e}"))
}

fn percent(share: f64) -> String {
    match 100.0 * share {
        some if some > 0.0 && some < 0.1 => "<0.1 %".to_owned(),
        some => format!("{some:.1} %"),
    }
}

// The focus score is the Tenengrad, the mean square of the Sobel gradient (Tenenbaum, *Accommodation in computer vision*, 1970; Krotkov,
// *Focusing*, IJCV 1, 1988). It is divided by the squared mean, so that it does not depend on exposure and brightness. Noise would raise
// the square of a gradient as edges do. The score therefore uses the *product* of the gradients of two frames of the same scene. The noise
// of the two frames is independent and averages out in the product.

/// The focus score of two frames of the same scene under the same pattern. A larger score means a sharper image, and a uniform surface has
/// the score 0 up to noise. `black` is the count without light. Pixels with a count of `limit` or more are left out together with their
/// neighbours. The score is `None` when the frames differ in size, when no pixel remains, or when there is no light.
pub fn focus(first: &RawFrame, second: &RawFrame, black: f64, limit: f64) -> Option<f64> {
    let (width, height, channels) = (first.resolution.width, first.resolution.height, first.channels);
    if (second.resolution, second.channels) != (first.resolution, channels) {
        return None;
    }
    let gray = |frame: &RawFrame| -> Vec<f64> {
        let pixels = frame.counts.chunks_exact(channels);
        pixels
            .map(|pixel| {
                let is_over = pixel.iter().any(|&count| f64::from(count) >= limit);
                let light = pixel.iter().map(|&count| f64::from(count) - black).sum::<f64>();
                if is_over { f64::NAN } else { light }
            })
            .collect()
    };
    let [a, b] = [gray(first), gray(second)];
    let (mut products, mut lights, mut count) = (0.0, [0.0; 2], 0.0);
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let ([ax, ay], [bx, by]) = (sobel(&a, width, x, y), sobel(&b, width, x, y));
            let product = ax * bx + ay * by;
            // A saturated pixel in the neighbourhood makes the product NaN.
            if product.is_finite() {
                products += product;
                lights[0] += a[y * width + x];
                lights[1] += b[y * width + x];
                count += 1.0;
            }
        }
    }
    let light = lights[0] * lights[1] / count;
    (lights[0] > 0.0 && lights[1] > 0.0).then(|| products / light)
}

/// The Sobel gradient to the right and down, in counts per pixel.
fn sobel(picture: &[f64], width: usize, x: usize, y: usize) -> [f64; 2] {
    let at = |dx: usize, dy: usize| picture[(y + dy - 1) * width + x + dx - 1];
    let right = at(2, 0) + 2.0 * at(2, 1) + at(2, 2) - at(0, 0) - 2.0 * at(0, 1) - at(0, 2);
    let down = at(0, 2) + 2.0 * at(1, 2) + at(2, 2) - at(0, 0) - 2.0 * at(1, 0) - at(2, 0);
    [right / 8.0, down / 8.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Blur, Resolution};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    #[test]
    fn the_short_line_fits_into_80_columns() {
        let figures = FrameFigures {
            frame: 123_456,
            brightest: 65535,
            mean: 0.999,
            saturated: 0.999,
            black: 0.999,
            focus: Some(1.234e-5),
            best_focus: Some(1.234e-5),
            per_second: 123.4,
            exposure: 0.0333,
        };
        let range = CountRange { black: 0.0, limit: 65535.0, full: 65535.0 };
        let short = figures.short_line(&range);
        assert!(short.chars().count() <= 80, "{short}");
        assert!(figures.line(&range).contains("123.4 a second of 0.0333 s"));
    }

    /// Ten counts of two pixels with five channels. One count is 0, and three counts are at or above the limit of 200.
    #[test]
    fn figures_are_those_of_the_counts_and_lines_say_them() {
        let counts = vec![0, 10, 200, 255, 199, 201, 20, 30, 40, 45];
        let resolution = Resolution::new(2, 1);
        let raw = RawFrame { resolution, channels: 5, counts, exposure: 0.02, id: 7, started: 0.0 };
        let range = CountRange { black: 50.0, limit: 200.0, full: 250.0 };
        let figures = FrameFigures::of(&raw, &range, (12, 20.0), [None, Some(0.5)]);
        let (shares, mean) = ((figures.saturated, figures.black), figures.mean);
        assert_eq!((figures.frame, figures.brightest, shares, mean), (12, 255, (0.3, 0.1), 0.25));
        assert_eq!(
            figures.line(&range),
            "frame     12: focus –, best 5.00e-1; saturated 30.0 %, black 10.0 %, brightest 255 of 250, mean 25.0 %; 20.0 a second of 0.0200 s"
        );
        assert_eq!(
            figures.short_line(&range),
            "focus –, best 5.00e-1, saturated 30.0 %, black 10.0 %, peak 102 %, 20.0/s"
        );
        assert_eq!([0.0, 5e-4, 1e-3, 1.0].map(percent), ["0.0 %", "<0.1 %", "0.1 %", "100.0 %"]);
    }

    const SIZE: Resolution = Resolution { width: 64, height: 48 };

    fn frame(light: impl Fn(usize) -> f64) -> RawFrame {
        let counts = (0..SIZE.pixels()).map(|pixel| light(pixel).round() as u16).collect();
        RawFrame { resolution: SIZE, channels: 1, counts, exposure: 0.1, id: 0, started: 0.0 }
    }

    /// A blurred checkerboard with squares of eight pixels and with the mean `light`.
    fn squares(blur: f64, light: f64) -> Vec<f64> {
        let sharp: Vec<f64> = (0..SIZE.pixels())
            .map(|pixel| (pixel % SIZE.width / 8 + pixel / SIZE.width / 8) % 2)
            .map(|square| light * (0.5 + square as f64))
            .collect();
        Blur::new(SIZE, blur).map_or(sharp.clone(), |blur| blur.apply(&sharp))
    }

    fn score(of: &[f64], noise: f64, seed: u64) -> f64 {
        let mut random = Pcg64::seed_from_u64(seed);
        // Uniform noise with a standard deviation of `noise`.
        let mut noisy = || -> Vec<f64> {
            of.iter().map(|v| v + 12.0_f64.sqrt() * noise * (random.random::<f64>() - 0.5)).collect()
        };
        let [a, b] = [noisy(), noisy()];
        focus(&frame(|i| 100.0 + a[i]), &frame(|i| 100.0 + b[i]), 100.0, 65535.0).expect("there is light")
    }

    #[test]
    fn the_score_grows_with_sharpness_and_not_with_brightness() {
        let scores = [0.0, 0.7, 1.5, 3.0].map(|blur| score(&squares(blur, 10_000.0), 0.0, 0));
        assert!(scores.is_sorted_by(|a, b| a > b), "{scores:?}");
        let dim = score(&squares(1.5, 2_500.0), 0.0, 0);
        // Rounding to counts changes the light by 1e-4.
        assert!((dim / scores[2] - 1.0).abs() < 1e-2, "{dim} {}", scores[2]);
    }

    /// Two linear ramps. Their gradients, summed over three channels, are (20, 6) and (40, −10), and have the product 740 everywhere.
    #[test]
    fn the_score_of_slopes_is_the_product_of_their_gradients_over_that_of_their_light() {
        let slope = |right: i32, down: i32, channels: usize| {
            let value = |sample: usize| {
                let (pixel, channel) = (sample / channels, sample % channels);
                let (x, y) = ((pixel % SIZE.width) as i32, (pixel / SIZE.width) as i32);
                // Two channels have the ramp, and the third is constant.
                let share = if channel < 2 { 1 } else { 0 };
                (5000 + share * (right * x + down * y)) as u16
            };
            let counts = (0..SIZE.pixels() * channels).map(value).collect();
            RawFrame { resolution: SIZE, channels, counts, exposure: 0.1, id: 0, started: 0.0 }
        };
        let (first, second) = (slope(10, 3, 3), slope(20, -5, 3));
        let found = focus(&first, &second, 1000.0, 65_535.0).expect("there is light");
        // The mean light over all pixels inside the border equals the light in the middle. Black is subtracted from each channel.
        let light = |right: f64, down: f64| 3.0 * 4000.0 + 2.0 * (31.5 * right + 23.5 * down);
        let expected = (20.0 * 40.0 - 6.0 * 10.0) / (light(10.0, 3.0) * light(20.0, -5.0));
        // All numbers are integers until the last division, so the result is exact up to rounding.
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
        assert_eq!(focus(&first, &slope(20, -5, 1), 1000.0, 65_535.0), None, "frames of different cameras");
    }

    #[test]
    fn noise_does_not_raise_the_score() {
        let even = vec![10_000.0; SIZE.pixels()];
        let by_one_frame = {
            let mut random = Pcg64::seed_from_u64(1);
            let noisy: Vec<f64> =
                (0..SIZE.pixels()).map(|_| 9_000.0 + 2_000.0 * random.random::<f64>()).collect();
            let frame = frame(|pixel| noisy[pixel]);
            focus(&frame, &frame, 0.0, 65535.0).expect("there is light")
        };
        // The noise is 6 %. The square of a noisy gradient has a large mean, but the product of two independent gradients has the mean 0.
        let by_two = (0..8).map(|seed| score(&even, 577.0, seed).abs()).fold(0.0, f64::max);
        assert!(by_two < 0.1 * by_one_frame, "{by_two} {by_one_frame}");
        let (noisy, clean) =
            (score(&squares(1.5, 10_000.0), 577.0, 3), score(&squares(1.5, 10_000.0), 0.0, 0));
        assert!((noisy / clean - 1.0).abs() < 0.1, "{noisy} {clean}");
    }

    #[test]
    fn saturated_pixels_are_left_out_and_a_dark_frame_has_no_score() {
        let mut bright = squares(0.0, 10_000.0);
        bright.iter_mut().take(10 * SIZE.width).for_each(|value| *value = 65_535.0);
        let frame = frame(|pixel| bright[pixel]);
        let found = focus(&frame, &frame, 0.0, 65_000.0).expect("the rest is not saturated");
        let whole = score(&squares(0.0, 10_000.0), 0.0, 0);
        assert!((found / whole - 1.0).abs() < 0.1, "{found} {whole}");
        assert_eq!(focus(&frame, &frame, 65_535.0, 70_000.0), None);
    }

    #[test]
    fn both_ends_of_the_range_are_coloured_and_what_is_between_is_gray() {
        let counts = vec![0, 100, 2000, 4095];
        let resolution = Resolution::new(4, 1);
        let frame = RawFrame { resolution, channels: 1, counts, exposure: 0.1, id: 1, started: 0.0 };
        let picture = CountRange { black: 100.0, limit: 4090.0, full: 4095.0 }.paint(&frame);
        assert_eq!((picture.pixel(0, 0), picture.pixel(3, 0)), (CRUSHED, SATURATED));
        assert_eq!(picture.pixel(1, 0), [0; 3]);
        let [red, green, blue] = picture.pixel(2, 0);
        // The sRGB code of the linear value 0.4756 is expected.
        assert!(red == green && green == blue && (180..185).contains(&red), "{red}");
    }
}
