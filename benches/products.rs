//! Memory bandwidth of products with the transport matrix at 128×128 and 512×512, compared with two STREAM triads: one over
//! arrays larger than all caches, and one over the product's number of bytes, which may be cached in part. `cargo bench --bench
//! products`; see `benches/README.md`.

use std::time::Instant;

use krylux::image::Resolution;
use krylux::render::{TraceSettings, Tracer};
use krylux::scene::{Scene, builtin};
use krylux::transport::{Channels, Part, TransportMatrix, assemble};
use rayon::prelude::*;

/// Repetitions of each measurement.
const TURNS: usize = 21;
/// Bytes of the triad that measures main memory: four times the largest processor cache of today.
const BEYOND_CACHES: usize = 2 << 30;
/// Entries of each of a triad's vectors per parallel task.
const TASK: usize = 1 << 14;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn main() -> Outcome {
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if std::env::args().any(|argument| argument == "--test") {
        return Ok(());
    }
    println!(
        "krylux {}, {} threads, 64 samples, six bounces; {TURNS} turns, median (least to most)\n",
        env!("CARGO_PKG_VERSION"),
        rayon::current_num_threads()
    );
    println!(
        "{:>28}   entries, M      MiB   {:^29} share of a triad over as many bytes, and of memory's; four at once, of one by one",
        "", "product, GB/s"
    );
    let mut memory = Triad::of_bytes(BEYOND_CACHES);
    for side in [128, 512] {
        measure(&format!("corner, {side}x{side}"), &builtin::corner().to_scene(), side, &mut memory)?;
        measure(
            &format!("box of 100,000, {side}x{side}"),
            &builtin::tessellated_box(100_000),
            side,
            &mut memory,
        )?;
    }
    let rates = (0..TURNS).map(|_| rate(memory.bytes(), || memory.run())).collect();
    println!("\ntriad over {} MiB: {} GB/s", BEYOND_CACHES >> 20, spread(rates));
    Ok(())
}

/// Measures one scene's product, a triad over the same number of bytes, and the main-memory triad.
fn measure(name: &str, scene: &Scene, side: usize, memory: &mut Triad) -> Outcome {
    let mut tracer = Tracer::new(scene, None)?;
    let settings = TraceSettings::new(Resolution::new(side, side), 64);
    let matrix = assemble(&mut tracer, &settings, Channels::Luma)?.matrix;
    let pixels = side * side;
    // A product reads weights, columns and the pattern once and writes the photo once.
    let bytes = matrix.bytes() + 16 * pixels;
    let x: Vec<f64> = (0..pixels).map(|pixel| (pixel * 7919 % 1013) as f64 / 1013.0 - 0.5).collect();
    let mut y = vec![0.0; pixels];
    let mut triad = Triad::of_bytes(bytes);
    let mut others = vec![y.clone(); 4];
    let mut ys: Vec<&mut [f64]> = others.iter_mut().map(Vec::as_mut_slice).collect();
    let (mut products, mut of_triad, mut of_memory, mut of_four) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for _ in 0..TURNS {
        let product = rate(bytes, || multiply(&matrix, &x, &mut y));
        let together = rate(bytes, || matrix.apply_block(Part::Full, 0, &[x.as_slice(); 4], &mut ys));
        products.push(product);
        of_four.push(product / together / 4.0);
        of_triad.push(product / rate(triad.bytes(), || triad.run()));
        of_memory.push(product / rate(memory.bytes(), || memory.run()));
    }
    println!(
        "{name:>28}   {:>10.1}   {:>6.1}   {}   {}   {}   {}",
        matrix.nonzeros() as f64 / 1e6,
        bytes as f64 / f64::from(1 << 20),
        spread(products),
        spread(of_triad),
        spread(of_memory),
        spread(of_four)
    );
    Ok(())
}

fn multiply(matrix: &TransportMatrix, x: &[f64], y: &mut [f64]) {
    matrix.apply(Part::Full, 0, x, y);
}

/// `a ← b + 3 c` as in the STREAM benchmark: two vectors are read, one is written.
struct Triad {
    a: Vec<f64>,
    b: Vec<f64>,
    c: Vec<f64>,
}

impl Triad {
    fn of_bytes(bytes: usize) -> Self {
        let length = bytes / (3 * size_of::<f64>());
        Self { a: vec![0.0; length], b: vec![1.0; length], c: vec![2.0; length] }
    }

    fn bytes(&self) -> usize {
        3 * size_of::<f64>() * self.a.len()
    }

    fn run(&mut self) {
        let sources = self.b.par_chunks(TASK).zip(self.c.par_chunks(TASK));
        self.a.par_chunks_mut(TASK).zip(sources).for_each(|(a, (b, c))| {
            for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
                *a = b + 3.0 * c;
            }
        });
    }
}

/// Best rate of three runs, in GB/s.
fn rate(bytes: usize, mut work: impl FnMut()) -> f64 {
    let once = |work: &mut dyn FnMut()| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64()
    };
    let least = (0..3).map(|_| once(&mut work)).fold(f64::INFINITY, f64::min);
    bytes as f64 / least / 1e9
}

/// Median and range.
fn spread(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    format!("{:6.2} ({:6.2} to {:6.2})", values[values.len() / 2], values[0], values[values.len() - 1])
}
