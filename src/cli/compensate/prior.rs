//! What is known beside the photos: direct light and shape of a simulated scene, crosstalk of colours.

use crate::analysis::{CompensateOptions, Crosstalk, Precondition};
use crate::cli::console::Console;
use crate::cli::light::Light;
use crate::cli::source::Source;
use crate::error::{Error, Result};
use crate::operator::{Operator, Symmetry};
use crate::scene::predicted_direct;
use crate::transport::{Channels, Part};

/// A mixing matrix on the command line.
#[derive(Clone, Copy, Debug)]
pub(super) enum Colors {
    Measure,
    Given([[f64; 3]; 3]),
}

fn colors(text: &str) -> std::result::Result<Colors, String> {
    if text == "measure" {
        return Ok(Colors::Measure);
    }
    let numbers: Vec<f64> = text
        .split(',')
        .map(|number| {
            number.trim().parse().map_err(|_| format!("`{number}` is no number; give nine, or `measure`"))
        })
        .collect::<std::result::Result<_, String>>()?;
    let rows: Vec<[f64; 3]> = numbers.chunks(3).filter_map(|row| row.try_into().ok()).collect();
    match <[[f64; 3]; 3]>::try_from(rows) {
        Ok(matrix) if numbers.len() == 9 => Ok(Colors::Given(matrix)),
        _ => Err(format!(
            "{} numbers for a matrix of 3 by 3; give nine, a row for each camera channel",
            numbers.len()
        )),
    }
}

/// How colours of projector and camera belong together.
#[derive(clap::Args)]
pub(super) struct ColorArgs {
    /// What each camera channel sees of each projector colour, row by row: nine numbers, or `measure`: told from three photos more, of
    /// red, green and blue. The light is mixed so, and all three colours are solved as one system
    #[arg(long, value_name = "measure|M11,M12,...", value_parser = colors)]
    crosstalk: Option<Colors>,
    /// Solve each channel by itself and un-mix the colours afterwards
    #[arg(long, requires = "crosstalk")]
    unmix: bool,
}

impl ColorArgs {
    /// Refuses what can be told to be wrong before anything is traced; a given matrix comes back.
    pub(super) fn check(&self, channels: Channels) -> Result<()> {
        match self.crosstalk {
            None => Ok(()),
            Some(_) if channels == Channels::Luma => Err(Error::Option {
                option: "--crosstalk".into(),
                fault: "gray light has no colours to mix".into(),
                help: "add --channels rgb".into(),
            }),
            Some(Colors::Given(matrix)) => Crosstalk::new(matrix).map(drop),
            Some(Colors::Measure) => Ok(()),
        }
    }

    /// The mixing matrix, if there is one, and the photos that it took to learn it.
    pub(super) fn crosstalk(
        &self,
        light: &mut Light<'_>,
        console: &Console,
    ) -> anyhow::Result<(Option<Crosstalk>, usize)> {
        let (mut crosstalk, photos) = match self.crosstalk {
            None => return Ok((None, 0)),
            Some(Colors::Given(matrix)) => (Crosstalk::new(matrix)?, 0),
            Some(Colors::Measure) => {
                let photos = light.primaries(console)?;
                (Crosstalk::measured(&photos)?, photos.len())
            }
        };
        if photos > 0 {
            let row = |row: &[f64; 3]| row.map(|entry| format!("{entry:.4}")).join(" ");
            console.say(format_args!(
                "crosstalk {} (red, green and blue, in each camera channel's own)",
                crosstalk.matrix().each_ref().map(row).join(" | ")
            ))?;
        }
        if !light.is_simulated() {
            // A rig's products are measured by gray patterns.
            crosstalk = crosstalk.relative_to_white()?;
        }
        crosstalk.coupled = !self.unmix;
        Ok((Some(crosstalk), photos))
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
