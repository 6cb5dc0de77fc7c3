//! The camera's optics resample the photo to camera pixels by area.
//!
//! Each camera pixel is divided into sub-pixels. The misregistration maps the centre of a sub-pixel to the photo, and the local scale of
//! this map gives the sub-pixel's sides. The value of each sub-pixel is a mean over photo pixels (squares of constant light), weighted by
//! the area of overlap. This is exact for shifts and scales, and the error is of second order in a sub-pixel's rotation. Light outside the
//! photo is 0. The resampling is linear, so it is one sparse matrix, which is built once.

use rayon::prelude::*;

use super::spec::{Splitter, VirtualCamera};
use crate::error::Result;
use crate::image::{Blur, Image, Resolution};
use crate::sparse::{SparseRows, WeightedColumn};
use crate::transport::{Transport, luminance};

/// Sub-pixels along each side of a camera pixel.
const SUB_PIXELS: usize = 4;

impl VirtualCamera {
    /// Maps the point `[x, y]` that should be seen to the point that is seen, both in pixels of the photo `raster` from its top left
    /// corner. The result is not finite if a homography maps the point to infinity.
    ///
    /// Without misregistration, the camera raster and the photo raster cover the same field. A point of the camera raster then lies at a
    /// point `q` of the photo raster, in projector pixels. With misregistration, the camera point sees `H(c + (q − c)(1 + k₁ r²))`, where
    /// `c` is the centre of the field and `r` is the distance of `q` from `c`, relative to a corner's distance. `H` rotates and scales
    /// about the centre, then shifts, or it is the given homography.
    pub fn sees(&self, raster: Resolution, [x, y]: [f64; 2]) -> [f64; 2] {
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

/// For each camera pixel, the pixels of the simulated photo that it averages, with their weights.
pub(crate) struct Optics(SparseRows);

impl Optics {
    /// The optics of a camera with `camera` pixels for a photo with `photo` pixels. `map` maps the point that should be seen to the point
    /// that is seen, both in pixels of the photo from its top left corner.
    pub(crate) fn new(
        camera: Resolution,
        photo: Resolution,
        map: &(dyn Fn([f64; 2]) -> [f64; 2] + Sync),
    ) -> Self {
        let rows = (0..camera.pixels()).into_par_iter().map(|pixel| row(pixel, camera, photo, map));
        Self(SparseRows::new(&rows.collect::<Vec<_>>()))
    }

    pub(crate) fn see(&self, photo: &Image, channel: usize) -> Vec<f64> {
        let samples = photo.samples();
        self.resample(|pixel| f64::from(samples[pixel * photo.channels() + channel]))
    }

    /// The values of the camera's pixels. `light` gives the light of a photo pixel.
    pub(crate) fn resample(&self, light: impl Fn(usize) -> f64) -> Vec<f64> {
        let value =
            |row: &[WeightedColumn]| row.iter().map(|&(pixel, weight)| weight * light(pixel as usize)).sum();
        self.0.rows().map(value).collect()
    }
}

/// The photo pixels that camera pixel `pixel` averages, in ascending order, with weights.
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
        let side = |a: [f64; 2], b: [f64; 2]| ((b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2)).sqrt();
        let sides = [side(at(-0.5, 0.0), at(0.5, 0.0)), side(at(0.0, -0.5), at(0.0, 0.5))];
        share_out(at(0.0, 0.0), sides, photo, &mut shares);
    }
    shares.sort_by_key(|share| share.0);
    let weight = 1.0 / (SUB_PIXELS * SUB_PIXELS) as f64;
    let runs = shares.chunk_by(|a, b| a.0 == b.0);
    runs.map(|run| (run[0].0, weight * run.iter().map(|share| share.1).sum::<f64>())).collect()
}

/// Adds to `shares`, for each photo pixel, the fraction of a rectangle's area that lies in the pixel. The rectangle's centre is `middle`.
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

