//! `krylux eigs`: eigenvalues and eigenvectors, of a scene's light transport or of a matrix from a file.

use clap::ValueEnum;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::matrix::PartArg;
use super::opening::{Ending, Opening, finish, in_run};
use super::operator::OperatorArgs;
use super::options::{CheckArgs, RunArgs, SourceArgs, count, number};
use super::singular;
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::error::Result;
use crate::krylov::{Completeness, Confirm, EigsMethod, EigsOptions, SingularOptions, Start, Which};
use crate::lab::text::{percent, rounded, signed, with_error};
use crate::lab::{Eigenpairs, Lab};
use crate::paint::Answer;
use crate::paint::page::Kept;
use crate::transport::Part;

/// Compute eigenvalues and eigenvectors of a scene's light transport matrix, or of a matrix from a file
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  krylux eigs scene.glb --count 6 --method block-lanczos -o out/eigs\n  krylux eigs matrix.npz --count 4 --photos 400 --tolerance 1e-6\n  krylux eigs apart.glb --singular --count 4     # camera and projector apart: patterns and their photos"
)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    question: Question,
    /// Compute singular values and vectors in place of eigenvalues: they exist for any matrix. Each step takes one photo, and one of the
    /// transpose, with camera and projector exchanged
    #[arg(long, conflicts_with_all = ["method", "block", "which"])]
    singular: bool,
    #[command(flatten)]
    check: CheckArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
}

/// What is asked, of whatever source.
#[derive(clap::Args)]
pub(super) struct Question {
    /// Which light of a scene or rig
    #[arg(long, value_enum, default_value = "full")]
    part: PartArg,
    /// The method
    #[arg(long, value_enum, default_value = "lanczos")]
    method: MethodArg,
    /// Vectors in the block of block-lanczos: as many copies of a repeated eigenvalue are found
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count::<usize>)]
    block: usize,
    /// How many eigenpairs
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = count::<usize>)]
    count: usize,
    /// At which end of the spectrum
    #[arg(long, value_enum, default_value = "la")]
    which: WhichArg,
    /// Photos (products with the matrix) to take at most [default: 50, or the budget of the run that is SOURCE]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    photos: Option<usize>,
    /// Done when each residual norm is at most this share of the matrix norm; exit with 1 if that is not reached. Without
    /// it, the photos end where they would tell no more: at 1e-8, or where the noise of the photos is larger
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    tolerance: Option<f64>,
    /// Confirm that no eigenvalue was missed that lies beyond the last one by more than this share of the spectrum's spread. On a rig it
    /// takes further photos: 28 at 128×128 pixels for 0.05, 62 for 0.01. Matrices and traced scenes, whose products cost no photo, are
    /// confirmed in any case [default there: 0.01]
    #[arg(long, value_name = "SHARE", value_parser = number::<f64>)]
    confirm: Option<f64>,
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
    /// The library's options; `seed` for the starting vector, `photos_of_run` the default budget of a run that is asked again.
    pub(super) fn options(&self, seed: u64, photos_of_run: Option<usize>) -> EigsOptions {
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
            products: self.photos.or(photos_of_run).unwrap_or(50),
            tolerance: self.tolerance.unwrap_or(EigsOptions::default().tolerance),
            method: match self.method {
                MethodArg::Power => EigsMethod::Power,
                MethodArg::Lanczos => EigsMethod::Lanczos,
                MethodArg::BlockLanczos => EigsMethod::BlockLanczos { block: self.block },
                MethodArg::Arnoldi => EigsMethod::Arnoldi,
            },
            start: Start::Random { seed },
            confirm: self.confirm.map(|share| Confirm { share, ..Confirm::default() }),
            ..EigsOptions::default()
        }
    }

    /// The library's options for singular values.
    fn singular_options(&self, seed: u64, photos_of_run: Option<usize>) -> SingularOptions {
        let EigsOptions { count, products, tolerance, start, confirm, .. } =
            self.options(seed, photos_of_run);
        SingularOptions { count, products, tolerance, start, confirm, ..SingularOptions::default() }
    }

    /// Which light.
    pub(super) fn part(&self) -> Part {
        self.part.into()
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let opening = Opening::new(&args.source, &args.trace).operator(&args.operator);
    let mut lab = opening.open_shown(&args.live, console)?;
    if args.singular {
        let options = args.question.singular_options(lab.seed(), lab.photos_of_run());
        let asked = singular::Asked {
            part: args.question.part(),
            is_strict: args.question.tolerance.is_some(),
            options,
        };
        return in_run(&mut lab, &args.run, "eigs", |lab| singular::answer(&asked, &args.run, lab, console));
    }
    in_run(&mut lab, &args.run, "eigs", |lab| answer(args, lab, console))
}

