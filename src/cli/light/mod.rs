//! Light transport as a verb uses it: replayed from a matrix, traced anew for each photo, or measured by a rig.

mod kept;
mod of_scene;

use std::cell::RefCell;

use anyhow::Result;

pub(super) use self::kept::{Kept, name};
use super::channel::ChannelOperator;
use super::console::Console;
use super::journal;
use super::measured::Measured;
use super::simulation::with_bar;
use crate::error::Error;
use crate::image::{Image, Resolution};
use crate::io::manifest::ProductsOn;
use crate::journal::Key;
use crate::measure::RigRecord;
use crate::operator::{Adjoint, Operator};
use crate::render::{TraceSettings, Tracer};
use crate::transport::{
    Assembled, Bounces, Channels, MatrixOperator, Noise, Part, Retraced, Simulated, Transport,
};

/// What photos are taken by. For equal settings the first two give equal photos, to rounding.
pub(super) enum Light<'a> {
    Replayed(Box<Simulated>),
    Retraced { tracer: &'a mut Tracer, settings: TraceSettings, channels: Channels },
    Measured(Box<Measured>),
    Kept(Box<Kept<'a>>),
}

impl<'a> Light<'a> {
    /// The matrix, where there is one.
    pub(super) fn matrix(&self) -> Option<&Assembled> {
        match self {
            Self::Replayed(rig) => Some(&rig.traced),
            Self::Kept(kept) => kept.inner.as_ref()?.matrix(),
            Self::Retraced { .. } | Self::Measured(_) => None,
        }
    }

    /// Whether photos cost nothing but computing.
    pub(super) fn is_simulated(&self) -> bool {
        !matches!(self, Self::Measured(_))
    }

    /// What is known of the matrix's noise.
    pub(super) fn noise(&self) -> Option<&Noise> {
        self.matrix()?.noise.as_ref()
    }

    /// Where products with the matrix are taken.
    pub(super) fn products(&self) -> Option<ProductsOn> {
        let is_on_gpu = self.matrix()?.is_on_gpu();
        Some(if is_on_gpu { ProductsOn::Device } else { ProductsOn::Cpu })
    }

    /// What a run on a rig has cost so far; see [`Measured::record`].
    pub(super) fn record(&mut self, whole: bool) -> Result<Option<RigRecord>> {
        match self {
            Self::Replayed(_) | Self::Retraced { .. } | Self::Kept(_) => Ok(None),
            Self::Measured(rig) => rig.record(whole).map(Some),
        }
    }

    /// Lets `work` multiply with a part of the first channel.
    pub(super) fn with_operator<T>(
        &mut self,
        part: Part,
        console: &Console,
        work: impl FnOnce(&mut dyn Adjoint) -> T,
    ) -> T {
        self.with_channels(part, console, |channels| work(&mut channels[0]))
    }

    /// Lets `work` multiply with a part of every channel, one operator each; there is at least one.
    pub(super) fn with_channels<T>(
        &mut self,
        part: Part,
        console: &Console,
        work: impl FnOnce(&mut [ChannelOperator<'_>]) -> T,
    ) -> T {
        let Self::Kept(kept) = self else { return self.with_own_channels(part, console, work) };
        let Kept { inner: Some(inner), journal, .. } = &mut **kept else {
            return self.with_own_channels(part, console, work);
        };
        let journal = &*journal;
        let known = journal.borrow().damages().len();
        let result = inner.with_own_channels(part, console, |channels| {
            let kept = channels.iter_mut().enumerate().map(|(channel, inner)| {
                let shape = ([inner.rows(), inner.cols()], inner.symmetry());
                ChannelOperator::Journaled { journal, name: name(part, channel), inner: Some(inner), shape }
            });
            work(&mut kept.collect::<Vec<_>>())
        });
        let journal = journal.borrow();
        journal.damages()[known..].iter().for_each(journal::warning(&journal, console));
        result
    }

    /// As [`Light::with_channels`], without writing down what is taken.
    fn with_own_channels<T>(
        &mut self,
        part: Part,
        console: &Console,
        work: impl FnOnce(&mut [ChannelOperator<'_>]) -> T,
    ) -> T {
        match self {
            Self::Kept(kept) => {
                let Kept { journal, about, channels, .. } = &**kept;
                let size = [about.photos, about.patterns].map(Resolution::pixels);
                let symmetry = about.symmetry();
                let operator = |channel| {
                    let name = name(part, channel);
                    ChannelOperator::Journaled { journal, name, inner: None, shape: (size, symmetry) }
                };
                work(&mut (0..*channels).map(operator).collect::<Vec<_>>())
            }
            Self::Replayed(rig) => {
                let traced = &rig.traced;
                let operator =
                    |channel| ChannelOperator::Replayed(MatrixOperator::new(traced, part, channel));
                work(&mut (0..traced.matrix.channels().count()).map(operator).collect::<Vec<_>>())
            }
            Self::Retraced { tracer, settings, channels } => {
                let tracer = RefCell::new(&mut **tracer);
                let operator = |channel| {
                    let (settings, channels) = (*settings, *channels);
                    let tracer = &tracer;
                    ChannelOperator::Retraced { tracer, settings, channels, part, channel, console }
                };
                work(&mut (0..channels.count()).map(operator).collect::<Vec<_>>())
            }
            Self::Measured(rig) => {
                let channels = rig.measurement.channels();
                let measurement = RefCell::new(&mut rig.measurement);
                let operator =
                    |channel| ChannelOperator::Measured { measurement: &measurement, part, channel };
                work(&mut (0..channels).map(operator).collect::<Vec<_>>())
            }
        }
    }

    /// The photo without projector.
    pub(super) fn ambient(&mut self, console: &Console) -> Result<Image> {
        match self {
            Self::Replayed(rig) => Ok(rig.traced.ambient.clone()),
            Self::Retraced { .. } => {
                let resolution = self.pattern_resolution();
                self.photograph(&Image::filled(resolution, 1, 0.0), console)
            }
            Self::Measured(rig) => Ok(rig.measurement.ambient()?.to_image()?),
            Self::Kept(kept) => kept.image("ambient", |inner| inner.ambient(console)),
        }
    }

    /// The photo under an all-ones pattern.
    pub(super) fn white(&mut self, console: &Console) -> Result<Image> {
        if let Self::Kept(kept) = self {
            return kept.image("white", |inner| inner.white(console));
        }
        let resolution = self.pattern_resolution();
        self.photograph(&Image::filled(resolution, 1, 1.0), console)
    }

    /// Photos of red, green and blue alone, in each of the camera's channels, without ambient light.
    pub(super) fn primaries(&mut self, console: &Console) -> Result<[[Vec<f64>; 3]; 3]> {
        if let Self::Measured(rig) = self {
            return rig.measurement.primaries()?.ok_or_else(|| {
                let option = "--crosstalk".into();
                let fault = "colours are mixed by a projector and a camera of three channels each, and one of these is gray";
                Error::Option { option, fault: fault.into(), help: "leave it out".into() }.into()
            });
        }
        let (resolution, ambient) = (self.pattern_resolution(), self.ambient(console)?);
        let mut photos: [[Vec<f64>; 3]; 3] = Default::default();
        for (primary, photo) in photos.iter_mut().enumerate() {
            let color = (0..3).map(|channel| f32::from(u8::from(channel == primary)));
            let samples = color.collect::<Vec<f32>>().repeat(resolution.pixels());
            let seen = self.photograph(&Image::new(resolution, 3, samples)?, console)?;
            for (channel, plane) in photo.iter_mut().enumerate() {
                let own = seen.plane(channel).into_iter().zip(ambient.plane(channel));
                *plane = own.map(|(seen, ambient)| seen - ambient).collect();
            }
        }
        Ok(photos)
    }

    fn pattern_resolution(&self) -> Resolution {
        match self {
            Self::Replayed(rig) => rig.pattern_resolution(),
            Self::Retraced { tracer, settings, .. } => tracer.projector_resolution(settings),
            Self::Measured(rig) => rig.measurement.resolution(),
            Self::Kept(kept) => kept.about.patterns,
        }
    }

    /// A photo, with the ambient light.
    fn photograph(&mut self, pattern: &Image, console: &Console) -> Result<Image> {
        match self {
            Self::Replayed(rig) => Ok(rig.photograph(pattern)?),
            Self::Retraced { tracer, settings, channels } => {
                let (settings, channels) = (*settings, *channels);
                Ok(with_bar(tracer, console, |tracer| {
                    Retraced { tracer, settings, channels }.photograph(pattern)
                })?)
            }
            Self::Measured(rig) => Ok(rig.measurement.photograph(pattern)?.to_image()?),
            Self::Kept(kept) => {
                let shown: Vec<u8> =
                    pattern.samples().iter().flat_map(|sample| sample.to_le_bytes()).collect();
                let name = format!("photo of {}", Key::of(&[&shown]));
                kept.image(&name, |inner| inner.photograph(pattern, console))
            }
        }
    }
}

/// The direct light of each channel, where it is a diagonal.
pub(super) fn direct_diagonal(traced: &Assembled) -> Option<Vec<Vec<f64>>> {
    let matrix = &traced.matrix;
    if matrix.layers().iter().any(|layer| layer.bounces() == Bounces::One) {
        return None;
    }
    let planes = (0..matrix.channels().count()).map(|channel| {
        let diagonal = matrix.direct(channel);
        (!diagonal.is_empty()).then(|| diagonal.iter().map(|&value| f64::from(value)).collect())
    });
    planes.collect()
}
