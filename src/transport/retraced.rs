//! Photos by tracing anew: nothing is kept, so it needs no memory for a matrix.

use std::ops::ControlFlow;

use super::{Channels, Transport, from_planes, luminance, planes};
use crate::error::Result;
use crate::image::{Image, Resolution};
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

impl Transport for Retraced<'_> {
    fn resolution(&self) -> Resolution {
        self.settings.resolution
    }

    fn channels(&self) -> Channels {
        self.channels
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        let lit = planes(pattern, self.resolution(), self.channels)?;
        let mut seen = vec![vec![0.0_f64; self.resolution().pixels()]; lit.len()];
        let channels = self.channels;
        self.tracer.trace(&self.settings, self.progress, &mut |batch| {
            for index in 0..batch.len() {
                let camera = batch.pixel(index) as usize;
                let direct = project(channels, batch.direct(index));
                let ambient = project(channels, batch.ambient(index).unwrap_or_default());
                for (channel, seen) in seen.iter_mut().enumerate() {
                    seen[camera] += direct[channel] * lit[channel][camera] + ambient[channel];
                }
                for connection in batch.connections(index) {
                    let value = project(channels, connection.value);
                    let projector = connection.projector as usize;
                    for (channel, seen) in seen.iter_mut().enumerate() {
                        // The path and its reverse, as in the matrix.
                        seen[camera] += value[channel] * lit[channel][projector];
                        seen[projector] += value[channel] * lit[channel][camera];
                    }
                }
            }
            Ok(())
        })?;
        let samples = f64::from(self.settings.samples);
        seen.iter_mut().flatten().for_each(|value| *value /= samples);
        from_planes(self.resolution(), &seen)
    }
}

fn project(channels: Channels, color: [f32; 3]) -> [f64; 3] {
    match channels {
        Channels::Luma => [f64::from(luminance(color)), 0.0, 0.0],
        Channels::Rgb => color.map(f64::from),
    }
}
