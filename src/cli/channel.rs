//! One channel of a light, as the Krylov methods multiply with it.

use std::cell::RefCell;

use super::console::Console;
use crate::image::Resolution;
use crate::journal::Journal;
use crate::measure::Measurement;
use crate::operator::{Adjoint, Operator, Symmetry};
use crate::render::{TraceSettings, Tracer};
use crate::transport::{Channels, JournaledOperator, MatrixOperator, Part, Retraced, RetracedOperator};

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
    Journaled {
        journal: &'a RefCell<Journal>,
        name: String,
        /// What takes the products that the journal lacks.
        inner: Option<&'a mut dyn Adjoint>,
        shape: ([usize; 2], Symmetry),
    },
}

impl ChannelOperator<'_> {
    fn with<T>(&mut self, work: impl FnOnce(&mut dyn Adjoint) -> T) -> T {
        match self {
            Self::Replayed(operator) => work(operator),
            Self::Journaled { journal, name, inner, shape } => {
                let journal = &mut journal.borrow_mut();
                work(&mut match inner {
                    Some(inner) => JournaledOperator::new(journal, name.as_str(), *inner),
                    None => JournaledOperator::replay(journal, name.as_str(), shape.0, shape.1),
                })
            }
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
            Self::Journaled { shape, .. } => *shape,
            Self::Retraced { tracer, settings, .. } => {
                let tracer = tracer.borrow();
                let pixels = [settings.resolution, tracer.projector_resolution(settings)];
                let symmetry =
                    if tracer.symmetric(settings) { Symmetry::Symmetric } else { Symmetry::General };
                (pixels.map(Resolution::pixels), symmetry)
            }
            Self::Measured { measurement, .. } => {
                let measurement = measurement.borrow();
                ([measurement.resolution().pixels(); 2], measurement.symmetry())
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

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> crate::Result<()> {
        self.with(|operator| operator.apply_block(xs, ys))
    }

    fn block_size(&self) -> usize {
        match self {
            Self::Replayed(operator) => operator.block_size(),
            Self::Journaled { inner, .. } => inner.as_ref().map_or(1, |inner| inner.block_size()),
            Self::Retraced { .. } => RetracedOperator::BLOCK_SIZE,
            Self::Measured { .. } => 1,
        }
    }
}

impl Adjoint for ChannelOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> crate::Result<()> {
        self.with(|operator| operator.apply_adjoint(y, x))
    }

    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> crate::Result<()> {
        self.with(|operator| operator.apply_adjoint_block(ys, xs))
    }
}
