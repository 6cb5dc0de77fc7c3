//! The preview of a camera frame for setting up the camera: saturated pixels are red, pixels without signal blue.

use crate::io::raster::Raster;
use crate::io::raster::encode_srgb;
use crate::rig::RawFrame;

/// Colour of pixels with a saturated sample.
pub const SATURATED: [u8; 3] = [0xff, 0x20, 0x10];

/// Colour of pixels whose samples are all 0.
pub const CRUSHED: [u8; 3] = [0x20, 0x50, 0xff];

/// Paints counts from `black` to `full` in sRGB, with one exposure for all frames; counts of at least `limit` are saturated.
pub fn overlay(frame: &RawFrame, black: f64, full: f64, limit: f64) -> Raster {
    let range = (full - black).max(1.0);
    let pixels = frame.counts.chunks_exact(frame.channels).map(|pixel| {
        if pixel.iter().any(|&count| f64::from(count) >= limit) {
            return SATURATED;
        }
        if pixel.iter().all(|&count| count == 0) {
            return CRUSHED;
        }
        let level = |channel: usize| {
            let count = pixel[channel.min(pixel.len() - 1)];
            encode_srgb(((f64::from(count) - black) / range).clamp(0.0, 1.0) as f32)
        };
        [level(0), level(1), level(2)]
    });
    Raster::from_pixels(frame.resolution, pixels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    #[test]
    fn both_ends_of_the_range_are_coloured_and_what_is_between_is_gray() {
        let counts = vec![0, 100, 2000, 4095];
        let resolution = Resolution::new(4, 1);
        let frame = RawFrame { resolution, channels: 1, counts, exposure: 0.1, id: 1, started: 0.0 };
        let picture = overlay(&frame, 100.0, 4095.0, 4090.0);
        assert_eq!((picture.pixel(0, 0), picture.pixel(3, 0)), (CRUSHED, SATURATED));
        assert_eq!(picture.pixel(1, 0), [0; 3]);
        let [red, green, blue] = picture.pixel(2, 0);
        // The sRGB code of the linear value 0.4756 is expected.
        assert!(red == green && green == blue && (180..185).contains(&red), "{red}");
    }
}