fn answer(args: &Args, lab: &mut Lab, console: &Console) -> Result<Outcome> {
    let mut options = args.question.options(lab.seed(), lab.photos_of_run());
    if let Some(run) = lab.run() {
        run.manifest.seed = Some(args.trace.overrides().vector_seed());
    }
    if args.question.tolerance.is_none() {
        options.noise = lab.product_noise(args.question.part())?.unwrap_or(0.0);
    }
    let mut found = lab.eigs(args.question.part(), &options)?;
    console.go_on()?;
    let estimates = if args.check.is_on() {
        let verified = lab.verify_eigenpairs(args.question.part(), &found)?;
        verified.map(|verified| verified.estimates).unwrap_or_default()
    } else {
        Vec::new()
    };
    for (index, estimate) in estimates.iter().enumerate() {
        found.standard_errors[index] = estimate.error_of(found.values[index]);
    }
    let pairs = Eigenpairs { found: &found, wanted: options.count, estimates: &estimates };
    say(&pairs, console)?;
    let summary = json!({
        "photos": found.stats.products,
        "status": found.stats.status.to_string(),
        "eigenvalues": found.values.iter().zip(&found.standard_errors)
            .map(|(&value, &error)| rounded(value, error)).collect::<Vec<f64>>(),
        "imaginary_parts": found.imaginary_values,
        "residuals": found.residuals,
        "bounds": found.bounds,
        "standard_errors": found.standard_errors,
        "statuses": pairs.statuses(),
        "asymmetry": found.asymmetry,
        "completeness": found.completeness,
        "confirming": found.confirming,
        "of_scene": estimates.iter().map(|of| json!({
            "eigenvalue": rounded(of.value, of.standard_error),
            "standard_error": of.standard_error,
            "residual": of.residual,
        })).collect::<Vec<_>>(),
    });
    // A tolerance that was asked for is not met by what is within the noise.
    let demands = args.question.tolerance.map(|_| pairs.finding(true)).into_iter().collect();
    let kept = Kept { groups: None, eigenvectors: Some(Answer::from(&found)) };
    let ending = Ending { run: &args.run, demands, summary, kept };
    Ok(finish(lab, console, &pairs, ending)?.1)
}

fn say(pairs: &Eigenpairs<'_>, console: &Console) -> Result<()> {
    let found = pairs.found;
    console.say(format_args!("photos    {}: {}", found.stats.products, found.stats.status))?;
    say_completeness(found.completeness, (found.values.len(), pairs.wanted), found.confirming, console)?;
    if found.asymmetry > 1e-12 {
        console.say(format_args!("symmetry  {} % off, as measured", percent(found.asymmetry)))?;
    }
    if !pairs.estimates.is_empty() {
        console.say("  of the scene, by light paths of another seed as well:")?;
        console.say("           eigenvalue            residual")?;
        for (index, of) in pairs.estimates.iter().enumerate() {
            let residual = of.residual.map(|residual| format!("{residual:.1e}")).unwrap_or_default();
            let value = with_error(of.value, of.standard_error);
            console.say(format_args!("  {:>6}   {value:<20}  {residual}", index + 1))?;
        }
        console.say("  of the matrix, whose noise is the same in all photos:")?;
    }
    console.say("           eigenvalue            residual   error at most")?;
    for (index, status) in pairs.statuses().iter().enumerate() {
        let imaginary = match found.imaginary_values[index] {
            0.0 => String::new(),
            value => format!(" {} i", signed(value, 8)),
        };
        let value = match pairs.estimates.get(index) {
            // The estimate above has the error.
            Some(of) => rounded(found.values[index], of.standard_error).to_string(),
            None => with_error(found.values[index], found.standard_errors[index]) + &imaginary,
        };
        console.say(format_args!(
            "  {:>6}   {value:<20}  {:.1e}    {:.1e}   {status}",
            index + 1,
            found.residuals[index],
            found.bounds[index]
        ))?;
    }
    Ok(())
}

/// Says what is known of values that were missed.
pub(super) fn say_completeness(
    completeness: Completeness,
    (found, wanted): (usize, usize),
    products: usize,
    console: &Console,
) -> Result<()> {
    if found < wanted && completeness == Completeness::Exact {
        console.say(format_args!("missing   there are only {found}, and {wanted} were asked for"))?;
    } else if products > 0 {
        console.say(format_args!("missing   {completeness} ({products} further products confirm it)"))?;
    } else {
        console.say(format_args!("missing   {completeness}"))?;
    }
    Ok(())
}
