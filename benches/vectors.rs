//! Time of the Krylov methods' own vector operations compared with the products that they request, at 512×512. `cargo bench`; see
//! `benches/README.md`.

use std::time::{Duration, Instant};

use krylux::image::Resolution;
use krylux::krylov::{Factorization, ForwardOnly, Lanczos, Method, SolveOptions, Start, solve_from};
use krylux::operator::{Operator, Symmetry};
use krylux::render::{TraceSettings, Tracer};
use krylux::scene::builtin;
use krylux::transport::{Channels, MatrixOperator, Part, assemble};

const SIDE: usize = 512;
/// Number of basis vectors at which a step is measured.
const VECTORS: usize = 50;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn main() -> Outcome {
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if std::env::args().any(|argument| argument == "--test") {
        return Ok(());
    }
    println!(
        "krylux {}, vector work, {SIDE}x{SIDE}, 64 samples, median (least to most)\n",
        env!("CARGO_PKG_VERSION")
    );
    for (name, scene) in [
        ("corner, 4 triangles", builtin::corner().to_scene()),
        ("box, 100,000 triangles", builtin::tessellated_box(100_000)),
    ] {
        let mut tracer = Tracer::new(&scene, None)?;
        let settings = TraceSettings::new(Resolution::new(SIDE, SIDE), 64);
        let traced = assemble(&mut tracer, &settings, Channels::Luma)?;
        println!("{name}: {:.1} million entries", traced.matrix.nonzeros() as f64 / 1e6);
        let matrix = MatrixOperator::new(&traced.matrix, Part::Full, 0);
        orthogonalization(matrix)?;
        solvers(matrix)?;
    }
    Ok(())
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

/// A Lanczos step with full reorthogonalization against about 50 vectors.
fn orthogonalization(matrix: MatrixOperator<'_>) -> Outcome {
    let mut timed = Timed { matrix, inside: Duration::ZERO };
    let mut lanczos = Lanczos::new(&Start::default().vector(SIDE * SIDE), &[])?;
    lanczos.expansion_mut().reserve(VECTORS + 5);
    let [mut products, mut vectors, mut ratios] = [const { Vec::new() }; 3];
    while lanczos.steps() < VECTORS + 5 {
        timed.inside = Duration::ZERO;
        let start = Instant::now();
        lanczos.expand(&mut timed)?;
        let whole = start.elapsed().as_secs_f64();
        let product = timed.inside.as_secs_f64();
        if lanczos.steps() + 5 > VECTORS {
            products.push(1e3 * product);
            vectors.push(1e3 * (whole - product));
            ratios.push((whole - product) / product);
        }
    }
    println!("    one product, ms                             {}", spread(products));
    println!("    one step's vector work at 50 vectors, ms    {}", spread(vectors));
    println!("    vector work / product                       {}", spread(ratios));
    Ok(())
}

/// Whole solver runs: the solver's own time compared with the time of the products.
fn solvers(matrix: MatrixOperator<'_>) -> Outcome {
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
    for (name, method) in
        [("MINRES", Method::Minres), ("GMRES", Method::Gmres), ("krylov-box", Method::KrylovBox)]
    {
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
        let found = solve_from(solver.as_mut(), &mut ForwardOnly(&mut timed), &options)?;
        let own = start.elapsed().saturating_sub(timed.inside).as_secs_f64() / found.stats.products as f64;
        let product = timed.inside.as_secs_f64() / found.stats.products as f64;
        println!(
            "    {name:<11} 12 photos: own work a photo, ms    {:8.3}, {:.2} products",
            1e3 * own,
            own / product
        );
    }
    println!();
    Ok(())
}

/// Median and range.
fn spread(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    format!("{:8.3} ({:.3} to {:.3})", values[values.len() / 2], values[0], values[values.len() - 1])
}
