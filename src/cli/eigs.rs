//! `krylux eigs`: eigenvalues and eigenvectors, of a scene's light transport or of a matrix from a file.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::ValueEnum;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::live::{Live, LiveArgs};
use super::matrix::PartArg;
use super::operator::OperatorArgs;
use super::options::{OutputArgs, RunArgs, SourceArgs, ViewArgs};
use super::run_folder::RunFolder;
use super::source::Source;
use super::trace::TraceArgs;
use crate::image::Resolution;
use crate::io::sparse;
use crate::krylov::{Eigs, EigsMethod, EigsOptions, PairStatus, Start, Which, eigs};
use crate::observer::{OnStep, Step};
use crate::operator::Observed;
use crate::report::contact_sheet::ContactSheet;
use crate::report::eigenpairs::EigenpairsRun;
use crate::sparse::SparseOperator;
use crate::transport::{Channels, Part};

/// Compute eigenvalues and eigenvectors of a scene's light transport matrix, or of a matrix from a file
#[derive(clap::Args)]
pub(super) struct Args {
    /// A scene (.glb, .gltf, .obj), a rig (.toml), the folder of a run on a rig, or a matrix (.npz of SciPy, .mtx, or a
    /// dense .npy)
    #[arg(value_name = "SOURCE|MATRIX")]
    source: PathBuf,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    question: Question,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

/// What is asked, of whatever source.
#[derive(clap::Args)]
pub(super) struct Question {
    /// Which light of a scene or rig
    #[arg(long, value_enum, default_value = "full")]
    part: PartArg,
    /// How they are found
    #[arg(long, value_enum, default_value = "lanczos")]
    method: MethodArg,
    /// Vectors in the block of block-lanczos: as many copies of a repeated eigenvalue are found
    #[arg(long, value_name = "N", default_value_t = 2)]
    block: usize,
    /// How many eigenpairs
    #[arg(long, value_name = "N", default_value_t = 6)]
    count: usize,
    /// At which end of the spectrum
    #[arg(long, value_enum, default_value = "la")]
    which: WhichArg,
    /// Photos (products with the matrix) to take at most [default: 50, or as many as the run that is SOURCE might take]
    #[arg(long, value_name = "N")]
    photos: Option<usize>,
    /// Done when each residual norm is at most this share of the matrix norm
    #[arg(long, value_name = "X", default_value_t = 1e-8)]
    tolerance: f64,
}

#[derive(Clone, Copy, ValueEnum)]
enum MethodArg {
    /// The paper's Algorithm 1: one pair, of largest magnitude
    Power,
    /// Symmetric matrices: the best in nearly all cases
    Lanczos,
    /// Symmetric matrices with repeated eigenvalues
    BlockLanczos,
    /// Any square matrix: complex pairs
    Arnoldi,
}

#[derive(Clone, Copy, ValueEnum)]
enum WhichArg {
    /// Largest (largest real part)
    La,
    /// Smallest (smallest real part)
    Sa,
    /// Largest magnitude
    Lm,
    /// Smallest magnitude
    Sm,
    /// Both ends in turn
    Be,
    /// Largest imaginary part
    Li,
}

impl Question {
    /// As the library has it; `seed` for the starting vector, `held` the photos of a run that is asked anew.
    pub(super) fn options(&self, seed: u64, held: Option<usize>) -> EigsOptions {
        EigsOptions {
            count: self.count,
            which: match self.which {
                WhichArg::La => Which::LargestAlgebraic,
                WhichArg::Sa => Which::SmallestAlgebraic,
                WhichArg::Lm => Which::LargestMagnitude,
                WhichArg::Sm => Which::SmallestMagnitude,
                WhichArg::Be => Which::BothEnds,
                WhichArg::Li => Which::LargestImaginary,
            },
            products: self.photos.or(held).unwrap_or(50),
            tolerance: self.tolerance,
            method: match self.method {
                MethodArg::Power => EigsMethod::Power,
                MethodArg::Lanczos => EigsMethod::Lanczos,
                MethodArg::BlockLanczos => EigsMethod::BlockLanczos { block: self.block },
                MethodArg::Arnoldi => EigsMethod::Arnoldi,
            },
            start: Start::Rademacher { seed },
            ..EigsOptions::default()
        }
    }

