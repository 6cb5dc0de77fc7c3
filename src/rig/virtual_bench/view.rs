//! The way of light from the projector to the camera's sensor: through the scene and the camera's optics.

use super::VirtualCamera;
use super::optics::Optics;
use crate::error::Result;
use crate::image::Image;
use crate::transport::{Transport, luminance};

/// Light on the sensor in the photo's units: one plane for each of the camera's channels.
pub(super) type SeenLight = Vec<Vec<f64>>;

/// A scene seen through a camera's optics.
pub(super) struct View {
    transport: Box<dyn Transport + Send>,
    optics: Optics,
    channels: usize,
    crosstalk: Option<[[f64; 3]; 3]>,
    /// The photo without light from the projector.
    unlit: Image,
}

impl View {
    /// The view of this camera. The scene has at least as many channels as the camera.
    pub(super) fn new(
        mut transport: Box<dyn Transport + Send>,
        optics: Optics,
        camera: &VirtualCamera,
    ) -> Result<Self> {
        let nothing = Image::filled(transport.pattern_resolution(), 1, 0.0);
        let unlit = transport.photograph(&nothing)?;
        let VirtualCamera { channels, crosstalk, .. } = *camera;
        Ok(Self { transport, optics, channels, crosstalk, unlit })
    }

    /// The light that a pattern adds to the scene's own light.
    pub(super) fn lit_by(&mut self, pattern: &Image) -> Result<SeenLight> {
        let mut photo = match self.crosstalk {
            Some(matrix) if pattern.channels() == 3 => {
                self.transport.photograph(&mixed(&matrix, pattern)?)?
            }
            _ => self.transport.photograph(pattern)?,
        };
        for (sample, unlit) in photo.samples_mut().iter_mut().zip(self.unlit.samples()) {
            *sample -= unlit;
        }
        self.on_sensor(&photo)
    }

    /// The scene's own light.
    pub(super) fn unlit(&self) -> Result<SeenLight> {
        self.on_sensor(&self.unlit)
    }

    fn on_sensor(&self, photo: &Image) -> Result<SeenLight> {
        if self.channels == 1 && photo.channels() == 3 {
            let gray = photo.samples().chunks_exact(3).map(|rgb| luminance([rgb[0], rgb[1], rgb[2]]));
            let gray = Image::new(photo.resolution(), 1, gray.collect())?;
            return Ok(vec![self.optics.see(&gray, 0)]);
        }
        Ok((0..self.channels).map(|channel| self.optics.see(photo, channel)).collect())
    }
}

/// The pattern whose channel `c` is the light that camera channel `c` responds to: `matrix` times the pattern's channels.
fn mixed(matrix: &[[f64; 3]; 3], pattern: &Image) -> Result<Image> {
    let light = pattern.samples().chunks_exact(3).flat_map(|colors| {
        matrix.map(|row| row.iter().zip(colors).map(|(m, &color)| m * f64::from(color)).sum::<f64>() as f32)
    });
    Image::new(pattern.resolution(), 3, light.collect())
}
