//! `krylux solve`: a linear system from files, so that anyone can check the solvers against others.

use std::cmp::Ordering;
use std::path::PathBuf;

use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::{Ending, Opening, finish, in_run};
use super::options::{RunArgs, ViewArgs, count, method, number};
use super::trace::TraceArgs;
use crate::error::{Error, Result};
use crate::io::npy;
use crate::krylov::{Method, SolveOptions};
use crate::lab::{ChannelChoice, Lab, Solved};
use crate::paint::page::Kept;

/// Solve A x = b for a matrix and a right-hand side from files
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux solve matrix.npz photo.npy --method minres -o out/solved")]
pub(super) struct Args {
    /// The matrix: .npz (SciPy), .mtx (Matrix Market), or a dense .npy
    #[arg(value_name = "MATRIX")]
    matrix: PathBuf,
    /// The right-hand side: an .npy file with as many numbers as the matrix has rows, in any shape
    #[arg(value_name = "RHS")]
    rhs: PathBuf,
    /// The method: minres, gmres, fgmres, cg, cgs, bicgstab, lsqr, lsmr; inside a box: jacobi, fista, krylov-box; not
    /// negative: mrnsd, multiplicative
    #[arg(long, value_name = "NAME", default_value = "gmres", value_parser = method)]
    method: Method,
    /// Products with the matrix or its transpose at most
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = count::<usize>)]
    photos: usize,
    /// Done when |b − A x| is at most this share of |b|
    #[arg(long, value_name = "X", default_value_t = 1e-6, value_parser = number::<f64>)]
    rtol: f64,
    /// The box's lower bound, for methods inside a box
    #[arg(long, value_name = "X", default_value_t = 0.0, value_parser = number::<f64>)]
    lower: f64,
    /// The box's upper bound, for methods inside a box
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = number::<f64>)]
    upper: f64,
    #[command(flatten)]
    run: RunArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    if args.lower.partial_cmp(&args.upper) != Some(Ordering::Less) {
        return Err(Error::option("--lower", format!("{} is not below --upper {}", args.lower, args.upper))
            .help("give a lower bound below the upper one"));
    }
    let (view, trace) = (ViewArgs::default(), TraceArgs::default());
    let opening = Opening {
        source: &args.matrix,
        view: &view,
        trace: &trace,
        operator: None,
        channels: ChannelChoice::Luma,
        split_bounces: false,
    };
    let mut lab = opening.open(console)?;
    let rhs = npy::read_npy(&args.rhs)?.values;
    let rows = lab.resolution().pixels();
    if rhs.len() != rows {
        return Err(Error::data(
            &args.rhs,
            format!("it has {} numbers, but the matrix has {rows} rows", rhs.len()),
        )
        .help("give a right-hand side that belongs to this matrix"));
    }
    in_run(&mut lab, &args.run, "solve", |lab| answer(args, lab, &rhs, console))
}

fn answer(args: &Args, lab: &mut Lab, rhs: &[f64], console: &Console) -> Result<Outcome> {
    let options = SolveOptions {
        products: args.photos,
        rtol: args.rtol,
        lower: args.lower,
        upper: args.upper,
        ..SolveOptions::default()
    };
    let found = lab.solve(args.method, rhs, &options)?;
    let solved = Solved { found: &found, method: args.method };
    console.say(format_args!("products  {}: {}", found.stats.products, found.stats.status))?;
    console.say(format_args!("residual  {:.3e} of the right-hand side", found.residual))?;
    if let Some(run) = lab.run() {
        console.say(format_args!("solution  {}", run.path.join("solution.npy").display()))?;
    }
    let summary = json!({
        "products": found.stats.products,
        "status": found.stats.status.to_string(),
        "relative_residual": found.residual,
    });
    let ending = Ending { run: &args.run, demands: Vec::new(), summary, kept: Kept::default() };
    Ok(finish(lab, console, &solved, ending)?.1)
}
