//! Linear systems with the matrix of a source or from a file, to compare the solvers with other programs.

use std::cmp::Ordering;
use std::path::PathBuf;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use super::options::{count, method, number};
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade};
use crate::image::Resolution;
use crate::io::npy;
use crate::krylov::{Method, Solution, SolveOptions, Stats, Status, solve_adjoint};
use crate::lab::{Answer, GivenArray, Lab, Verb};
use crate::report::content::Content;
use crate::report::residuals::{self, Row};
use crate::report::run::AnswerPage;
use crate::transport::Part;

/// Solve A x = b for the light transport matrix of a source, or for a matrix from a file
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(after_help = "Example:\n  krylux solve matrix.npz photo.npy --method minres -o out/solved")]
pub struct Solve {
    /// The right-hand side: an .npy file with as many numbers as the matrix has rows, in any shape
    #[arg(value_name = "RHS", required = true)]
    pub rhs: Option<PathBuf>,
    /// The method: minres, gmres, fgmres, cg, cgs, bicgstab, lsqr, lsmr; inside a box: jacobi, fista, krylov-box; not
    /// negative: mrnsd, multiplicative
    #[arg(long, value_name = "NAME", default_value = "gmres", value_parser = method)]
    pub method: Method,
    /// Products with the matrix or its transpose at most
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = count::<usize>)]
    pub photos: usize,
    /// Done when |b − A x| is at most this share of |b|
    #[arg(long, value_name = "X", default_value_t = 1e-6, value_parser = number::<f64>)]
    pub rtol: f64,
    /// The box's lower bound, for methods inside a box
    #[arg(long, value_name = "X", default_value_t = 0.0, value_parser = number::<f64>)]
    pub lower: f64,
    /// The box's upper bound, for methods inside a box
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = number::<f64>)]
    pub upper: f64,
    /// The numbers of the right-hand side. A program may give them in place of `rhs`; otherwise they are read from the file once.
    #[arg(skip)]
    #[serde(skip)]
    pub values: OnceLock<Vec<f64>>,
}

impl Solve {
    /// The right-hand side, with one entry per row of the matrix.
    fn right_hand_side(&self, rows: usize) -> Result<&[f64]> {
        let values = match (self.values.get(), &self.rhs) {
            (Some(values), _) => values,
            (None, Some(path)) => {
                let read = npy::read_npy(path)?.values;
                self.values.get_or_init(|| read)
            }
            (None, None) => {
                return Err(Error::option("RHS", "there is no right-hand side").help("name its file"));
            }
        };
        if values.len() == rows {
            return Ok(values);
        }
        let fault = format!("it has {} numbers, but the matrix has {rows} rows", values.len());
        let path = self.rhs.clone().unwrap_or_else(|| PathBuf::from("RHS"));
        Err(Error::data(path, fault).help("give a right-hand side that belongs to this matrix"))
    }
}

impl Verb for Solve {
    const NAME: &'static str = "solve";
    const IS_CHECKED: bool = false;
    type Answer = Solved;

    fn check(&self) -> Result<()> {
        if self.lower.partial_cmp(&self.upper) == Some(Ordering::Less) {
            return Ok(());
        }
        let fault = format!("{} is not below --upper {}", self.lower, self.upper);
        Err(Error::option("--lower", fault).help("give a lower bound below the upper one"))
    }

    fn check_on(&self, lab: &Lab) -> Result<()> {
        let [rows, columns] = [lab.resolution(), lab.projector_resolution()].map(Resolution::pixels);
        if rows != columns && !matches!(self.method, Method::Lsqr | Method::Lsmr) {
            let name = self.method.facts().name;
            let fault =
                format!("{name} is for square matrices, and this one has {rows} rows and {columns} columns");
            return Err(Error::option("--method", fault).help("use lsmr or lsqr"));
        }
        self.right_hand_side(rows).map(drop)
    }

    fn give(&mut self, given: Vec<GivenArray>) -> Result<()> {
        for array in given {
            match array.field.as_str() {
                "values" => self.values = OnceLock::from(array.values),
                _ => return Err(array.not_taken()),
            }
        }
        Ok(())
    }

    /// Solves with the first channel's matrix.
    fn answer(&self, lab: &mut Lab) -> Result<Solved> {
        let rhs = self.right_hand_side(lab.resolution().pixels())?;
        let options = SolveOptions {
            products: self.photos,
            rtol: self.rtol,
            lower: self.lower,
            upper: self.upper,
            ..SolveOptions::default()
        };
        let mut operator = lab.operator(Part::Full)?;
        lab.expect(options.products);
        let found = lab.photos(|_| solve_adjoint(self.method, &mut operator, rhs, &options))?;
        let file = lab.run().map(|run| run.path.join("solution.npy"));
        Ok(Solved { found, method: self.method, file })
    }
}

/// A solution and the method that found it.
#[derive(Clone, Debug)]
pub struct Solved {
    /// The solution.
    pub found: Solution,
    /// The method.
    pub method: Method,
    /// The solution's file in the open run.
    pub file: Option<PathBuf>,
}

impl Solved {
    /// Whether the solution is as accurate as requested, or as accurate as possible.
    pub fn is_good(&self) -> bool {
        matches!(
            self.found.stats.status,
            Status::ReachedTolerance
                | Status::NoiseFloor
                | Status::SpaceExhausted
                | Status::LeastSquares
                | Status::ConstrainedOptimum
        )
    }
}

impl Answer for Solved {
    fn names(&self) -> [&'static str; 2] {
        [Solve::NAME, "linear system"]
    }

    fn photos(&self) -> usize {
        self.found.stats.products
    }

    fn headline(&self) -> String {
        let Stats { products, status } = self.found.stats;
        format!(
            "a residual of {:.3e} of the right-hand side after {products} products; {status}",
            self.found.residual
        )
    }

    fn content(&self) -> Content<'_> {
        let (mut content, found) = (Content::default(), &self.found);
        content.array("solution", &[found.x.len()], &found.x);
        let history = &found.history;
        let residuals: Vec<f64> = history.iter().map(|row| row.residual).collect();
        content.attribute("history", &[history.len()], residuals);
        content.attribute("best", &[history.len()], history.iter().map(|row| row.best).collect::<Vec<_>>());
        content.attribute("residual", &[], vec![found.residual]);
        content.fact("products", found.stats.products);
        content.fact("status", found.stats.status.to_string());
        content.fact("relative_residual", found.residual);
        content.detail("ended", found.stats.status.to_string());
        if let Some(file) = &self.file {
            content.line(format_args!("solution  {}", file.display()));
        }
        content
    }

    /// The finding about the accuracy of the solution.
    fn findings(&self) -> Vec<Finding> {
        let grade = if self.is_good() { Grade::Ok } else { Grade::Fails };
        let status = self.found.stats.status.to_string();
        vec![Finding::graded("solution", grade, status, "a residual within --rtol", "give more --photos")]
    }

    fn show(&self, _: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        let (found, method) = (&self.found, self.method.facts().name);
        let history: Vec<Row> = found.history.iter().map(|row| (row.products, row.residual)).collect();
        page.files.text("residuals.csv", residuals::csv("products", &history));
        let caption = "The residual of each iterate, as the method knows it: no product is spent on it.";
        let plot = residuals::plot("products", &[(method, &history)], Vec::new(), caption);
        page.section("Convergence", "", [plot]);
        page.sentence = format!(
            "{} products by {method}: {}. The residual is {:.3e} of the right-hand side.",
            found.stats.products, found.stats.status, found.residual
        );
        Ok(())
    }
}
