//! A calibration session takes frames and computes their means. This file also holds the model of the camera, and measures the projector's
//! latency.

use std::collections::HashMap;
use std::sync::Arc;

use super::report::MeasuredValue;
use crate::error::Result;
use crate::measure::{CameraResponse, CaptureRequest, Effort, FrameSource};
use crate::rig::{CameraInfo, Frame, ProjectorInfo, RawFrame};

/// Takes frames. Repeated frames of the same pattern and exposure have successive take numbers, so that no take number is used twice. The
/// order of the frames depends only on earlier measurements, so that a journal can replay a calibration.
pub(crate) struct CalibrationSession<'a> {
    frames: &'a mut dyn FrameSource,
    takes: HashMap<(Arc<Frame>, u64), u32>,
    first: u32,
}

/// The mean of several frames of the same pattern and exposure.
#[derive(Clone, Debug)]
pub(crate) struct Mean {
    /// The mean count of each sample (interleaved channels).
    pub(crate) counts: Vec<f64>,
    /// The largest count of each sample.
    pub(crate) peaks: Vec<u16>,
    /// The exposure in seconds, as the camera reports it.
    pub(crate) exposure: f64,
    /// The middle of the exposures, in seconds on the rig's clock.
    pub(crate) time: f64,
    pub(crate) takes: u32,
}

impl<'a> CalibrationSession<'a> {
    pub(crate) fn new(frames: &'a mut dyn FrameSource) -> Self {
        Self::starting_at(frames, 0)
    }

    /// A session whose take numbers begin at `first`, so that they differ from those of an earlier session with the same frames.
    pub(crate) fn starting_at(frames: &'a mut dyn FrameSource, first: u32) -> Self {
        Self { frames, takes: HashMap::new(), first }
    }

    pub(crate) fn projector(&self) -> &ProjectorInfo {
        self.frames.projector()
    }

    pub(crate) fn camera(&self) -> &CameraInfo {
        self.frames.camera()
    }

    pub(crate) fn effort(&self) -> Effort {
        self.frames.effort()
    }

    pub(crate) fn set_settle(&mut self, seconds: f64) {
        self.frames.set_settle(seconds);
    }

    pub(crate) fn top(&self) -> u16 {
        self.projector().highest()
    }

    pub(crate) fn full(&self) -> f64 {
        ((1_u32 << self.camera().bits) - 1).into()
    }

    /// A frame with this level in all channels.
    pub(crate) fn filled(&self, level: u16) -> Arc<Frame> {
        let ProjectorInfo { resolution, channels, .. } = *self.projector();
        Arc::new(Frame::filled(resolution, channels, level))
    }

    /// A frame with this level in one channel, and level 0 in the others.
    pub(crate) fn filled_channel(&self, channel: usize, level: u16) -> Result<Arc<Frame>> {
        self.frame(|_, of| if of == channel { level } else { 0 })
    }

    /// A frame with the brightest level at the pixels (column, row) that are `lit`, and level 0 elsewhere.
    pub(crate) fn drawn(&self, lit: impl Fn(usize, usize) -> bool) -> Result<Arc<Frame>> {
        let (top, width) = (self.top(), self.projector().resolution.width);
        self.frame(|pixel, _| if lit(pixel % width, pixel / width) { top } else { 0 })
    }

    /// A frame with the level that `level` gives for the pixel and the channel.
    fn frame(&self, level: impl Fn(usize, usize) -> u16) -> Result<Arc<Frame>> {
        let ProjectorInfo { resolution, channels, .. } = *self.projector();
        let samples = 0..resolution.pixels() * channels;
        let levels = samples.map(|sample| level(sample / channels, sample % channels)).collect();
        Ok(Arc::new(Frame::new(resolution, channels, levels)?))
    }

