//! Light of a scene: a matrix to multiply with, or tracing for each photo.

use anyhow::Result;

use super::Light;
use crate::cli::console::Console;
use crate::cli::operator::{OperatorArg, OperatorArgs, ProductsArg, in_words};
use crate::cli::simulation::Simulation;
use crate::error::Error;
use crate::transport::{Assembled, Channels, Simulated, predict};

impl<'a> Light<'a> {
    /// The operator that the options ask for; the matrix for `auto`, unless that would not fit the memory.
    pub(in crate::cli) fn of_scene(
        simulation: &'a mut Simulation,
        choice: &OperatorArgs,
        channels: Channels,
        console: &Console,
    ) -> Result<Self> {
        let settings = simulation.settings;
        let retrace = match choice.operator {
            OperatorArg::Replay => false,
            OperatorArg::Retrace if choice.products != ProductsArg::Auto => {
                return Err(Error::Option {
                    option: "--products".into(),
                    fault: "photos that are traced anew are no products with a matrix".into(),
                    help: "leave it out, or give --operator replay".into(),
                }
                .into());
            }
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
        Self::replayed(simulation, traced, choice, console)
    }

    /// Products with this matrix, taken where the options say.
    pub(in crate::cli) fn replayed(
        simulation: &Simulation,
        mut traced: Assembled,
        choice: &OperatorArgs,
        console: &Console,
    ) -> Result<Self> {
        simulation.place(&mut traced, choice.products.into(), console)?;
        Ok(Self::Replayed(Box::new(Simulated { traced })))
    }
}
