//! `krylux solve`: a linear system from files, so that anyone can check the solvers against others.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::Result;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::options::{OutputArgs, method};
use crate::krylov::{Method, Solution, SolveOptions, Status, solve_adjoint};
use crate::report::{atomic, npy, sparse};
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
    /// Where the solution goes: an .npy file of as many numbers as the matrix has columns
    #[arg(short = 'o', long = "output", value_name = "FILE", default_value = "x.npy")]
    file: PathBuf,
    /// Where the residual after each product goes, as a .csv file
    #[arg(long, value_name = "FILE")]
    history: Option<PathBuf>,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    atomic::check_writable(&args.file)?;
    args.history.as_deref().map_or(Ok(()), atomic::check_writable)?;
    let mut operator = SparseOperator::new(sparse::read(&args.matrix)?);
    let rows = operator.matrix().rows();
    let rhs = npy::read_npy(&args.rhs)?.values;
    if rhs.len() != rows {
        return Err(crate::Error::Data {
            path: args.rhs.clone(),
            fault: format!("it has {} numbers, but the matrix has {rows} rows", rhs.len()),
            help: "give a right-hand side that belongs to this matrix".into(),
        }
        .into());
    }
    let options = SolveOptions {
        products: args.photos,
        rtol: args.rtol,
        lower: args.lower,
        upper: args.upper,
        ..SolveOptions::default()
    };
    let bar = console.bar("products");
    let found = solve_adjoint(args.method, &mut operator, &rhs, &options, &mut |step| {
        bar.at(step.products as u64, step.budget as u64)
    })?;
    drop(bar);
    npy::write_npy(&args.file, &[found.x.len()], &found.x)?;
    if let Some(history) = &args.history {
        write_history(history, &found)?;
    }
    console.say(format_args!("products  {}: {}", found.stats.products, found.stats.status))?;
    console.say(format_args!("residual  {:.3e} of the right-hand side", found.residual))?;
    console.say(format_args!("wrote     {}", args.file.display()))?;
    console.summary(&json!({
        "verb": "solve",
        "file": args.file,
        "products": found.stats.products,
        "status": found.stats.status.to_string(),
        "relative_residual": found.residual,
    }))?;
    if console.check().is_break() {
        return Err(crate::Error::Interrupted.into());
    }
    Ok(match found.stats.status {
        Status::ReachedTolerance
        | Status::SpaceExhausted
        | Status::LeastSquares
        | Status::ConstrainedOptimum => Outcome::Done,
        _ => Outcome::NotGoodEnough,
    })
}

fn write_history(path: &Path, found: &Solution) -> Result<()> {
    let mut text = String::from("products,relative_residual\n");
    for row in &found.history {
        writeln!(text, "{},{:e}", row.products, row.residual)?;
    }
    Ok(atomic::write_bytes(path, text.as_bytes())?)
}
