//! A picture of one alignment round: the photo, its shadows, and arrows for displaced cells.

use crate::bench::align::{Alignment, Sight};
use crate::image::Resolution;
use crate::io::raster::Raster;
use crate::io::raster::encode_srgb;
use crate::io::raster::percentile;

/// Colour of shadows: pixels that see the scene but receive no direct light from the projector.
pub const SHADOW: [u8; 3] = [0xe0, 0x20, 0x18];

/// Colour of pixels that see nothing.
pub const DARK: [u8; 3] = [0x48, 0x20, 0x60];

/// Colour of the arrows; it differs clearly from grays and from the two colours above.
pub const ARROW: [u8; 3] = [0x00, 0x70, 0xff];

/// The picture is enlarged by the largest integer factor that keeps its longer side within this many pixels, so that arrows are visible.
const LARGE: usize = 640;

/// The length in cells of an arrow for the 95th percentile of the cells' displacements.
const LENGTH: f64 = 1.5;

/// Draws the photo in gray, shadows in red, dark pixels in violet, and an arrow along the displacement of each cell that is displaced by
/// more than `least` projector pixels. One factor scales all arrows.
pub fn picture(found: &Alignment, least: f64) -> Raster {
    let Resolution { width, height } = found.camera;
    let lit: Vec<f64> = found.white.iter().copied().filter(|&light| light > 0.0).collect();
    let bright = percentile(lit, 0.98).unwrap_or(1.0);
    let pixels = found.sights.iter().zip(&found.white).map(|(sight, light)| match sight {
        Sight::Shadow => SHADOW,
        Sight::Dark => DARK,
        Sight::Lit | Sight::Outside => [encode_srgb((light / bright).clamp(0.0, 1.0) as f32); 3],
    });
    let factor = (LARGE / width.max(height)).max(1);
    let photo = Raster::from_pixels(found.camera, pixels).enlarged(factor);
    let mut canvas = Canvas { resolution: photo.resolution(), pixels: photo.bytes().to_vec() };
    let disparity = &found.disparity;
    let unit = LENGTH * (disparity.side * factor) as f64 / disparity.upper.max(least).max(f64::MIN_POSITIVE);
    for cell in disparity.cells.iter().filter(|cell| cell.off[0].hypot(cell.off[1]) > least) {
        canvas.arrow(cell.at.map(|at| at * factor as f64), cell.off.map(|off| off * unit));
    }
    let pixels = canvas.pixels.as_chunks::<3>().0.iter().copied();
    Raster::from_pixels(Resolution::new(width * factor, height * factor), pixels)
}

struct Canvas {
    resolution: Resolution,
    pixels: Vec<u8>,
}

impl Canvas {
    fn arrow(&mut self, from: [f64; 2], along: [f64; 2]) {
        let to = [from[0] + along[0], from[1] + along[1]];
        self.line(from, to);
        for side in [-1.0, 1.0] {
            // The head reaches back by 0.3 of the arrow's length, and sideways by half of that.
            let back = [
                to[0] - 0.3 * (along[0] - side * 0.5 * along[1]),
                to[1] - 0.3 * (along[1] + side * 0.5 * along[0]),
            ];
            self.line(to, back);
        }
    }

    fn line(&mut self, from: [f64; 2], to: [f64; 2]) {
        let steps = (to[0] - from[0]).abs().max((to[1] - from[1]).abs()).ceil().clamp(1.0, 1e4);
        for step in 0..=steps as usize {
            let share = step as f64 / steps;
            let [x, y] = [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
            // Points outside the picture are not drawn.
            if x < 0.0 || y < 0.0 || x >= self.resolution.width as f64 || y >= self.resolution.height as f64 {
                continue;
            }
            // The line is two pixels wide.
            for (right, down) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let [x, y] = [x as usize + right, y as usize + down];
                if x < self.resolution.width && y < self.resolution.height {
                    let at = 3 * (y * self.resolution.width + x);
                    self.pixels[at..at + 3].copy_from_slice(&ARROW);
                }
            }
        }
    }
}
