//! Time of the Krylov methods' own vector operations compared with the products that they request, at 512×512. `cargo bench`; see
//! `benches/README.md`.

#[path = "arguments/record.rs"]
mod record;
#[path = "arguments/spread.rs"]
mod spread;

use std::time::{Duration, Instant};

use krylux::image::Resolution;
use krylux::krylov::{Factorization, ForwardOnly, Method, SolveOptions, Start, solve_from};
use krylux::operator::{Operator, Symmetry};
use krylux::render::{TraceSettings, Tracer};
use krylux::scene::builtin;
use krylux::transport::{Channels, MatrixOperator, Part, assemble};
use record::Record;
use spread::spread;

const SIDE: usize = 512;
/// Number of basis vectors at which a step is measured.
const VECTORS: usize = 50;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn main() -> Outcome {
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if std::env::args().any(|argument| argument == "--test") {
        return Ok(());
    }
    let mut record = Record::new("vectors", &format!("{SIDE}×{SIDE}, 64 samples; medians (least to most)"));
    record.columns(&[
        "",
        "entries, million",
        "one product, ms",
        "Lanczos step at 50 vectors / product",
        "MINRES / product",
        "GMRES / product",
        "krylov-box / product",
    ]);
    for (name, scene) in [
        ("corner, 4 triangles", builtin::corner().to_scene()),
        ("box, 100,000 triangles", builtin::tessellated_box(100_000)),
    ] {
        let mut tracer = Tracer::new(&scene, None)?;
        let settings = TraceSettings::new(Resolution::new(SIDE, SIDE), 64);
        let traced = assemble(&mut tracer, &settings, Channels::Luma)?;
        let entries = format!("{:.1}", traced.matrix.nonzeros() as f64 / 1e6);
        let matrix = MatrixOperator::new(&traced.matrix, Part::Full, 0);
        let [product, step] = orthogonalization(matrix)?;
        let [minres, gmres, boxed] = solvers(matrix)?;
        record.row(&[name.to_owned(), entries, product, step, minres, gmres, boxed]);
    }
    Ok(record.finish()?)
}

/// An operator that accumulates the time of its products.
struct Timed<'a> {
    matrix: MatrixOperator<'a>,
    inside: Duration,
}

impl Operator for Timed<'_> {
    fn rows(&self) -> usize {
        self.matrix.rows()
    }
    fn cols(&self) -> usize {
        self.matrix.cols()
    }
    fn symmetry(&self) -> Symmetry {
        self.matrix.symmetry()
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> krylux::Result<()> {
        let start = Instant::now();
        let result = self.matrix.apply(x, y);
        self.inside += start.elapsed();
        result
    }
}

/// The milliseconds of a product, and a Lanczos step's own work with full reorthogonalization against about 50 vectors over them.
fn orthogonalization(matrix: MatrixOperator<'_>) -> Result<[String; 2], Box<dyn std::error::Error>> {
    let mut timed = Timed { matrix, inside: Duration::ZERO };
    let mut lanczos = Factorization::lanczos(&Start::default().vector(SIDE * SIDE), &[])?;
    lanczos.reserve(VECTORS + 5);
    let [mut products, mut ratios] = [const { Vec::new() }; 2];
    while lanczos.steps() < VECTORS + 5 {
        timed.inside = Duration::ZERO;
        let start = Instant::now();
        lanczos.expand(&mut timed)?;
        let whole = start.elapsed().as_secs_f64();
        let product = timed.inside.as_secs_f64();
        if lanczos.steps() + 5 > VECTORS {
            products.push(1e3 * product);
            ratios.push((whole - product) / product);
        }
    }
    Ok([spread(products), spread(ratios)])
}

/// The own time of MINRES, GMRES and krylov-box over twelve photos, relative to the time of the products.
fn solvers(matrix: MatrixOperator<'_>) -> Result<[String; 3], Box<dyn std::error::Error>> {
    let n = SIDE * SIDE;
    let mut white = vec![0.0; n];
    let mut timed = Timed { matrix, inside: Duration::ZERO };
    timed.apply(&vec![1.0; n], &mut white)?;
    // The target: stripes with 0.9 and 0.1 times the white photo.
    let wish: Vec<f64> = white
        .iter()
        .enumerate()
        .map(|(pixel, white)| white * if (pixel % SIDE / 32).is_multiple_of(2) { 0.9 } else { 0.1 })
        .collect();
    let mut ratios = [const { String::new() }; 3];
    for (method, ratio) in [Method::Minres, Method::Gmres, Method::KrylovBox].into_iter().zip(&mut ratios) {
        let boxed = method == Method::KrylovBox;
        let options = SolveOptions {
            products: 12,
            rtol: 0.0,
            diagonal: boxed.then(|| white.clone()),
            ..SolveOptions::default()
        };
        let mut solver = method.solver(n, &wish, &options)?;
        timed.inside = Duration::ZERO;
        let start = Instant::now();
        solve_from(&mut solver, &mut ForwardOnly(&mut timed), &options)?;
        let own = start.elapsed().saturating_sub(timed.inside).as_secs_f64();
        *ratio = format!("{:.2}", own / timed.inside.as_secs_f64());
    }
    Ok(ratios)
}
