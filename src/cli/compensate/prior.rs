//! What is known beside the photos: direct light and shape of a simulated scene, crosstalk of colours.

use crate::analysis::{CompensateOptions, Crosstalk, Precondition};
use crate::cli::console::Console;
use crate::cli::light::Light;
use crate::cli::source::Source;
use crate::error::{Error, Result};
use crate::operator::{Operator, Symmetry};
use crate::scene::predicted_direct;
use crate::transport::{Channels, Part};

/// How colours of projector and camera belong together.
#[derive(clap::Args)]
pub(super) struct ColorArgs {
    /// What each camera channel sees of each projector colour, row by row: nine numbers. The light is mixed so, and all three
    /// colours are solved as one system
    #[arg(long, value_name = "M11,M12,...", value_delimiter = ',', num_args = 9)]
    crosstalk: Vec<f64>,
    /// Solve each channel by itself and un-mix the colours afterwards
    #[arg(long, requires = "crosstalk")]
    unmix: bool,
}

impl ColorArgs {
    /// The mixing matrix, if there is one.
    pub(super) fn crosstalk(&self, channels: Channels) -> Result<Option<Crosstalk>> {
        let refuse = |fault: String, help: &str| {
            Err(Error::Option { option: "--crosstalk".into(), fault, help: help.into() })
        };
        let [a, b, c, d, e, f, g, h, i] = match *self.crosstalk.as_slice() {
            [] => return Ok(None),
            [a, b, c, d, e, f, g, h, i] => [a, b, c, d, e, f, g, h, i],
            _ => {
                let fault = format!("{} numbers for a matrix of 3 by 3", self.crosstalk.len());
                return refuse(fault, "give nine, a row for each camera channel");
            }
        };
        if channels == Channels::Luma {
            return refuse("gray light has no colours to mix".into(), "add --channels rgb");
        }
        let mut crosstalk = Crosstalk::new([[a, b, c], [d, e, f], [g, h, i]])?;
        crosstalk.coupled = !self.unmix;
        Ok(Some(crosstalk))
    }
}

/// Whether all channels are symmetric.
pub(super) fn is_symmetric(light: &mut Light<'_>, console: &Console) -> bool {
    light.with_channels(Part::Full, console, |channels| {
        channels.iter().all(|channel| channel.symmetry() == Symmetry::Symmetric)
    })
}

/// The direct image of each channel where it is asked for and a simulator knows it; a rig measures it.
pub(super) fn direct(
    options: &CompensateOptions,
    light: &mut Light<'_>,
    console: &Console,
) -> Result<Vec<Vec<f64>>> {
    if options.precondition != Some(Precondition::Direct) || !light.is_simulated() {
        return Ok(Vec::new());
    }
    light.with_channels(Part::Direct, console, |channels| {
        let white = |channel: &mut dyn Operator| {
            let mut photo = vec![0.0; channel.rows()];
            channel.apply(&vec![1.0; channel.cols()], &mut photo)?;
            Ok(photo)
        };
        channels.iter_mut().map(|channel| white(channel)).collect()
    })
}

/// The direct image that the scene's shape predicts, where it is asked for and there is a scene.
pub(super) fn geometry(options: &CompensateOptions, source: &mut Source) -> Vec<f64> {
    if options.precondition != Some(Precondition::Geometry) {
        return Vec::new();
    }
    let resolution = source.resolution();
    // Without a scene the solver says that its shape is not known.
    source.simulation().map_or(Vec::new(), |simulation| predicted_direct(&simulation.scene, resolution))
}