    /// Which light.
    pub(super) fn part(&self) -> Part {
        self.part.into()
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    if is_matrix(&args.source) {
        let mut operator = SparseOperator::new(sparse::read(&args.source)?);
        let stem = args.source.file_stem().unwrap_or_default().to_string_lossy();
        let mut folder = RunFolder::create(&args.run, &format!("{stem}-eigs"), console)?;
        folder.manifest.seed = Some(args.trace.seed());
        let outcome = folder
            .describe_file(&args.source)
            .map_err(Into::into)
            .and_then(|()| {
                let bar = console.photos();
                let options = args.question.options(args.trace.seed(), None);
                let observer = OnStep::new(|step: &Step<'_>| {
                    bar.say(&step.estimate.to_string());
                    bar.at(step.done, step.total)
                });
                let mut operator = Observed::new(&mut operator, &observer);
                Ok(folder.timed("photos", |_| eigs(&mut operator, &options))?)
            })
            .and_then(|found| {
                interrupted(console)?;
                report(args, console, &found, &stem, None, &mut folder)
            });
        return folder.close(outcome);
    }
    let source = SourceArgs { source: args.source.clone(), view: args.view.clone() };
    let mut source = Source::open(&source, &args.trace, console)?;
    let (name, resolution, unit) = (source.name(), source.resolution(), source.unit());
    let mut folder = RunFolder::create(&args.run, &format!("{name}-eigs"), console)?;
    source.describe(&mut folder.manifest, Channels::Luma);
    let options = args.question.options(args.trace.seed(), source.held());
    folder.manifest.photos_allowed = Some(options.products);
    let live = Live::new(&args.live, &source, Channels::Luma, console);
    let light = folder.timed(source.preparation(), |folder| {
        source.light(&args.operator, Channels::Luma, Some(folder), console)
    });
    let outcome = light.and_then(|mut light| {
        folder.describe_light(&light);
        live.expect(options.products);
        let found = folder.timed("photos", |_| {
            light.with_operator(args.question.part(), console, |operator| {
                let observer = OnStep::new(|step: &Step<'_>| live.so_far(step.estimate));
                eigs(&mut Observed::new(&mut live.watch(0, operator), &observer), &options)
            })
        });
        live.pause();
        let found = folder.record_rig(&mut light, found, console)?;
        interrupted(console)?;
        report(args, console, &found, &name, Some((resolution, live.strip(), unit)), &mut folder)
    });
    folder.close(outcome)
}

fn is_matrix(source: &Path) -> bool {
    let extension = source.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    matches!(extension.as_deref(), Some("npz" | "mtx" | "npy"))
}

fn interrupted(console: &Console) -> Result<()> {
    if console.check().is_break() { Err(crate::Error::Interrupted.into()) } else { Ok(()) }
}

fn report(
    args: &Args,
    console: &Console,
    found: &Eigs,
    name: &str,
    pictures: Option<(Resolution, ContactSheet, &str)>,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    folder.manifest.photos = found.stats.products as u64;
    let verdicts: Vec<String> = found.statuses.iter().map(|verdict| word(*verdict).to_owned()).collect();
    let good = found.statuses.iter().all(|&verdict| verdict == PairStatus::Converged)
        && found.values.len() == args.question.count;
    say(found, &verdicts, console)?;
    let title = format!("{name} · eigenpairs");
    let (resolution, strip) = match &pictures {
        Some((resolution, strip, unit)) => (Some(*resolution), Some((strip, *unit))),
        None => (None, None),
    };
    let run = EigenpairsRun { title, found, resolution, verdicts: &verdicts, good, strip };
    let seconds = folder.seconds();
    folder.manifest.outputs =
        folder.timed("files", |folder| run.write(&folder.path, &folder.manifest, seconds))?;
    let report = folder.path.join("report.html");
    console.say(format_args!("report    {}", report.display()))?;
    console.summary(&json!({
        "verb": "eigs",
        "folder": folder.path,
        "report": report,
        "photos": found.stats.products,
        "status": found.stats.status.to_string(),
        "eigenvalues": found.values,
        "imaginary_parts": found.imaginary_values,
        "residuals": found.residuals,
        "bounds": found.bounds,
        "noise": folder.manifest.noise,
        "rig": folder.manifest.rig,
        "verdicts": verdicts,
        "seconds": folder.seconds(),
    }))?;
    let outcome = if good { Outcome::Done } else { Outcome::NotGoodEnough };
    Ok((outcome, format!("{} photos: {}", found.stats.products, found.stats.status)))
}

fn say(found: &Eigs, verdicts: &[String], console: &Console) -> Result<()> {
    console.say(format_args!("photos    {}: {}", found.stats.products, found.stats.status))?;
    console.say("           eigenvalue   residual   error at most")?;
    for (index, verdict) in verdicts.iter().enumerate() {
        let imaginary = match found.imaginary_values[index] {
            0.0 => String::new(),
            value => format!(" {value:+.8} i"),
        };
        console.say(format_args!(
            "  {:>6}  {:>11.8}{imaginary}   {:.1e}    {:.1e}   {verdict}",
            index + 1,
            found.values[index],
            found.residuals[index],
            found.bounds[index]
        ))?;
    }
    Ok(())
}

fn word(verdict: PairStatus) -> &'static str {
    match verdict {
        PairStatus::Converged => "converged",
        PairStatus::LimitedByNoise => "limited by noise",
        PairStatus::NotResolved => "not resolved",
    }
}
