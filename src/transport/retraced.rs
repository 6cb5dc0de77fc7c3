//! Photos by tracing anew: nothing is kept, so it needs no memory for a matrix.

use std::ops::ControlFlow;

use super::noise::Halves;
use super::{Channels, Part, Transport, from_planes, luminance, planes};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::operator::{Adjoint, Operator, Symmetry};
use crate::render::{Progress, TraceSettings, Tracer};

/// A scene that is traced once per photo, always with the same light paths.
///
/// The connections are added up on the host in path order, so that photos repeat to the bit without atomics.
pub struct Retraced<'a> {
    /// The scene on its device.
    pub tracer: &'a mut Tracer,
    /// What is traced for each photo.
    pub settings: TraceSettings,
    /// Gray or colour.
    pub channels: Channels,
    /// Called as the tracing of a photo goes on; a break interrupts it.
    pub progress: &'a mut dyn FnMut(Progress) -> ControlFlow<()>,
}

impl Retraced<'_> {
    /// The photo of `pattern`, and its standard error pixel by pixel: the halves' difference, as in [`super::Noise`], of
    /// this very photo with its ambient light. Zeros where one path per pixel cannot tell.
    ///
    /// # Errors
    /// As [`Transport::photograph`].
    pub fn photograph_with_error(&mut self, pattern: &Image) -> Result<(Image, Image)> {
        let lit = planes(pattern, self.pattern_resolution(), self.channels)?;
        let camera = self.settings.resolution;
        let seen = self.trace(Direction::Forward, Part::Full, true, (0, &lit), camera.pixels())?;
        let planes = |value: fn(&[f64; 2]) -> f64| -> Vec<Vec<f64>> {
            seen.iter().map(|plane| plane.iter().map(value).collect()).collect()
        };
        let photo = from_planes(camera, &planes(|[mean, _]| *mean))?;
        Ok((photo, from_planes(camera, &planes(|[_, error]| error.abs()))?))
    }

    /// Traces, and returns what arrives of `lit` (its first channel, and the light by channel from there on) with its error:
    /// `[channel][pixel][mean, error]`.
    fn trace(
        &mut self,
        direction: Direction,
        part: Part,
        with_ambient: bool,
        (first_channel, lit): (usize, &[Vec<f64>]),
        pixels: usize,
    ) -> Result<Vec<Vec<[f64; 2]>>> {
        let samples = self.settings.samples;
        let project = |color| project(self.channels, first_channel, color);
        let mut seen = vec![vec![[0.0_f64; 2]; pixels]; lit.len()];
        self.tracer.trace(&self.settings, self.progress, &mut |batch| {
            let halves = Halves::new(samples, batch.samples());
            for path in 0..batch.len() {
                let half = batch.half(path);
                // `seen[to] += value · lit[from]`, channel by channel.
                let mut add = |to: u32, value: [f64; 3], from: Option<u32>| {
                    if value == [0.0; 3] {
                        return;
                    }
                    for (channel, seen) in seen.iter_mut().enumerate() {
                        let light = from.map_or(1.0, |from| lit[channel][from as usize]);
                        halves.add(&mut seen[to as usize], half, value[channel] * light);
                    }
                };
                let pixel = batch.pixel(path);
                if part.holds(1) {
                    add(pixel, project(batch.direct(path)), Some(pixel));
                }
                if let Some(ambient) = batch.ambient(path).filter(|_| with_ambient) {
                    add(pixel, project(ambient), None);
                }
                for connection in batch.connections(path).filter(|connection| part.holds(connection.bounces))
                {
                    let value = project(connection.value);
                    let (to, from) = match direction {
                        Direction::Forward => (connection.camera, connection.projector),
                        Direction::Backward => (connection.projector, connection.camera),
                    };
                    add(to, value, Some(from));
                    if batch.symmetric() {
                        // The path's reverse, as in the matrix.
                        add(from, value, Some(to));
                    }
                }
            }
            Ok(())
        })?;
        Ok(seen)
    }
}

/// From the projector to the camera, or as if each were the other.
#[derive(Clone, Copy)]
enum Direction {
    Forward,
    Backward,
}

impl Transport for Retraced<'_> {
    fn pattern_resolution(&self) -> Resolution {
        self.tracer.projector_resolution(&self.settings)
    }

    fn photo_resolution(&self) -> Resolution {
        self.settings.resolution
    }

    fn channels(&self) -> Channels {
        self.channels
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        Ok(self.photograph_with_error(pattern)?.0)
    }
}

/// The channels from `first` on.
fn project(channels: Channels, first: usize, color: [f32; 3]) -> [f64; 3] {
    let mut values = match channels {
        Channels::Luma => [f64::from(luminance(color)), 0.0, 0.0],
        Channels::Rgb => color.map(f64::from),
    };
    values.rotate_left(first);
    values
}

/// `y = P x` for one part and channel, traced anew for each product. The same matrix as the replayed one, to rounding.
pub struct RetracedOperator<'a> {
    /// The scene.
    pub retraced: Retraced<'a>,
    /// Which light.
    pub part: Part,
    /// Which channel, below [`Channels::count`].
    pub channel: usize,
}

impl RetracedOperator<'_> {
    fn product(&mut self, direction: Direction, from: &[f64], to: &mut [f64]) -> Result<()> {
        let lit = [from.to_vec()];
        let seen = self.retraced.trace(direction, self.part, false, (self.channel, &lit), to.len())?;
        for (to, [mean, _]) in to.iter_mut().zip(&seen[0]) {
            *to = *mean;
        }
        Ok(())
    }
}

impl Operator for RetracedOperator<'_> {
    fn rows(&self) -> usize {
        self.retraced.photo_resolution().pixels()
    }

    fn cols(&self) -> usize {
        self.retraced.pattern_resolution().pixels()
    }

    fn symmetry(&self) -> Symmetry {
        let Retraced { tracer, settings, .. } = &self.retraced;
        if tracer.symmetric(settings) { Symmetry::Symmetric } else { Symmetry::General }
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.product(Direction::Forward, x, y)
    }
}

impl Adjoint for RetracedOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.product(Direction::Backward, y, x)
    }
}
