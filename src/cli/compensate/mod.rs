//! `krylux compensate`: what to project, so that the scene looks like a target.

mod model;
mod question;

use std::path::PathBuf;

use serde_json::{Value, json};

use super::Outcome;
use super::console::Console;
use super::opening::{Ending, Opening, finish, in_run, merge};
use super::operator::OperatorArgs;
use super::options::{self, ChannelsArg, CheckArgs, RunArgs, SourceArgs, number};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::analysis::{
    Clamping, CompensateOptions, Compensation, CompensationRow, Crosstalk, MethodRun, Similarity,
};
use crate::error::{Error, Result};
use crate::finding::decimal;
use crate::image::Image;
use crate::io;
use crate::lab::{ColorMixing, CompensateRequest, Compensated, Lab};
use crate::paint::page::Kept;
use crate::transport::Channels;
pub(super) use question::Question;

/// Find what to project so that the scene looks like a target image
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux compensate scene.glb --target target.png -o out/compensated")]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    question: Question,
    /// The radiance that 1 in the target stands for, in W/(m² sr), or in DN/s on a rig [default: half the median of the white photo]
    #[arg(long, value_name = "L", value_parser = number::<f64>)]
    peak: Option<f64>,
    /// The folder of a run on this source, of `krylux relight` or of any verb that keeps its photos: a model of the light answers, and
    /// --photos only correct it. A run of `krylux relight`, given as SOURCE itself, answers without any photo
    #[arg(long, value_name = "FOLDER")]
    model: Option<PathBuf>,
    #[command(flatten)]
    trace: TraceArgs,
    /// One gray system, or red, green and blue as three
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    #[command(flatten)]
    colors: ColorArgs,
    /// Give every method as many photos, and show them all on one plot
    #[arg(long)]
    compare_methods: bool,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    check: CheckArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
}

/// How colours of projector and camera belong together.
#[derive(clap::Args)]
struct ColorArgs {
    /// What each camera channel sees of each projector colour, row by row: nine numbers, or `measure`: from three photos more, of
    /// red, green and blue. The light is mixed so, and all three colours are solved as one system
    #[arg(long, value_name = "measure|M11,M12,...", value_parser = colors)]
    crosstalk: Option<Colors>,
    /// Solve each channel by itself and un-mix the colours afterwards
    #[arg(long, requires = "crosstalk")]
    unmix: bool,
}

/// A mixing matrix on the command line.
#[derive(Clone, Copy, Debug)]
enum Colors {
    Measure,
    Matrix([[f64; 3]; 3]),
}

fn colors(text: &str) -> std::result::Result<Colors, String> {
    if text == "measure" {
        return Ok(Colors::Measure);
    }
    let numbers: Vec<f64> = text
        .split(',')
        .map(|number| {
            options::number(number.trim())
                .map_err(|_| format!("`{number}` is no number; give nine, or `measure`"))
        })
        .collect::<std::result::Result<_, String>>()?;
    let rows: Vec<[f64; 3]> = numbers.chunks(3).filter_map(|row| row.try_into().ok()).collect();
    match <[[f64; 3]; 3]>::try_from(rows) {
        Ok(matrix) if numbers.len() == 9 => Ok(Colors::Matrix(matrix)),
        _ => Err(format!(
            "{} numbers for a matrix of 3 by 3; give nine, a row for each camera channel",
            numbers.len()
        )),
    }
}

impl ColorArgs {
    /// How colours mix, after what is wrong with it has been refused.
    fn mixing(&self, channels: Channels) -> Result<Option<ColorMixing>> {
        let matrix = match self.crosstalk {
            None => return Ok(None),
            Some(_) if channels == Channels::Luma => {
                return Err(Error::Option {
                    option: "--crosstalk".into(),
                    fault: "gray light has no colours to mix".into(),
                    help: "add --channels rgb".into(),
                });
            }
            Some(Colors::Matrix(matrix)) => {
                Crosstalk::new(matrix)?;
                Some(matrix)
            }
            Some(Colors::Measure) => None,
        };
        Ok(Some(ColorMixing { matrix, unmix: self.unmix }))
    }
}

