//! One channel of a light, as the Krylov methods multiply with it.

use std::cell::RefCell;
use std::sync::Arc;

use super::console::Console;
use crate::image::Resolution;
use crate::measure::Measurement;
use crate::operator::{Adjoint, Ahead, Operator, Symmetry};
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
        ahead: [Ahead; 2],
    },
    Measured {
        measurement: &'a RefCell<&'a mut Measurement>,
        part: Part,
        channel: usize,
    },
    Kept(JournaledOperator<'a>),
}

impl ChannelOperator<'_> {
    fn with<T>(&mut self, work: impl FnOnce(&mut dyn Adjoint) -> T) -> T {
        match self {
            Self::Replayed(operator) => work(operator),
            Self::Kept(operator) => work(operator),
            Self::Retraced { tracer, settings, channels, part, channel, console, ahead } => {
                let tracer = &mut tracer.borrow_mut();
                tracer.observe(Arc::new((*console).clone()));
                let retraced = Retraced { tracer, settings: *settings, channels: *channels };
                work(&mut RetracedOperator { retraced, part: *part, channel: *channel, ahead })
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
            Self::Kept(operator) => ([operator.rows(), operator.cols()], operator.symmetry()),
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

    fn announce(&mut self, xs: &[Vec<f64>]) {
        self.with(|operator| operator.announce(xs));
    }
}

impl Adjoint for ChannelOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> crate::Result<()> {
        self.with(|operator| operator.apply_adjoint(y, x))
    }

    fn announce_adjoint(&mut self, ys: &[Vec<f64>]) {
        self.with(|operator| operator.announce_adjoint(ys));
    }
}