    /// Captures this frame at this exposure with the next take number.
    pub(crate) fn capture(&mut self, frame: &Arc<Frame>, exposure: f64) -> Result<RawFrame> {
        let take = self.takes.entry((Arc::clone(frame), exposure.to_bits())).or_insert(self.first);
        let request = CaptureRequest { frame: Arc::clone(frame), exposure, take: *take };
        *take += 1;
        let raw = self.frames.capture(&request)?;
        raw.check()?;
        Ok(raw)
    }

    /// Averages `takes` new frames. At least one frame is captured.
    pub(crate) fn mean(&mut self, frame: &Arc<Frame>, exposure: f64, takes: u32) -> Result<Mean> {
        let mut mean: Option<Mean> = None;
        for _ in 0..takes.max(1) {
            let raw = self.capture(frame, exposure)?;
            let middle = raw.started + 0.5 * raw.exposure;
            match &mut mean {
                None => {
                    mean = Some(Mean {
                        counts: raw.counts.iter().map(|&count| count.into()).collect(),
                        peaks: raw.counts,
                        exposure: raw.exposure,
                        time: middle,
                        takes: 1,
                    });
                }
                Some(mean) => {
                    let share = 1.0 / f64::from(mean.takes + 1);
                    for ((value, peak), &count) in
                        mean.counts.iter_mut().zip(&mut mean.peaks).zip(&raw.counts)
                    {
                        *value += (f64::from(count) - *value) * share;
                        *peak = count.max(*peak);
                    }
                    mean.time += (middle - mean.time) * share;
                    mean.takes += 1;
                }
            }
        }
        mean.ok_or_else(|| crate::Error::Numerical("a mean of no frames".into()))
    }

    /// The nearest exposure that the camera can set. An exposure longer than the projector's refresh is a whole multiple of the refresh.
    pub(crate) fn allowed(&self, exposure: f64) -> f64 {
        let [shortest, longest] = self.camera().exposures;
        let frame_time = self.projector().frame_time;
        let wanted = if frame_time > 0.0 && exposure > frame_time {
            (exposure / frame_time).round() * frame_time
        } else {
            exposure
        };
        wanted.clamp(shortest, longest)
    }
}

/// The response: `linear DN = curve(count)`, or `count − black` without a curve.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Linear {
    pub(crate) black: f64,
    pub(crate) curve: Option<Vec<f64>>,
}

impl Linear {
    /// The light in DN above black, from a count or a mean of counts.
    pub(crate) fn of(&self, count: f64) -> f64 {
        let Some(curve) = &self.curve else { return count - self.black };
        let at = (count.max(0.0) as usize).min(curve.len() - 2);
        curve[at] + (count - at as f64) * (curve[at + 1] - curve[at])
    }

    /// The linear DN per count near `count`.
    pub(crate) fn slope(&self, count: f64) -> f64 {
        let Some(curve) = &self.curve else { return 1.0 };
        let reach = (curve.len() / 256).max(1);
        let at = (count.max(0.0) as usize).min(curve.len() - 1);
        let (low, high) = (at.saturating_sub(reach), (at + reach).min(curve.len() - 1));
        (curve[high] - curve[low]) / (high - low) as f64
    }
}

/// The model that describes how photos are taken and converted to light: exposure, number of frames, response and noise.
#[derive(Clone, Debug)]
pub(crate) struct CameraModel {
    pub(crate) linear: Linear,
    /// Electrons per linear DN.
    pub(crate) gain: f64,
    /// The read noise, in DN.
    pub(crate) read_noise: f64,
    /// Counts of at least this value may be saturated.
    pub(crate) limit: f64,
    /// The exposure at which white fills the range, in seconds.
    pub(crate) exposure: f64,
    pub(crate) takes: u32,
}

impl CameraModel {
    /// The model of a camera with a known response.
    pub(crate) fn of(camera: &CameraResponse, exposure: f64, takes: u32) -> Self {
        let CameraResponse { black, saturation: limit, gain, read_noise, ref curve } = *camera;
        Self { linear: Linear { black, curve: curve.clone() }, gain, read_noise, limit, exposure, takes }
    }

