//! The alignment of camera and projector in rounds.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::BenchRig;
use crate::bench::align::{AlignOptions, Alignment, Round, align};
use crate::calibrate::{MeasuredValue, StructuredLight};
use crate::error::Result;
use crate::finding::decimal;
use crate::lab::Log;
use crate::report::content::Content;
use crate::verbs::options::{count, number, png, time};

/// Bring camera and projector to one point: shadows, disparity, symmetry, and which way the camera must go;
/// round by round, until Ctrl-C
///
/// Hang a small thing before a flat background: what stands out from the map that the larger part of the
/// scene agrees on is taken for nearer. Directions are those of the photo. A flat scene tells nothing. Exit
/// status 1: the last round is not aligned.
#[derive(clap::Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(
    after_help = "Examples:\n  krylux rig align rig.toml\n  krylux rig align rig.toml --rounds 1 -o align.png"
)]
pub struct Align {
    /// Rounds of structured light; 0: until Ctrl-C
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count::<u64>)]
    pub rounds: u64,
    /// Random patterns of each round, by whose pairs symmetry is judged; 0: not at all, which is quicker
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = count::<usize>)]
    pub patterns: usize,
    /// Asymmetry |A − Aᵀ|/|A| that passes
    #[arg(long, value_name = "X", default_value_t = 0.1, value_parser = number::<f64>)]
    pub asymmetry: f64,
    /// Seconds of each exposure [default: the longest of the rig file's, or what white fills 70 % of the
    /// camera's range in]
    #[arg(long, value_name = "SECONDS", value_parser = time)]
    pub exposure: Option<f64>,
    /// Where the picture goes: shadows red, what is dark for whatever reason violet, arrows where something
    /// is displaced to; it is there as a whole at any moment
    /// [default: align.png, or the first free one of align-2.png, align-3.png, …]
    #[arg(short = 'o', long = "output", value_name = "FILE.png", value_parser = png)]
    pub file: Option<PathBuf>,
}

impl Align {
    fn options(&self) -> AlignOptions {
        AlignOptions { patterns: self.patterns, asymmetry: self.asymmetry, ..AlignOptions::default() }
    }

    /// Takes the rounds, and passes the number and the result of each round to `each`. Fails if the rig or `each` fails;
    /// [`Error::Interrupted`](crate::Error::Interrupted) when the observer stops the work.
    pub fn ask(&self, bench: &BenchRig, mut each: impl FnMut(u64, Round) -> Result<()>) -> Result<()> {
        let mut frames = bench.open()?;
        let known = bench.known.as_ref().map(|known| &known.camera);
        let mut light = StructuredLight::new(frames.as_mut(), known, bench.exposure(self.exposure))?;
        bench.source.observer().detail(format_args!(
            "exposures of {} s, {} s after each frame",
            decimal(light.exposure(), 4),
            decimal(bench.settle(), 4)
        ));
        let mut rounds = 0;
        while self.rounds == 0 || rounds < self.rounds {
            rounds += 1;
            each(rounds, align(&mut light, &self.options())?)?;
        }
        Ok(())
    }

    /// Whether camera and projector have the same point of view in this round.
    pub fn is_aligned(&self, round: &Round) -> bool {
        matches!(round, Round::Found(found) if found.is_aligned(&self.options()))
    }

    /// The content of round `number`.
    pub fn content<'a>(&self, number: u64, round: &'a Round) -> Content<'a> {
        let mut content = Content::default();
        content.detail("found", matches!(round, Round::Found(_)));
        let found = match round {
            Round::Found(found) => found,
            Round::Lost { fault, help } => {
                content.line(format_args!("round     {number}: {fault}; {help}"));
                content.fact("fault", fault);
                content.fact("help", help);
                return content;
            }
        };
        let disparity = &found.disparity;
        let symmetry = found.symmetry.as_ref().and_then(|check| Some((check.value?, check.error?)));
        let symmetry = symmetry
            .map_or_else(String::new, |(value, error)| format!(", asymmetry {value:.3} ± {error:.3}"));
        // A dark area is either a black object, or a shadow without any light.
        let dark = match found.dark {
            dark if dark < 5e-4 => String::new(),
            dark => format!(", nothing seen in {:.1} %", 100.0 * dark),
        };
        content.line(format_args!(
            "round     {number}: disparity median {:.3}, 95 % {:.3} pixels (each ± {:.3}), shadow {:.1} %{dark}{symmetry}",
            disparity.median,
            disparity.upper,
            disparity.error,
            100.0 * found.shadow,
        ));
        content.line(format_args!("          {}", self.advice(found)));
        let offset = found.stand;
        content.fact(
            "disparity",
            json!({ "median": disparity.median, "upper": disparity.upper, "error": disparity.error }),
        );
        content.fact("stand", offset);
        content.fact("place", offset.map(|offset| offset.place()));
        content.fact("remedy", offset.filter(|offset| offset.is_certain).map(|offset| offset.remedy()));
        content.fact("shadow", found.shadow);
        content.fact("dark", found.dark);
        content.fact("symmetry", &found.symmetry);
        content.detail("aligned", self.is_aligned(round));
        content.detail("offset", offset);
        let shape = [found.camera.height, found.camera.width];
        content.attribute("white", &shape, &found.white);
        content.attribute(
            "sights",
            &shape,
            found.sights.iter().map(|&sight| sight as u8).collect::<Vec<_>>(),
        );
        content
    }

    fn advice(&self, found: &Alignment) -> String {
        match &found.stand {
            Some(offset) if offset.is_certain => format!(
                "the camera stands {}, by what is displaced by {} pixels in {:.0} % of the field: move it {}",
                offset.place(),
                MeasuredValue::new(offset.size, offset.error),
                100.0 * offset.share,
                offset.remedy()
            ),
            Some(offset) => format!(
                "the camera stands {}, or on the other side: {:.0} % of the field is displaced by {} pixels, but as much one \
                 way as the other; hang a small thing before a flat background",
                offset.place(),
                100.0 * offset.share,
                MeasuredValue::new(offset.size, offset.error)
            ),
            None if found.is_aligned(&self.options()) => {
                "aligned, as far as the scene has depth: nothing stands out from one map, and nothing is in shadow".into()
            }
            None => "one map fits all that is seen; what is in shadow or not symmetric is not told by codes: look at the picture, and \
                     ask `krylux audit`"
                .into(),
        }
    }
}
