//! A scene's light transport as a verb uses it: replayed from a matrix, or traced anew for each photo.

use anyhow::Result;

use super::console::Console;
use super::operator::{OperatorArg, OperatorArgs, in_words};
use super::options::TraceArgs;
use super::simulation;
use crate::image::Image;
use crate::operator::Adjoint;
use crate::render::{TraceSettings, Tracer};
use crate::scene::Scene;
use crate::transport::{
    Assembled, Channels, MatrixOperator, Noise, Part, Retraced, RetracedOperator, Simulated, Transport,
    predict,
};

/// Either operator. For equal settings both give equal photos, to rounding.
pub(super) enum Light<'a> {
    Replayed(Box<Simulated>),
    Retraced { tracer: &'a mut Tracer, settings: TraceSettings, channels: Channels },
}

impl<'a> Light<'a> {
    /// The operator that the options ask for; the matrix for `auto`, unless that would not fit the memory.
    pub(super) fn choose(
        tracer: &'a mut Tracer,
        scene: &Scene,
        trace: &TraceArgs,
        choice: &OperatorArgs,
        channels: Channels,
        console: &Console,
    ) -> Result<Self> {
        let settings = trace.settings_for(scene);
        let retrace = match choice.operator {
            OperatorArg::Replay => false,
            OperatorArg::Retrace => true,
            OperatorArg::Auto => {
                let limit = choice.memory();
                let needed = predict(tracer, &settings, channels, limit)?.bytes;
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
            return Ok(Self::Retraced { tracer, settings, channels });
        }
        let traced = simulation::assemble(tracer, scene, trace, channels, console)?;
        Ok(Self::Replayed(Box::new(Simulated { traced })))
    }

    /// The matrix, where there is one.
    pub(super) fn matrix(&self) -> Option<&Assembled> {
        match self {
            Self::Replayed(rig) => Some(&rig.traced),
            Self::Retraced { .. } => None,
        }
    }

    /// What is known of the matrix's noise.
    pub(super) fn noise(&self) -> Option<&Noise> {
        self.matrix()?.noise.as_ref()
    }

    /// Lets `work` multiply with a part of the first channel.
    pub(super) fn with_operator<T>(
        &mut self,
        part: Part,
        console: &Console,
        work: impl FnOnce(&mut dyn Adjoint) -> T,
    ) -> T {
        match self {
            Self::Replayed(rig) => work(&mut MatrixOperator { matrix: &rig.traced.matrix, part, channel: 0 }),
            Self::Retraced { tracer, settings, channels } => {
                let retraced = Retraced {
                    tracer,
                    settings: *settings,
                    channels: *channels,
                    progress: &mut |_| console.check(),
                };
                work(&mut RetracedOperator { retraced, part, channel: 0 })
            }
        }
    }

    /// The photo under an all-ones pattern.
    pub(super) fn white(&mut self, console: &Console) -> Result<Image> {
        let resolution = match self {
            Self::Replayed(rig) => rig.pattern_resolution(),
            Self::Retraced { tracer, settings, .. } => tracer.projector_resolution(settings),
        };
        self.photograph(&Image::filled(resolution, 1, 1.0), console)
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
        }
    }
}

/// The line about a matrix's noise.
pub(super) fn say_noise(noise: Option<&Noise>, console: &Console) -> Result<()> {
    let Some(noise) = noise else { return Ok(()) };
    console.say(format_args!(
        "noise     {} % of the white photo, {} % of the matrix, {} % without direct light",
        percent(noise.white_relative),
        percent(noise.operator),
        percent(noise.global)
    ))
}

/// A share as a percentage of three digits.
pub(super) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let decimals = if percent >= 100.0 {
        0
    } else if percent >= 10.0 {
        1
    } else {
        2
    };
    format!("{percent:.decimals$}")
}

#[cfg(test)]
mod tests {
    #[test]
    fn percentages_have_three_digits() {
        assert_eq!([1.5, 0.25, 0.0123].map(super::percent), ["150", "25.0", "1.23"]);
    }
}
