//! Light transport as a verb uses it: replayed from a matrix, traced anew for each photo, or measured by a rig.

use std::cell::RefCell;

use anyhow::Result;

use super::console::Console;
use super::measured::Measured;
use super::operator::{OperatorArg, OperatorArgs, in_words};
use super::simulation::Simulation;
use crate::image::{Image, Resolution};
use crate::measure::Measurement;
use crate::operator::{Adjoint, Operator, Symmetry};
use crate::render::{TraceSettings, Tracer};
use crate::report::manifest;
use crate::transport::{
    Assembled, Channels, MatrixOperator, Noise, Part, Retraced, RetracedOperator, Simulated, Transport,
    predict,
};

/// What photos are taken by. For equal settings the first two give equal photos, to rounding.
pub(super) enum Light<'a> {
    Replayed(Box<Simulated>),
    Retraced { tracer: &'a mut Tracer, settings: TraceSettings, channels: Channels },
    Measured(Box<Measured>),
}

impl<'a> Light<'a> {
    /// The operator that the options ask for; the matrix for `auto`, unless that would not fit the memory.
    pub(super) fn of_scene(
        simulation: &'a mut Simulation,
        choice: &OperatorArgs,
        channels: Channels,
        console: &Console,
    ) -> Result<Self> {
        let settings = simulation.settings;
        let retrace = match choice.operator {
            OperatorArg::Replay => false,
            OperatorArg::Retrace => true,
            OperatorArg::Auto => {
                let limit = choice.memory();
                let needed = predict(&mut simulation.tracer, &settings, channels, limit)?.bytes;
                let exceeds = needed > limit as f64;
                if exceeds {
                    let (needed, limit) = (in_words(needed as u64), in_words(limit));
                    console.note(format_args!(
                        "note: the matrix would take about {needed}, more than --memory {limit}: every photo is traced anew"
                    ));
                }
                exceeds
            }
        };
        if retrace {
            return Ok(Self::Retraced { tracer: &mut simulation.tracer, settings, channels });
        }
        let traced = simulation.assemble(channels, console)?;
        Ok(Self::Replayed(Box::new(Simulated { traced })))
    }

    /// The matrix, where there is one.
    pub(super) fn matrix(&self) -> Option<&Assembled> {
        match self {
            Self::Replayed(rig) => Some(&rig.traced),
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

    /// What a run on a rig has cost so far; see [`Measured::record`].
    pub(super) fn record(&mut self, whole: bool) -> Result<Option<manifest::Rig>> {
        match self {
            Self::Replayed(_) | Self::Retraced { .. } => Ok(None),
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
        match self {
            Self::Replayed(rig) => {
                let matrix = &rig.traced.matrix;
                let operator = |channel| ChannelOperator::Replayed(MatrixOperator { matrix, part, channel });
                work(&mut (0..matrix.channels().count()).map(operator).collect::<Vec<_>>())
            }
            Self::Retraced { tracer, settings, channels } => {
                let tracer = RefCell::new(&mut **tracer);
                let operator = |channel| {
                    let (settings, channels) = (*settings, *channels);
                    ChannelOperator::Retraced { tracer: &tracer, settings, channels, part, channel, console }
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
        }
    }

    /// The photo under an all-ones pattern.
    pub(super) fn white(&mut self, console: &Console) -> Result<Image> {
        let resolution = self.pattern_resolution();
        self.photograph(&Image::filled(resolution, 1, 1.0), console)
    }

    fn pattern_resolution(&self) -> Resolution {
        match self {
            Self::Replayed(rig) => rig.pattern_resolution(),
            Self::Retraced { tracer, settings, .. } => tracer.projector_resolution(settings),
            Self::Measured(rig) => rig.measurement.resolution(),
        }
    }

    /// A photo, with the ambient light.
    fn photograph(&mut self, pattern: &Image, console: &Console) -> Result<Image> {
        match self {
            Self::Replayed(rig) => Ok(rig.photograph(pattern)?),
            Self::Retraced { tracer, settings, channels } => {
                let bar = console.bar("tracing");
                let mut progress = |progress: crate::render::Progress| bar.at(progress.done, progress.total);
                let mut rig =
                    Retraced { tracer, settings: *settings, channels: *channels, progress: &mut progress };
                Ok(rig.photograph(pattern)?)
            }
            Self::Measured(rig) => Ok(rig.measurement.photograph(pattern)?.to_image()?),
        }
    }
}

/// One channel of a light. Channels that are traced anew, or measured, take turns with the one device.
pub(super) enum ChannelOperator<'a> {
    Replayed(MatrixOperator<'a>),
    Retraced {
        tracer: &'a RefCell<&'a mut Tracer>,
        settings: TraceSettings,
        channels: Channels,
        part: Part,
        channel: usize,
        console: &'a Console,
    },
    Measured {
        measurement: &'a RefCell<&'a mut Measurement>,
        part: Part,
        channel: usize,
    },
}

impl ChannelOperator<'_> {
    fn with<T>(&mut self, work: impl FnOnce(&mut dyn Adjoint) -> T) -> T {
        match self {
            Self::Replayed(operator) => work(operator),
            Self::Retraced { tracer, settings, channels, part, channel, console } => {
                let retraced = Retraced {
                    tracer: &mut tracer.borrow_mut(),
                    settings: *settings,
                    channels: *channels,
                    progress: &mut |_| console.check(),
                };
                work(&mut RetracedOperator { retraced, part: *part, channel: *channel })
            }
            Self::Measured { measurement, part, channel } => {
                work(&mut measurement.borrow_mut().operator(*part, *channel))
            }
        }
    }

    /// What does not need the device: rows and columns, and whether they are alike.
    fn shape(&self) -> ([usize; 2], Symmetry) {
        match self {
            Self::Replayed(operator) => ([operator.rows(), operator.cols()], operator.symmetry()),
            Self::Retraced { tracer, settings, .. } => {
                let tracer = tracer.borrow();
                let pixels = [settings.resolution, tracer.projector_resolution(settings)];
                let symmetry =
                    if tracer.symmetric(settings) { Symmetry::Symmetric } else { Symmetry::General };
                (pixels.map(Resolution::pixels), symmetry)
            }
            // Rigs are coaxial.
            Self::Measured { measurement, .. } => {
                ([measurement.borrow().resolution().pixels(); 2], Symmetry::Symmetric)
            }
        }
    }
}

impl Operator for ChannelOperator<'_> {
    fn rows(&self) -> usize {
        self.shape().0[0]
    }

    fn cols(&self) -> usize {
        self.shape().0[1]
    }

    fn symmetry(&self) -> Symmetry {
        self.shape().1
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> crate::Result<()> {
        self.with(|operator| operator.apply(x, y))
    }
}

impl Adjoint for ChannelOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> crate::Result<()> {
        self.with(|operator| operator.apply_adjoint(y, x))
    }
}