    /// The variance of the mean of `takes` samples with this light. The light is in linear DN above black.
    pub(crate) fn variance(&self, light: f64, takes: u32) -> f64 {
        (light.max(0.0) / self.gain + self.read_noise.powi(2)) / f64::from(takes)
    }
}

// The latency of the projector is the time from the confirmation of a frame until the projector emits all of this frame's light and no
// light of the previous frame. White is shown after black and photographed after different waits. While the exposure still includes black,
// the photo has less light.

/// The shortest wait above zero that is tried, in seconds.
const SHORTEST: f64 = 1e-3;

/// The longest wait that is tried, in seconds. The session also waits this long while the latency is unknown.
pub(crate) const CAREFUL: f64 = 1.0;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Latency {
    /// The time until all light is there, in seconds. The error is half of the last interval of the search.
    pub(crate) settle: MeasuredValue,
    /// Pairs of the wait in seconds and the light after this wait, relative to white's light.
    pub(crate) sweep: Vec<(f64, f64)>,
}

/// Measures the latency by a search over waits. `exposure` is in seconds. It should be short and must not saturate.
pub(crate) fn latency(session: &mut CalibrationSession<'_>, exposure: f64) -> Result<Latency> {
    let (black, white) = (session.filled(0), session.filled(session.top()));
    let step = |session: &mut CalibrationSession<'_>, wait: f64| -> Result<f64> {
        session.set_settle(CAREFUL);
        session.capture(&black, exposure)?;
        session.set_settle(wait);
        session.capture(&white, exposure).map(|raw| raw.mean())
    };
    session.set_settle(CAREFUL);
    let dark = session.capture(&black, exposure)?.mean();
    let mut fulls = Vec::new();
    for _ in 0..4 {
        fulls.push(step(session, CAREFUL)?);
    }
    let full = fulls.iter().sum::<f64>() / 4.0;
    let spread = (fulls.iter().map(|value| (value - full).powi(2)).sum::<f64>() / 3.0).sqrt();
    let light = (full - dark).max(f64::MIN_POSITIVE);
    // The tolerance is wide, because the spread of four values is uncertain, and drift and flicker may change the light by a thousandth.
    let tolerance = (5.0 * spread / light).max(2e-3);
    let mut sweep = Vec::new();
    let missing =
        |session: &mut CalibrationSession<'_>, wait: f64, sweep: &mut Vec<(f64, f64)>| -> Result<bool> {
            let share = (step(session, wait)? - dark) / light;
            sweep.push((wait, share));
            Ok((share - 1.0).abs() > tolerance)
        };
    let mut found = MeasuredValue::new(0.0, 0.0);
    if missing(session, 0.0, &mut sweep)? {
        let (mut low, mut high) = (0.0, SHORTEST);
        while high < CAREFUL && missing(session, high, &mut sweep)? {
            (low, high) = (high, 2.0 * high);
        }
        for _ in 0..6 {
            let middle = 0.5 * (low + high);
            if missing(session, middle, &mut sweep)? { low = middle } else { high = middle }
        }
        found = MeasuredValue::new(high, 0.5 * (high - low));
    }
    session.set_settle(CAREFUL);
    sweep.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(Latency { settle: found, sweep })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use crate::measure::CaptureRequest;
    use crate::measure::simulated::Simulated;

    #[test]
    fn without_a_curve_light_is_what_is_above_black() {
        let linear = Linear { black: 10.0, curve: None };
        assert_eq!((linear.of(12.5), linear.of(3.0), linear.slope(12.5)), (2.5, -7.0, 1.0));
    }

    #[test]
    fn a_curve_is_followed_between_counts_and_beyond_its_ends() {
        let squares: Vec<f64> = (0..1024).map(|count| f64::from(count * count)).collect();
        let linear = Linear { black: 0.0, curve: Some(squares) };
        assert_eq!((linear.of(7.0), linear.of(7.25)), (49.0, 49.0 + 0.25 * 15.0));
        // The first and the last piece are extrapolated as straight lines.
        assert_eq!((linear.of(-2.0), linear.of(1024.0)), (-2.0, 1023.0 * 1023.0 + 2045.0));
        // The slope is a mean over four counts on both sides. For a square function, this mean is the slope in the middle.
        assert_eq!((linear.slope(100.9), linear.slope(0.0), linear.slope(-5.0)), (200.0, 4.0, 4.0));
        assert_eq!(linear.slope(2000.0), 1023.0 + 1019.0);
        let short = Linear { black: 0.0, curve: Some(vec![0.0, 1.0, 4.0, 9.0]) };
        assert_eq!(short.slope(1.0), 2.0, "over one count at least");
    }

    const EXPOSURE: f64 = 0.02;

    /// Measures the latency of a rig whose white has 50,000 counts above 100. `share` gives the fraction of this light in a white photo,
    /// from the wait in seconds and the number of the photo. Also returns the wait that is set at the end.
    fn found(share: impl Fn(f64, usize) -> f64 + Send) -> (Latency, f64) {
        let mut whites = 0;
        let photo = move |request: &CaptureRequest, wait: f64| {
            assert_eq!(request.exposure, EXPOSURE);
            let is_white = request.frame.levels()[0] > 0;
            // Black is always shown for the longest wait before white.
            assert!(is_white || wait == CAREFUL);
            whites += usize::from(is_white);
            let light = if is_white { 50_000.0 * share(wait, whites) } else { 0.0 };
            vec![(100.0 + light).round() as u16; 6]
        };
        let size = Resolution::new(3, 2);
        let mut frames = Simulated::new(size, size, 16, photo);
        let latency = latency(&mut CalibrationSession::new(&mut frames), EXPOSURE).expect("it never fails");
        (latency, frames.settle)
    }

    #[test]
    fn the_wait_is_found_after_which_all_light_is_there() {
        let late = 0.0137;
        let (latency, wait) = found(|wait, _| (1.0 - (late - wait).max(0.0) / EXPOSURE).max(0.0));
        // Six bisections narrow the interval of 8 to 16 ms. Up to two thousandths of the light may be missing.
        let (value, error) = (latency.settle.value, latency.settle.error);
        assert!((error - 0.5 * 8e-3 / 64.0).abs() < 1e-12, "{error}");
        assert!((late - 2e-3 * EXPOSURE..=late + 2.0 * error).contains(&value), "{value}");
        assert_eq!(latency.sweep.len(), 1 + 5 + 6);
        assert!(latency.sweep.is_sorted_by(|a, b| a.0 < b.0) && latency.sweep[0].0 == 0.0);
        for (wait, share) in latency.sweep {
            let expected = (1.0 - (late - wait).max(0.0) / EXPOSURE).max(0.0);
            assert!((share - expected).abs() < 2e-5, "{share} after {wait}");
        }
        assert_eq!(wait, CAREFUL);
    }

    #[test]
    fn a_projector_without_latency_needs_no_wait_and_one_that_never_settles_the_longest() {
        let (latency, _) = found(|_, _| 1.0);
        assert_eq!((latency.settle, latency.sweep.len()), (MeasuredValue::new(0.0, 0.0), 1));
        // The first four photos of white are the reference.
        let (latency, _) = found(|_, white| if white <= 4 { 1.0 } else { 0.9 });
        assert!(latency.settle.value >= CAREFUL, "{:?}", latency.settle);
    }

    /// White photos of 1 ± 0.005 have a standard deviation σ of 0.0058. A difference of up to 5 σ, or 2.9 %, may be noise.
    #[test]
    fn light_is_missing_where_it_differs_by_more_than_repeated_whites_do() {
        let flickering = |after: f64| {
            found(move |_, white| match white {
                1 | 3 => 1.005,
                2 | 4 => 0.995,
                _ => after,
            })
        };
        for (after, is_settled) in [(0.975, true), (0.965, false), (1.025, true), (1.035, false)] {
            assert_eq!(flickering(after).0.settle.value == 0.0, is_settled, "{after}");
        }
    }
}
