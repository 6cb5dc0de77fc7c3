//! Benefit of scrambled Sobol points: variances of photo and matrix compared with independent random numbers, at equal time.
//! `cargo bench --bench sampling`; see `benches/README.md`.

#[path = "arguments/record.rs"]
mod record;

use krylux::image::Resolution;
use krylux::render::{Sampler, TraceSettings, Tracer};
use krylux::scene::{Scene, builtin};
use krylux::transport::{Channels, Part, assemble};
use record::Record;

type Outcome = Result<(), Box<dyn std::error::Error>>;

const SIDE: usize = 32;
/// Independent runs: they determine a variance summed over 1024 pixels to about one per cent.
const SEEDS: u32 = 24;

fn main() -> Outcome {
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if std::env::args().any(|argument| argument == "--test") {
        return Ok(());
    }
    let first = format!(
        "{SIDE}×{SIDE}, six bounces, {SEEDS} runs; variance of Sobol points / of independent numbers, at equal time"
    );
    let mut record = Record::new("sampling", &first);
    record.columns(&["scene", "samples", "white photo", "whole matrix"]);
    let mut others = Vec::new();
    for (name, scene) in [
        ("corner", builtin::corner().to_scene()),
        ("zigzag", builtin::zigzag().to_scene()),
        ("box", builtin::tessellated_box(100)),
        ("cornell", builtin::cornell().to_scene()),
    ] {
        for samples in [16, 64, 256] {
            let [white, full, global, time] = compare(&scene, samples)?;
            let cells = [name.to_owned(), samples.to_string(), format!("{white:.2}"), format!("{full:.2}")];
            record.row(&cells);
            others
                .push(format!("{name}, {samples} samples: without direct light {global:.2}, time {time:.2}"));
        }
    }
    println!("\n{}", others.join("\n"));
    Ok(record.finish()?)
}

/// Sums over independent runs that yield the variance.
#[derive(Default)]
struct Spread {
    count: f64,
    sums: Vec<f64>,
    squares: f64,
}

impl Spread {
    fn add(&mut self, values: &[f64]) {
        self.sums.resize(values.len(), 0.0);
        self.sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        self.squares += values.iter().map(|value| value * value).sum::<f64>();
        self.count += 1.0;
    }

    /// The variance, summed over all values.
    fn variance(&self) -> f64 {
        let of_mean = self.sums.iter().map(|sum| sum * sum).sum::<f64>() / self.count;
        (self.squares - of_mean) / (self.count - 1.0)
    }
}

#[derive(Default)]
struct Measured {
    white: Spread,
    full: Spread,
    global: Spread,
    seconds: f64,
}

/// The ratios of white photo, whole matrix and global matrix, and of the time alone.
fn compare(scene: &Scene, samples: u32) -> Result<[f64; 4], Box<dyn std::error::Error>> {
    let mut tracer = Tracer::new(scene, None)?;
    let mut measured = [Measured::default(), Measured::default()];
    for seed in 0..SEEDS {
        // The samplers alternate, so that both see the same load of the machine.
        for (sampler, measured) in [Sampler::Sobol, Sampler::Independent].into_iter().zip(&mut measured) {
            let base = TraceSettings::new(Resolution::new(SIDE, SIDE), samples);
            measured.run(&mut tracer, &TraceSettings { seed, sampler, ..base })?;
        }
    }
    let [sobol, independent] = measured;
    let time = sobol.seconds / independent.seconds;
    let ratio = |of: fn(&Measured) -> &Spread| time * of(&sobol).variance() / of(&independent).variance();
    Ok([
        ratio(|measured| &measured.white),
        ratio(|measured| &measured.full),
        ratio(|measured| &measured.global),
        time,
    ])
}

impl Measured {
    fn run(&mut self, tracer: &mut Tracer, settings: &TraceSettings) -> Outcome {
        let traced = assemble(tracer, settings, Channels::Luma)?;
        let pixels = SIDE * SIDE;
        let mut photo = vec![0.0; pixels];
        traced.matrix.apply(Part::Full, 0, &vec![1.0; pixels], &mut photo);
        self.white.add(&photo);
        for (part, spread) in [(Part::Full, &mut self.full), (Part::Global, &mut self.global)] {
            let mut dense = vec![0.0; pixels * pixels];
            for (row, column, value) in traced.matrix.to_csr(part, 0)?.entries() {
                dense[row * pixels + column] = value;
            }
            spread.add(&dense);
        }
        self.seconds += traced.summary.tracing.as_secs_f64();
        Ok(())
    }
}
