//! Benefit of scrambled Sobol points: variances of photo and matrix compared with independent random numbers, at equal time.
//! `cargo bench --bench sampling`; see `benches/README.md`.

use krylux::image::Resolution;
use krylux::render::{Sampler, TraceSettings, Tracer};
use krylux::scene::{Scene, builtin};
use krylux::transport::{Channels, Part, assemble};

type Outcome = Result<(), Box<dyn std::error::Error>>;

const SIDE: usize = 32;
/// Independent runs: they determine a variance summed over 1024 pixels to about one per cent.
const SEEDS: u32 = 24;

fn main() -> Outcome {
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if std::env::args().any(|argument| argument == "--test") {
        return Ok(());
    }
    println!(
        "{SIDE}x{SIDE}, 6 bounces, {SEEDS} runs; variance of Sobol points / of independent numbers, at equal time"
    );
    println!("  scene     samples   white photo   matrix   without direct light   time");
    for (name, scene) in [
        ("corner", builtin::corner().to_scene()),
        ("zigzag", builtin::zigzag().to_scene()),
        ("box", builtin::tessellated_box(100)),
        ("cornell", builtin::cornell().to_scene()),
    ] {
        for samples in [16, 64, 256] {
            compare(name, &scene, samples)?;
        }
    }
    Ok(())
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

fn compare(name: &str, scene: &Scene, samples: u32) -> Outcome {
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
    println!(
        "  {name:<8}  {samples:>7}   {:>11.3}   {:>6.3}   {:>20.3}   {time:>4.2}",
        ratio(|measured| &measured.white),
        ratio(|measured| &measured.full),
        ratio(|measured| &measured.global)
    );
    Ok(())
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
