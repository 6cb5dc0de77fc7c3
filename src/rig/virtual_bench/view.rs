//! The way of light from the projector to the camera's sensor: through the scene and the camera's optics.

use super::optics::Optics;
use super::{Splitter, VirtualCamera};
use crate::error::Result;
use crate::image::{Blur, Image, Resolution};
use crate::transport::{Transport, luminance};

/// Light on the sensor in the photo's units: one plane for each of the camera's channels.
pub(super) type SeenLight = Vec<Vec<f64>>;

/// A scene seen through a camera's optics.
pub(super) struct View {
    transport: Box<dyn Transport + Send>,
    optics: Optics,
    /// The share of the splitter's second image, and how it is seen.
    ghost: Option<(f64, Optics)>,
    blur: Option<Blur>,
    /// Stray light on each of the camera's channels for a pattern of the mean light 1.
    stray: Vec<f64>,
    channels: usize,
    crosstalk: Option<[[f64; 3]; 3]>,
    /// The photo without light from the projector.
    unlit: Image,
}

impl View {
    /// The view of this camera, with `pixels`, through this splitter, without stray light. The scene has at least as many channels as
    /// the camera.
    pub(super) fn new(
        mut transport: Box<dyn Transport + Send>,
        pixels: Resolution,
        camera: &VirtualCamera,
        splitter: &Splitter,
    ) -> Result<Self> {
        let (photo, map) = (transport.photo_resolution(), camera.misregistration());
        let optics = Optics::new(pixels, photo, &|point| map.apply(photo, point));
        let ghost = (splitter.ghost > 0.0).then(|| {
            let [right, down] = splitter.ghost_shift;
            let seen = |point| {
                let [x, y] = map.apply(photo, point);
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

    /// Adds stray light: this share of `white`, the light that `pattern` adds without it.
    pub(super) fn set_stray(&mut self, share: f64, pattern: &Image, white: &SeenLight) {
        let means = self.means(pattern);
        self.stray = means
            .iter()
            .zip(white)
            .map(|(mean, plane)| share * plane.iter().sum::<f64>() / plane.len() as f64 / mean)
            .collect();
    }

    /// The light that a pattern adds to the scene's own light.
    pub(super) fn lit_by(&mut self, pattern: &Image) -> Result<SeenLight> {
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

    /// The mean light of a pattern in each of the camera's channels.
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

    /// The scene's own light.
    pub(super) fn unlit(&self) -> Result<SeenLight> {
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

    /// One channel of a photo on the sensor.
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

/// The pattern whose channel `c` is the light that camera channel `c` responds to: `matrix` times the pattern's channels.
fn mixed(matrix: &[[f64; 3]; 3], pattern: &Image) -> Result<Image> {
    let light = pattern.samples().chunks_exact(3).flat_map(|colors| {
        matrix.map(|row| row.iter().zip(colors).map(|(m, &color)| m * f64::from(color)).sum::<f64>() as f32)
    });
    Image::new(pattern.resolution(), 3, light.collect())
}
