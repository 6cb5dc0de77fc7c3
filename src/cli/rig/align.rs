//! `krylux rig align`: are projector and camera at one point, and which way must the camera go?

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::super::Outcome;
use super::super::console::Console;
use super::super::options::{count, free_file, number, time};
use super::super::tev::LiveArgs;
use super::bench::{Bench, RigArgs};
use crate::bench::align::{AlignOptions, Alignment, Round, align};
use crate::calibrate::{MeasuredValue, StructuredLight};
use crate::error::{Error, Result};
use crate::finding::decimal;
use crate::io::atomic;
use crate::io::name::Name;
use crate::io::raster::Raster;
use crate::measure::FrameSource;
use crate::report::alignment;
use crate::report::viewer::{Plane, Viewer};

/// Bring camera and projector to one point: shadows, disparity, symmetry, and which way the camera must go;
/// round by round, until Ctrl-C
///
/// Hang a small thing before a flat background: what stands out from the map that the larger part of the
/// scene agrees on is taken for nearer. Directions are those of the photo. A flat scene tells nothing. Exit
/// status 1: the last round is not aligned.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  krylux rig align rig.toml\n  krylux rig align rig.toml --rounds 1 -o align.png"
)]
pub(in super::super) struct Args {
    #[command(flatten)]
    rig: RigArgs,
    /// Rounds of structured light; 0: until Ctrl-C
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count::<u64>)]
    rounds: u64,
    /// Random patterns of each round, by whose pairs symmetry is judged; 0: not at all, which is quicker
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = count::<usize>)]
    patterns: usize,
    /// Asymmetry |A − Aᵀ|/|A| that passes
    #[arg(long, value_name = "X", default_value_t = 0.1, value_parser = number::<f64>)]
    asymmetry: f64,
    /// Seconds of each exposure [default: the longest of the rig file's, or what white fills 70 % of the
    /// camera's range in]
    #[arg(long, value_name = "SECONDS", value_parser = time)]
    exposure: Option<f64>,
    /// Where the picture goes: shadows red, what is dark for whatever reason violet, arrows where something
    /// is displaced to; it is there as a whole at any moment
    /// [default: align.png, or the first free one of align-2.png, align-3.png, …]
    #[arg(short = 'o', long = "output", value_name = "FILE.png", value_parser = super::png)]
    file: Option<PathBuf>,
    #[command(flatten)]
    live: LiveArgs,
}

/// What the last whole round said.
#[derive(Default)]
struct Last {
    rounds: u64,
    round: Option<Round>,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let file = args.file.clone().unwrap_or_else(|| free_file("align", "png"));
    atomic::check_writable(&file)?;
    let options =
        AlignOptions { patterns: args.patterns, asymmetry: args.asymmetry, ..AlignOptions::default() };
    let mut bench = args.rig.read(console)?;
    let mut shots = bench.open(console)?;
    let mut last = Last::default();
    let ended = rounds((args, &file), &options, (&bench, shots.as_mut()), console, &mut last);
    drop(shots);
    match ended {
        // Ctrl-C is how one stops aligning.
        Err(error) if !matches!(error, Error::Interrupted) => return Err(error),
        _ => {}
    }
    let Some(round) = &last.round else { return Err(Error::Interrupted) };
    let is_aligned = matches!(round, Round::Found(found) if found.is_aligned(&options));
    if matches!(round, Round::Found(_)) {
        console.say(format_args!("wrote     {}", file.display()))?;
    }
    console.summary(&json!({
        "verb": "rig align",
        "file": Name::from(&file),
        "rounds": last.rounds,
        "aligned": is_aligned,
        "last": describe(round),
    }))?;
    Ok(if is_aligned { Outcome::Done } else { Outcome::NotGoodEnough })
}

