//! `krylux relight`: low-rank light transport from one capture, and what it answers at no further photo.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::{Ending, Opening, finish, in_run};
use super::operator::OperatorArgs;
use super::options::{ChannelsArg, CheckArgs, RunArgs, SourceArgs, count, number};
use super::pattern::Pattern;
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::analysis::planes::Planes;
use crate::error::{Error, Result};
use crate::finding::Ratio;
use crate::image::{Image, LUMINANCE, Resolution};
use crate::io::picture;
use crate::lab::{
    BLOCK, ChannelChoice, Lab, Questions, RelightRequest, Relighting, SourceKind,
    text::{decimal, percent},
};
use crate::paint::page::Kept;

/// Capture light transport in a few dozen photos, and relight the scene with any pattern
///
/// The run's folder keeps the model. Given as SOURCE, it relights with other patterns without any photo, and without a
/// graphics device. So does the folder of a `segment`, `eigs` or `compensate` run: a model is made of the photos in its journal
/// (a rough one of `eigs` without `--part global`, whose photos go to direct light).
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  krylux relight scene.glb --channels rgb --pattern checker:16 -o out/box\n  krylux relight out/box --pattern left     # no further photo"
)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// One gray system, or red, green and blue as three [default: luma, or what the model has]
    #[arg(long, value_enum)]
    channels: Option<ChannelsArg>,
    /// Photos of the capture [default: 40, or the budget of the run that is SOURCE]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    photos: Option<usize>,
    /// Patterns of the capture that are chosen beforehand, white and smooth random ones; the others are photos projected back. 1 is
    /// white alone, as for rigs that are not coaxial [default: 12]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    block: Option<usize>,
    /// Relight with it: white, black, left, checker:N, stripes:N, pixel:X,Y, or a .npy, .exr or .png file; may be given several
    /// times [default: white]
    #[arg(long = "pattern", value_name = "PATTERN")]
    patterns: Vec<Pattern>,
    /// Light the scene from the camera by each pattern, as the projector would see it
    #[arg(long)]
    dual: bool,
    /// Take the interreflections out of this photo: a .npy, .exr or .png file of radiance; may be given several times
    #[arg(long = "inverse", value_name = "PHOTO")]
    photographs: Vec<PathBuf>,
    /// Exit status 1 if a relit photo differs from the true one by more than this share of it (scenes only)
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    max_error: Option<f64>,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    check: CheckArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
}

impl Args {
    /// Refuses what a source cannot answer.
    fn check(&self, kind: SourceKind) -> Result<()> {
        if let (SourceKind::Rig, Some(_)) = (kind, self.max_error) {
            return Err(Error::Option {
                option: "--max-error".into(),
                fault: "a rig does not know the true photos of patterns that it never showed".into(),
                help: "leave it out, or give a scene".into(),
            });
        }
        let given = [
            (self.photos.is_some(), "--photos"),
            (self.block.is_some(), "--block"),
            (self.channels.is_some(), "--channels"),
            (self.max_error.is_some(), "--max-error"),
        ];
        match given.into_iter().find(|(is_given, _)| *is_given && kind == SourceKind::Run) {
            Some((_, option)) => Err(Error::Option {
                option: option.into(),
                fault: format!(
                    "{} holds a model that is captured already, and no scene to compare it with",
                    self.source.source.display()
                ),
                help: "leave it out, or give the scene or the rig".into(),
            }),
            None => Ok(()),
        }
    }

    /// What the model is asked. `channels` is that of the model.
    fn questions(&self, lab: &Lab) -> Result<Questions> {
        let [projector, camera] = [lab.projector_resolution(), lab.resolution()];
        let channels = lab.channels().count();
        let photographs = self.photographs.iter().map(|path| photograph(path, camera, channels));
        Ok(Questions {
            patterns: self.patterns(projector, channels)?,
            duals: if self.dual { self.patterns(camera, channels)? } else { Vec::new() },
            photographs: photographs.collect::<Result<_>>()?,
        })
    }

    /// The patterns by name, white where none is given.
    fn patterns(&self, resolution: Resolution, channels: usize) -> Result<Vec<(String, Image)>> {
        let white = [Pattern::White];
        let patterns = if self.patterns.is_empty() { &white[..] } else { &self.patterns };
        let named = |pattern: &Pattern| {
            let (name, image) = (pattern.to_string(), pattern.image(resolution)?);
            if image.channels() > channels {
                return Err(Error::Option {
                    option: "--pattern".into(),
                    fault: format!("{name} is coloured, but the model is gray"),
                    help: "give a gray pattern, or capture with --channels rgb".into(),
                });
            }
            Ok((name, image))
        };
        patterns.iter().map(named).collect()
    }
}