/// The factor `1 − vignetting · r²` at each pixel, where `r` is the distance from the centre, relative to the distance of a corner.
pub(crate) fn vignette(resolution: Resolution, vignetting: f64) -> Vec<f64> {
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

/// Light on the sensor in the photo's units: one plane for each of the camera's channels.
pub(crate) type SeenLight = Vec<Vec<f64>>;

pub(crate) struct View {
    transport: Box<dyn Transport + Send>,
    optics: Optics,
    /// The fraction of the light that forms the splitter's second image, and the optics of this image.
    ghost: Option<(f64, Optics)>,
    blur: Option<Blur>,
    /// Stray light in each camera channel, for a pattern with a mean light of 1.
    stray: Vec<f64>,
    channels: usize,
    crosstalk: Option<[[f64; 3]; 3]>,
    unlit: Image,
}

impl View {
    /// The view of this camera through this splitter, without stray light. The scene has at least as many channels as the camera.
    pub(crate) fn new(
        mut transport: Box<dyn Transport + Send>,
        pixels: Resolution,
        camera: &VirtualCamera,
        splitter: &Splitter,
    ) -> Result<Self> {
        let photo = transport.photo_resolution();
        let optics = Optics::new(pixels, photo, &|point| camera.sees(photo, point));
        let ghost = (splitter.ghost > 0.0).then(|| {
            let [right, down] = splitter.ghost_shift;
            let seen = |point| {
                let [x, y] = camera.sees(photo, point);
                [x - right, y - down]
            };
            (splitter.ghost, Optics::new(pixels, photo, &seen))
        });
        let blur = Blur::new(pixels, camera.blur);
        let nothing = Image::filled(transport.pattern_resolution(), 1, 0.0);
        let unlit = transport.photograph(&nothing)?;
        let VirtualCamera { channels, crosstalk, .. } = *camera;
        let stray = vec![0.0; channels];
        Ok(Self { transport, optics, ghost, blur, stray, channels, crosstalk, unlit })
    }

    /// Scales the stray light so that `pattern` gives the fraction `share` of the mean of `white`, which is its light without stray light.
    pub(crate) fn set_stray(&mut self, share: f64, pattern: &Image, white: &SeenLight) {
        let means = self.means(pattern);
        self.stray = means
            .iter()
            .zip(white)
            .map(|(mean, plane)| share * plane.iter().sum::<f64>() / plane.len() as f64 / mean)
            .collect();
    }

    pub(crate) fn lit_by(&mut self, pattern: &Image) -> Result<SeenLight> {
        let mixed = match self.crosstalk {
            Some(matrix) if pattern.channels() == 3 => Some(mixed(&matrix, pattern)?),
            _ => None,
        };
        let pattern = mixed.as_ref().unwrap_or(pattern);
        let mut photo = self.transport.photograph(pattern)?;
        for (sample, unlit) in photo.samples_mut().iter_mut().zip(self.unlit.samples()) {
            *sample -= unlit;
        }
        let mut light = self.on_sensor(&photo)?;
        for ((plane, stray), mean) in light.iter_mut().zip(&self.stray).zip(self.means(pattern)) {
            plane.iter_mut().for_each(|value| *value += stray * mean);
        }
        Ok(light)
    }

    fn means(&self, pattern: &Image) -> Vec<f64> {
        let pixels = pattern.resolution().pixels() as f64;
        let means: Vec<f64> =
            pattern.planes().iter().map(|plane| plane.iter().sum::<f64>() / pixels).collect();
        match (self.channels, means.as_slice()) {
            (1, &[red, green, blue]) => vec![f64::from(luminance([red as f32, green as f32, blue as f32]))],
            (channels, &[gray]) => vec![gray; channels],
            _ => means,
        }
    }

    pub(crate) fn unlit(&self) -> Result<SeenLight> {
        self.on_sensor(&self.unlit)
    }

    fn on_sensor(&self, photo: &Image) -> Result<SeenLight> {
        if self.channels == 1 && photo.channels() == 3 {
            let gray = photo.samples().chunks_exact(3).map(|rgb| luminance([rgb[0], rgb[1], rgb[2]]));
            let gray = Image::new(photo.resolution(), 1, gray.collect())?;
            return Ok(vec![self.plane(&gray, 0)]);
        }
        Ok((0..self.channels).map(|channel| self.plane(photo, channel)).collect())
    }

    fn plane(&self, photo: &Image, channel: usize) -> Vec<f64> {
        let mut plane = self.optics.see(photo, channel);
        if let Some((share, ghost)) = &self.ghost {
            let ghost = ghost.see(photo, channel);
            plane.iter_mut().zip(ghost).for_each(|(value, ghost)| *value += share * ghost);
        }
        match &self.blur {
            Some(blur) => blur.apply(&plane),
            None => plane,
        }
    }
}

/// The pattern in which channel `c` is the light that camera channel `c` responds to: `matrix` times the pattern's channels.
fn mixed(matrix: &[[f64; 3]; 3], pattern: &Image) -> Result<Image> {
    let light = pattern.samples().chunks_exact(3).flat_map(|colors| {
        matrix.map(|row| row.iter().zip(colors).map(|(m, &color)| m * f64::from(color)).sum::<f64>() as f32)
    });
    Image::new(pattern.resolution(), 3, light.collect())
}
