//! Memory bandwidth of products with the transport matrix at 128×128 and 512×512, compared with two STREAM triads: one over
//! arrays larger than all caches, and one over the product's number of bytes, which may be cached in part. `cargo bench --bench
//! products`; see `benches/README.md`.

#[path = "arguments/record.rs"]
mod record;
#[path = "arguments/spread.rs"]
mod spread;

use std::time::Instant;

use krylux::image::Resolution;
use krylux::render::{TraceSettings, Tracer};
use krylux::scene::{Scene, builtin};
use krylux::transport::{Channels, Part, TransportMatrix, assemble};
use rayon::prelude::*;
use record::Record;
use spread::spread;

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
    let mut memory = Triad::of_bytes(BEYOND_CACHES);
    let rates = (0..TURNS).map(|_| rate(memory.bytes(), || memory.run()));
    let triad = format!("triad over {} MiB: {} GB/s", BEYOND_CACHES >> 20, spread(rates));
    let threads = rayon::current_num_threads();
    let first =
        format!("{threads} threads, 64 samples, six bounces; {TURNS} turns, median (least to most); {triad}");
    let mut record = Record::new("products", &first);
    record.columns(&[
        "",
        "entries, million",
        "MiB",
        "product, GB/s",
        "share of a triad over as many bytes",
        "of a triad over memory",
        "four at once, time over one by one",
    ]);
    for side in [128, 512] {
        let scenes =
            [("corner", builtin::corner().to_scene()), ("box of 100,000", builtin::tessellated_box(100_000))];
        for (name, scene) in scenes {
            let row = measure(&scene, side, &mut memory)?;
            record.row(&[vec![format!("{name}, {side}×{side}")], row].concat());
        }
    }
    Ok(record.finish()?)
}

/// Measures one scene's product, a triad over the same number of bytes, and the main-memory triad.
fn measure(
    scene: &Scene,
    side: usize,
    memory: &mut Triad,
) -> Result<Vec<String>, Box<dyn std::error::Error>> {
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
    Ok(vec![
        format!("{:.1}", matrix.nonzeros() as f64 / 1e6),
        format!("{:.1}", bytes as f64 / f64::from(1 << 20)),
        spread(products),
        spread(of_triad),
        spread(of_memory),
        spread(of_four),
    ])
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