/// A photo to be reduced, by name, in as many channels as the model has. A coloured photo is weighted by luminance for a gray model.
fn photograph(path: &Path, camera: Resolution, channels: usize) -> Result<(String, Planes)> {
    let image = picture::read_sized(path, camera, "the camera")?;
    let unusable =
        |fault: String, help: &str| Err(Error::Data { path: path.to_path_buf(), fault, help: help.into() });
    let planes = match (image.channels(), channels) {
        (3, 1) => {
            let [r, g, b] = [0, 1, 2].map(|channel| image.plane(channel));
            let [red, green, blue] = LUMINANCE;
            vec![(0..r.len()).map(|i| red * r[i] + green * g[i] + blue * b[i]).collect()]
        }
        (1, 3) => {
            let fault = "it is gray, but the model has three channels".into();
            return unusable(fault, "give a coloured photo, or capture with --channels luma");
        }
        _ => image.planes(),
    };
    Ok((path.display().to_string(), planes))
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let kind = SourceKind::of(&args.source.source);
    args.check(kind)?;
    let channels = match (args.channels, kind) {
        (Some(channels), _) => channels.into(),
        (None, SourceKind::Run) => ChannelChoice::Native,
        (None, _) => ChannelChoice::Luma,
    };
    let opening = Opening::new(&args.source, &args.trace).operator(&args.operator).channels(channels);
    let mut lab = opening.open_shown(&args.live, console)?;
    // What is wrong with a file should show before anything is traced.
    let questions = args.questions(&lab)?;
    if lab.has_model() {
        return in_run(&mut lab, &args.run, "relight", |lab| {
            let found = lab.relight_run(&questions)?;
            conclude(args, &found, lab, console)
        });
    }
    let request = RelightRequest {
        photos: args.photos.or(lab.photos_of_run()).unwrap_or(40),
        block: args.block.unwrap_or(BLOCK),
        questions,
        max_error: args.max_error,
    };
    in_run(&mut lab, &args.run, "relight", |lab| {
        let found = lab.relight(&request)?;
        conclude(args, &found, lab, console)
    })
}

fn conclude(args: &Args, found: &Relighting, lab: &mut Lab, console: &Console) -> Result<Outcome> {
    console.go_on()?;
    say(found, console)?;
    if args.check.is_on() {
        lab.verify_relighting(found)?;
    }
    let summary = json!({
        "photos": found.photos,
        "rank": found.model.rank(),
        "relit": found.relit.iter().map(|relit| json!({
            "pattern": relit.name,
            "relative_error": relit.errors.last(),
            "stated_error": relit.stated,
        })).collect::<Vec<_>>(),
        "dual": found.duals.iter().map(|dual| json!({
            "pattern": dual.name,
            "relative_error": dual.error,
        })).collect::<Vec<_>>(),
        "inverse": found.reduced.iter().map(|reduced| json!({
            "photo": reduced.name,
            "residual": reduced.residual,
            "relative_error": reduced.error,
        })).collect::<Vec<_>>(),
        "matrix": found.curve.last(),
    });
    let ending = Ending { run: &args.run, demands: Vec::new(), summary, kept: Kept::default() };
    let (_, outcome) = finish(lab, console, found, ending)?;
    if let (Outcome::NotGoodEnough, Some(worst), Some(most)) = (outcome, found.worst(), args.max_error) {
        console.note(format_args!("the error of a relit photo, {}, is above {most}", decimal(worst, 5)));
    }
    Ok(outcome)
}

fn say(found: &Relighting, console: &Console) -> Result<()> {
    console.say(format_args!("photos    {}; the model has rank {}", found.photos, found.model.rank()))?;
    for relit in &found.relit {
        match relit.errors.last() {
            Some(error) => {
                console.say(format_args!(
                    "relit     {}: within {} % of independent light; the photos leave about {} % open",
                    relit.name,
                    percent(*error),
                    percent(relit.stated)
                ))?;
            }
            None => console.say(format_args!(
                "relit     {}: about {} % off, by what the photos leave open",
                relit.name,
                percent(relit.stated)
            ))?,
        }
    }
    for reduced in &found.reduced {
        let error = reduced.error.map(|error| format!(", within {} %", percent(error))).unwrap_or_default();
        console.say(format_args!("direct    of {}{error}", reduced.name))?;
    }
    let Some(row) = found.curve.last() else { return Ok(()) };
    let optimal = row.optimal.map(|optimal| {
        let of = Ratio::of(row.error, optimal, 0.0);
        format!("; the best of rank {} {} %, of which it is {of}", row.photos, percent(optimal))
    });
    console.say(format_args!("matrix    within {} %{}", percent(row.error), optimal.unwrap_or_default()))
}