fn rounds(
    (args, file): (&Args, &Path),
    options: &AlignOptions,
    (bench, shots): (&Bench, &mut dyn FrameSource),
    console: &Console,
    last: &mut Last,
) -> Result<()> {
    let viewer = args.live.viewer(console);
    let known = bench.known.as_ref().map(|known| &known.camera);
    let mut observer = StructuredLight::new(shots, known, bench.exposure(args.exposure))?;
    console.detail(format_args!(
        "exposures of {} s, {} s after each frame",
        decimal(observer.exposure(), 4),
        decimal(bench.settle(), 4)
    ));
    while args.rounds == 0 || last.rounds < args.rounds {
        let round = align(&mut observer, options)?;
        last.rounds += 1;
        say(last.rounds, &round, options, console)?;
        if let Round::Found(found) = &round {
            let picture = alignment::picture(found, found.least());
            picture.write_png(file)?;
            if let Some(viewer) = &viewer {
                show(viewer, &bench.name(), &picture);
            }
        }
        last.round = Some(round);
    }
    Ok(())
}

fn say(number: u64, round: &Round, options: &AlignOptions, console: &Console) -> Result<()> {
    let found = match round {
        Round::Found(found) => found,
        Round::Lost { fault, help } => {
            return console.say(format_args!("round     {number}: {fault}; {help}"));
        }
    };
    let disparity = &found.disparity;
    let symmetry = found.symmetry.as_ref().and_then(|check| Some((check.value?, check.error?)));
    let symmetry =
        symmetry.map_or_else(String::new, |(value, error)| format!(", asymmetry {value:.3} ± {error:.3}"));
    // Something black, or a shadow that no light falls into.
    let dark = match found.dark {
        dark if dark < 5e-4 => String::new(),
        dark => format!(", nothing seen in {:.1} %", 100.0 * dark),
    };
    console.say(format_args!(
        "round     {number}: disparity median {:.3}, 95 % {:.3} pixels (each ± {:.3}), shadow {:.1} %{dark}{symmetry}",
        disparity.median,
        disparity.upper,
        disparity.error,
        100.0 * found.shadow,
    ))?;
    console.say(format_args!("          {}", sentence(found, options)))
}

/// What to do.
fn sentence(found: &Alignment, options: &AlignOptions) -> String {
    match &found.stand {
        Some(stand) if stand.is_certain => format!(
            "the camera stands {}, by what is displaced by {} pixels in {:.0} % of the field: move it {}",
            stand.place(),
            MeasuredValue::new(stand.size, stand.error),
            100.0 * stand.share,
            stand.remedy()
        ),
        Some(stand) => format!(
            "the camera stands {}, or on the other side: {:.0} % of the field is displaced by {} pixels, but as much one \
             way as the other; hang a small thing before a flat background",
            stand.place(),
            100.0 * stand.share,
            MeasuredValue::new(stand.size, stand.error)
        ),
        None if found.is_aligned(options) => {
            "aligned, as far as the scene has depth: nothing stands out from one map, and nothing is in shadow".into()
        }
        None => "one map fits all that is seen; what is in shadow or not symmetric is not told by codes: look at the picture, and \
                 ask `krylux audit`"
            .into(),
    }
}

fn describe(round: &Round) -> Value {
    let found = match round {
        Round::Found(found) => found,
        Round::Lost { fault, help } => return json!({ "fault": fault, "help": help }),
    };
    let disparity = &found.disparity;
    json!({
        "disparity": { "median": disparity.median, "upper": disparity.upper, "error": disparity.error },
        "stand": found.stand,
        "place": found.stand.map(|stand| stand.place()),
        "remedy": found.stand.filter(|stand| stand.is_certain).map(|stand| stand.remedy()),
        "shadow": found.shadow,
        "dark": found.dark,
        "symmetry": found.symmetry,
    })
}

/// The picture as it is in the file.
fn show(viewer: &Viewer, name: &str, picture: &Raster) {
    for channel in 0..3 {
        let bytes = picture.bytes().iter().skip(channel).step_by(3);
        viewer.show(Plane {
            name: format!("{name} align"),
            size: picture.resolution(),
            channels: &["R", "G", "B"],
            channel,
            values: bytes.map(|&byte| crate::io::raster::decode_srgb(f32::from(byte) / 255.0)).collect(),
        });
    }
}
