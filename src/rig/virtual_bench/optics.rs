//! The camera's optics: they resample the photo to camera pixels, by area.
//!
//! Each camera pixel is divided into sub-pixels. The misregistration maps the centre of a sub-pixel, and its local scale gives the
//! sides. Each sub-pixel is a mean over the photo pixels (squares of constant light), weighted by the area of the overlap. This is
//! exact for shifts and scales; the error is of second order in a sub-pixel's rotation. Light outside the photo is 0. The
//! resampling is linear, so that it is one sparse matrix, which is built once.

use rayon::prelude::*;

use super::Misregistration;
use crate::image::{Image, Resolution};

/// Sub-pixels along each side of a camera pixel.
const SUB_PIXELS: usize = 4;

impl Misregistration {
    /// Maps the point `[x, y]` that should be seen to the point that is seen, both in pixels of `raster` from its top left corner.
    /// The result is not finite where a homography maps the point to infinity.
    pub fn apply(&self, raster: Resolution, [x, y]: [f64; 2]) -> [f64; 2] {
        let centre = [raster.width as f64 / 2.0, raster.height as f64 / 2.0];
        let from_centre = [x - centre[0], y - centre[1]];
        let radius_squared = (from_centre[0] * from_centre[0] + from_centre[1] * from_centre[1])
            / (centre[0] * centre[0] + centre[1] * centre[1]);
        let distorted = from_centre.map(|offset| offset * (1.0 + self.distortion * radius_squared));
        if let Some(rows) = self.homography {
            let point = [centre[0] + distorted[0], centre[1] + distorted[1], 1.0];
            let [u, v, w] = rows.map(|row| row.iter().zip(point).map(|(a, b)| a * b).sum::<f64>());
            return [u / w, v / w];
        }
        let (sin, cos) = self.rotation.to_radians().sin_cos();
        [
            centre[0] + self.scale * (cos * distorted[0] - sin * distorted[1]) + self.shift[0],
            centre[1] + self.scale * (sin * distorted[0] + cos * distorted[1]) + self.shift[1],
        ]
    }
}

/// The weights of photo pixels in each camera pixel, as compressed sparse rows.
pub(super) struct Optics {
    starts: Vec<usize>,
    pixels: Vec<u32>,
    weights: Vec<f64>,
}

impl Optics {
    /// The optics of a camera with `camera` pixels in front of a photo with `photo` pixels. `map` takes a point that should be seen to
    /// the one that is seen, both in pixels of the photo from its top left corner.
    pub(super) fn new(
        camera: Resolution,
        photo: Resolution,
        map: &(dyn Fn([f64; 2]) -> [f64; 2] + Sync),
    ) -> Self {
        let rows: Vec<Vec<(u32, f64)>> =
            (0..camera.pixels()).into_par_iter().map(|pixel| row(pixel, camera, photo, map)).collect();
        let mut optics = Self { starts: vec![0], pixels: Vec::new(), weights: Vec::new() };
        for (pixel, weight) in rows.iter().map(|row| row.iter().copied()).flat_map(|row| {
            optics.starts.push(optics.starts[optics.starts.len() - 1] + row.len());
            row
        }) {
            optics.pixels.push(pixel);
            optics.weights.push(weight);
        }
        optics
    }

    /// One channel of the photo as the camera sees it.
    pub(super) fn see(&self, photo: &Image, channel: usize) -> Vec<f64> {
        let samples = photo.samples();
        self.resample(|pixel| f64::from(samples[pixel * photo.channels() + channel]))
    }

    /// The camera's pixels, where `light` is that of a photo's pixel.
    pub(super) fn resample(&self, light: impl Fn(usize) -> f64) -> Vec<f64> {
        let row = |ends: &[usize]| {
            let range = ends[0]..ends[1];
            let terms = self.pixels[range.clone()].iter().zip(&self.weights[range]);
            terms.map(|(&pixel, weight)| weight * light(pixel as usize)).sum()
        };
        self.starts.windows(2).map(row).collect()
    }
}

/// The photo pixels that one camera pixel sees, with their weights, ordered by pixel.
fn row(
    pixel: usize,
    camera: Resolution,
    photo: Resolution,
    map: &(dyn Fn([f64; 2]) -> [f64; 2] + Sync),
) -> Vec<(u32, f64)> {
    let step = [
        photo.width as f64 / (camera.width * SUB_PIXELS) as f64,
        photo.height as f64 / (camera.height * SUB_PIXELS) as f64,
    ];
    let corner = [pixel % camera.width * SUB_PIXELS, pixel / camera.width * SUB_PIXELS];
    let mut shares: Vec<(u32, f64)> = Vec::new();
    for sub in 0..SUB_PIXELS * SUB_PIXELS {
        let sub = [sub % SUB_PIXELS, sub / SUB_PIXELS];
        let centre = [0, 1].map(|axis| ((corner[axis] + sub[axis]) as f64 + 0.5) * step[axis]);
        let at = |x: f64, y: f64| map([centre[0] + x * step[0], centre[1] + y * step[1]]);
        let (middle, left, right, top, bottom) =
            (at(0.0, 0.0), at(-0.5, 0.0), at(0.5, 0.0), at(0.0, -0.5), at(0.0, 0.5));
        let side = |a: [f64; 2], b: [f64; 2]| ((b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2)).sqrt();
        let sides = [side(left, right), side(top, bottom)];
        share_out(middle, sides, photo, &mut shares);
    }
    shares.sort_by_key(|share| share.0);
    let weight = 1.0 / (SUB_PIXELS * SUB_PIXELS) as f64;
    let runs = shares.chunk_by(|a, b| a.0 == b.0);
    runs.map(|run| (run[0].0, weight * run.iter().map(|share| share.1).sum::<f64>())).collect()
}

/// Adds the share of a rectangle with the centre `middle` that lies in each photo pixel.
fn share_out(middle: [f64; 2], sides: [f64; 2], photo: Resolution, shares: &mut Vec<(u32, f64)>) {
    let ends = [photo.width as f64, photo.height as f64];
    let spans = [0, 1].map(|axis| {
        [-0.5, 0.5].map(|end| (middle[axis] + end * sides[axis]).clamp(0.0, ends[axis])) // NaN stays NaN
    });
    let area = sides[0] * sides[1];
    if !(area > 0.0 && area.is_finite() && spans.as_flattened().iter().all(|end| end.is_finite())) {
        return;
    }
    for y in spans[1][0] as usize..spans[1][1].ceil() as usize {
        let height = spans[1][1].min(y as f64 + 1.0) - spans[1][0].max(y as f64);
        for x in spans[0][0] as usize..spans[0][1].ceil() as usize {
            let width = spans[0][1].min(x as f64 + 1.0) - spans[0][0].max(x as f64);
            if width > 0.0 && height > 0.0 {
                shares.push(((y * photo.width + x) as u32, width * height / area));
            }
        }
    }
}

/// The factor `1 − vignetting · r²` at each pixel, where `r` is the distance from the centre relative to the corner's.
pub(super) fn vignette(resolution: Resolution, vignetting: f64) -> Vec<f64> {
    let Resolution { width, height } = resolution;
    let offset = |index: usize, of: usize| index as f64 + 0.5 - of as f64 / 2.0;
    let corner = (width * width + height * height) as f64 / 4.0;
    (0..resolution.pixels())
        .map(|pixel| {
            let [x, y] = [offset(pixel % width, width), offset(pixel / width, height)];
            1.0 - vignetting * (x * x + y * y) / corner
        })
        .collect()
}
