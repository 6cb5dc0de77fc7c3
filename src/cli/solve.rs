//! `krylux solve`: a linear system from files, so that anyone can check the solvers against others.

use std::path::PathBuf;

use anyhow::Result;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::options::{OutputArgs, RunArgs, method};
use super::run_folder::RunFolder;
use crate::error::Error;
use crate::io::{npy, sparse};
use crate::krylov::{Method, SolveOptions, Status, solve_adjoint};
use crate::observer::{OnStep, Step};
use crate::operator::Observed;
use crate::report::solution::SolutionRun;
use crate::sparse::SparseOperator;

/// Solve A x = b for a matrix and a right-hand side from files
#[derive(clap::Args)]
pub(super) struct Args {
    /// The matrix: .npz (SciPy), .mtx (Matrix Market), or a dense .npy
    #[arg(value_name = "MATRIX")]
    matrix: PathBuf,
    /// The right-hand side: an .npy file with as many numbers as the matrix has rows, in any shape
    #[arg(value_name = "RHS")]
    rhs: PathBuf,
    /// How: minres, gmres, fgmres, cg, cgs, bicgstab, lsqr, lsmr; inside a box: jacobi, fista, krylov-box; not
    /// negative: mrnsd, multiplicative
    #[arg(long, value_name = "NAME", default_value = "gmres", value_parser = method)]
    method: Method,
    /// Products with the matrix or its transpose at most
    #[arg(long, value_name = "N", default_value_t = 50)]
    photos: usize,
    /// Done when |b − A x| is at most this share of |b|
    #[arg(long, value_name = "X", default_value_t = 1e-6)]
    rtol: f64,
    /// The box's lower bound, for methods inside a box
    #[arg(long, value_name = "X", default_value_t = 0.0)]
    lower: f64,
    /// The box's upper bound, for methods inside a box
    #[arg(long, value_name = "X", default_value_t = 1.0)]
    upper: f64,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let mut operator = SparseOperator::new(sparse::read(&args.matrix)?);
    let rows = operator.matrix().rows();
    let rhs = npy::read_npy(&args.rhs)?.values;
    if rhs.len() != rows {
        return Err(Error::Data {
            path: args.rhs.clone(),
            fault: format!("it has {} numbers, but the matrix has {rows} rows", rhs.len()),
            help: "give a right-hand side that belongs to this matrix".into(),
        }
        .into());
    }
    let stem = args.matrix.file_stem().unwrap_or_default().to_string_lossy();
    let mut folder = RunFolder::create(&args.run, &format!("{stem}-solve"), console)?;
    let outcome = folder
        .describe_file(&args.matrix)
        .map_err(Into::into)
        .and_then(|()| answer(args, console, &mut operator, &rhs, &stem, &mut folder));
    folder.close(outcome)
}

fn answer(
    args: &Args,
    console: &Console,
    operator: &mut SparseOperator,
    rhs: &[f64],
    name: &str,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let options = SolveOptions {
        products: args.photos,
        rtol: args.rtol,
        lower: args.lower,
        upper: args.upper,
        ..SolveOptions::default()
    };
    let bar = console.bar("products");
    let found = folder.timed("products", |_| {
        let observer = OnStep::new(|step: &Step<'_>| bar.at(step.done, step.total));
        solve_adjoint(args.method, &mut Observed::new(operator, &observer), rhs, &options)
    })?;
    drop(bar);
    if console.check().is_break() {
        return Err(Error::Interrupted.into());
    }
    folder.manifest.photos = found.stats.products as u64;
    let good = matches!(
        found.stats.status,
        Status::ReachedTolerance | Status::SpaceExhausted | Status::LeastSquares | Status::ConstrainedOptimum
    );
    let run = SolutionRun {
        title: format!("{name} · linear system"),
        found: &found,
        method: args.method.facts().name,
        good,
    };
    let seconds = folder.seconds();
    folder.manifest.outputs =
        folder.timed("files", |folder| run.write(&folder.path, &folder.manifest, seconds))?;
    console.say(format_args!("products  {}: {}", found.stats.products, found.stats.status))?;
    console.say(format_args!("residual  {:.3e} of the right-hand side", found.residual))?;
    console.say(format_args!("solution  {}", folder.path.join("solution.npy").display()))?;
    let report = folder.path.join("report.html");
    console.say(format_args!("report    {}", report.display()))?;
    console.summary(&json!({
        "verb": "solve",
        "folder": folder.path,
        "report": report,
        "products": found.stats.products,
        "status": found.stats.status.to_string(),
        "relative_residual": found.residual,
        "seconds": folder.seconds(),
    }))?;
    let outcome = if good { Outcome::Done } else { Outcome::NotGoodEnough };
    Ok((outcome, format!("{} products: {}", found.stats.products, found.stats.status)))
}