impl Args {
    /// `baseline` is a comparison with another method, which costs nothing where photos are products. `photos_of_run` is the default budget
    /// of a run that is asked again.
    fn options(&self, baseline: bool, symmetric: bool, photos_of_run: Option<usize>) -> CompensateOptions {
        CompensateOptions { peak: self.peak, baseline, ..self.question.options_on(symmetric, photos_of_run) }
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    if args.model.is_some() || io::model::is_in(&args.source.source) {
        return model::run(args, console);
    }
    // Wrong options and files should show before anything is written or traced.
    args.options(true, true, None).check()?;
    let channels = args.channels.into();
    let colors = args.colors.mixing(channels)?;
    let opening = Opening::new(&args.source, &args.trace).operator(&args.operator).channels(channels);
    let mut lab = opening.open_shown(&args.live, console)?;
    let target = args.question.target(lab.resolution(), channels)?;
    in_run(&mut lab, &args.run, "compensate", |lab| answer(args, target, colors, lab, console))
}

fn answer(
    args: &Args,
    target: Image,
    colors: Option<ColorMixing>,
    lab: &mut Lab,
    console: &Console,
) -> Result<Outcome> {
    let symmetric = colors.is_none() && lab.is_symmetric()?;
    let options = args.options(lab.is_simulated()?, symmetric, lab.photos_of_run());
    let request = CompensateRequest { target, options, colors, compare_methods: args.compare_methods };
    let found = lab.compensate(&request)?;
    let answer = Compensated { methods: &found.methods, ..Compensated::new(&found.found, &request.options) };
    conclude(args, &answer, lab, console)
}

/// Says what was found, and writes it.
fn conclude(args: &Args, answer: &Compensated<'_>, lab: &mut Lab, console: &Console) -> Result<Outcome> {
    console.go_on()?;
    say(answer, console)?;
    // Where the colours of projector and camera mix, the photo is not the sum of what single channels see.
    let is_checked = args.check.is_on() && args.colors.crosstalk.is_none();
    let verified = if is_checked { lab.verify_compensation(answer.found)? } else { None };
    if let Some(verified) = &verified {
        console.say(format_args!(
            "          {} of the target by independent light",
            decimal(verified.residual, 4)
        ))?;
    }
    let checked = verified.as_ref().map(|verified| (&verified.photo, &verified.standard_error));
    let answer = &Compensated { checked, ..*answer };
    if let Some(run) = lab.run() {
        console.say(format_args!("project   {}", run.path.join("compensation.npy").display()))?;
    }
    let mut summary = summary(answer);
    merge(
        &mut summary,
        json!({ "residual_by_independent_light": verified.as_ref().map(|verified| verified.residual) }),
    );
    let ending = Ending { run: &args.run, demands: Vec::new(), summary, kept: Kept::default() };
    Ok(finish(lab, console, answer, ending)?.1)
}

fn say(answer: &Compensated<'_>, console: &Console) -> Result<()> {
    let found = answer.found;
    let method = answer.options.method.facts().name;
    console.say(format_args!(
        "photos    {} by {method}, {} before: {}",
        found.photos, found.preparation, found.status
    ))?;
    console.say(format_args!(
        "residual  {} of the target; {} uncompensated",
        decimal(found.residual, 4),
        decimal(found.uncompensated_residual, 4)
    ))?;
    if let Some(row) = found.baseline.last() {
        console.say(format_args!(
            "baseline  {} by projected Jacobi with as many photos (not counted)",
            decimal(row.residual, 4)
        ))?;
    }
    if found.unclipped.is_some() {
        console.say(format_args!(
            "clipped   the answer leaves what can be projected; before clipping its residual was {}",
            decimal(found.unclipped_residual, 4)
        ))?;
    }
    let ssim = |of: &Similarity| of.ssim.map_or("–".into(), |ssim| format!("{ssim:.4}"));
    console.say(format_args!(
        "similar   PSNR {:.2} dB and SSIM {}; uncompensated {:.2} dB and {}",
        found.similarity.psnr,
        ssim(&found.similarity),
        found.uncompensated_similarity.psnr,
        ssim(&found.uncompensated_similarity)
    ))?;
    for run in answer.methods {
        let own = run.history.last().map_or(f64::NAN, |row| row.residual);
        let frames = run.frames.last().map_or(String::new(), |frames| format!(", {frames:>4} frames"));
        console.say(format_args!(
            "method    {:<14} {:>3} photos{frames}: seen {}, before clipping {}",
            run.name,
            run.photos,
            decimal(run.residual, 4),
            decimal(own, 4)
        ))?;
    }
    if let Some(warning) = found.clamping.as_ref().and_then(Clamping::warning) {
        console.note(format_args!("warning: {warning}"));
    } else if found.good && found.is_needless() {
        console
            .say("          the target itself, projected, is seen as well: there is nothing to compensate")?;
    }
    Ok(())
}

/// The residual after each photo.
fn residuals(rows: &[CompensationRow]) -> Vec<f64> {
    rows.iter().map(|row| row.residual).collect()
}

fn summary(answer: &Compensated<'_>) -> Value {
    let found: &Compensation = answer.found;
    let method = |run: &MethodRun| {
        json!({
            "method": run.name,
            "photos": run.photos,
            "frames": run.frames,
            "relative_residual": run.residual,
            "ssim": run.ssim,
            "residuals": residuals(&run.history),
            "residuals_displayed": residuals(&run.displayed),
        })
    };
    json!({
        "method": answer.options.method.facts().name,
        "photos": found.photos,
        "photos_before": found.preparation,
        "status": found.status.to_string(),
        "peak": found.peak,
        "relative_residual": found.residual,
        "relative_residual_unclipped": found.unclipped_residual,
        "relative_residual_uncompensated": found.uncompensated_residual,
        "relative_residual_jacobi": found.baseline.last().map(|row| row.residual),
        "clipped": found.unclipped.is_some(),
        "likeness": found.similarity,
        "likeness_uncompensated": found.uncompensated_similarity,
        "clamping": found.clamping.as_ref().map(|clamping| json!({
            "relative_residual_displayed": residuals(&clamping.displayed),
            "relative_residual_krylov_box": residuals(&clamping.boxed),
            "warning": clamping.warning(),
        })),
        "residuals": residuals(&found.history),
        "methods": answer.methods.iter().map(method).collect::<Vec<_>>(),
    })
}
