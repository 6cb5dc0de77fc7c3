//! Whether stated errors are the true ones: the deviations of answers from the truth, in units of their stated standard errors, over many
//! seeds of the light paths. `cargo bench --bench stated_errors -- [SCENE]... [--seeds N]`; see `benches/README.md`.

#[path = "arguments/flags.rs"]
mod flags;
#[path = "arguments/record.rs"]
mod record;

use krylux::analysis::verification::eigenpair_estimates;
use krylux::image::{Image, Resolution};
use krylux::krylov::{Eigs, EigsOptions, eigs};
use krylux::operator::Operator;
use krylux::render::{TraceSettings, Tracer};
use krylux::scene::{Scene, builtin};
use krylux::transport::{
    Assembled, Channels, MatrixOperator, Part, Question, Retraced, assemble, pooled, with_other_seed,
};
use record::Record;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Pixels along each side.
const SIDE: usize = 32;

/// Light paths from each pixel: for an answer, and for the truth.
const SAMPLES: [u32; 2] = [64, 8192];

/// The largest eigenvalues that are compared.
const EIGENVALUES: usize = 6;

fn main() -> Outcome<()> {
    let Some(mut arguments) = flags::given() else { return Ok(()) };
    let seeds = flags::number(&mut arguments, "--seeds", 32)?;
    // A constant was chosen on zigzag and cornell.
    let scenes: [(&str, Scene); 5] = [
        ("zigzag", builtin::zigzag().to_scene()),
        ("cornell", builtin::cornell().to_scene()),
        ("corner", builtin::corner().to_scene()),
        ("two-sheets", builtin::two_sheets().to_scene()),
        ("carton", builtin::carton().to_scene()),
    ];
    let first = format!(
        "{SIDE}×{SIDE} pixels, {} paths each, {seeds} seeds: deviations in stated standard errors",
        SAMPLES[0]
    );
    let mut record = Record::new("stated_errors", &first);
    record.columns(&[
        "scene",
        "light",
        "pixels of photos, beyond two",
        "eigenvalues",
        "eigenvalues of the matrix alone",
    ]);
    for (name, scene) in scenes {
        if arguments.is_empty() || arguments.iter().any(|text| text == name) {
            judge(name, &scene, seeds, &mut record)?;
        }
    }
    Ok(record.finish()?)
}

fn settings(samples: u32, seed: u32) -> TraceSettings {
    TraceSettings { seed, ..TraceSettings::new(Resolution::new(SIDE, SIDE), samples) }
}

fn retraced(tracer: &mut Tracer, settings: TraceSettings) -> Retraced<'_> {
    Retraced { tracer, settings, channels: Channels::Luma }
}

fn judge(name: &str, scene: &Scene, seeds: u32, record: &mut Record) -> Outcome<()> {
    let mut tracer = Tracer::new(scene, None)?;
    let truth = assemble(&mut tracer, &settings(SAMPLES[1], 1000), Channels::Luma)?;
    let [photos, beyond] = photos(&mut tracer, &truth, seeds)?;
    for part in [Part::Full, Part::Global] {
        let [estimates, plain] = eigenvalues(&mut tracer, &truth, part, seeds)?;
        let photos = match part {
            Part::Full => format!("{photos:.3}, {:.1} %", 100.0 * beyond),
            _ => String::new(),
        };
        record.row(&[name.to_owned(), format!("{part:?}"), photos, text(&estimates), text(&plain)]);
    }
    Ok(())
}

/// The root mean square, and that of each value in turn.
fn text(of_each: &[Vec<f64>]) -> String {
    let each: Vec<String> = of_each.iter().map(|z| format!("{:.2}", rms(z))).collect();
    format!("{:.2} ({})", rms(&of_each.concat()), each.join(", "))
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// Deviations of the estimated eigenvalues, and of the matrix's own, by the same standard errors: one list for each eigenvalue.
fn eigenvalues(
    tracer: &mut Tracer,
    truth: &Assembled,
    part: Part,
    seeds: u32,
) -> Outcome<[Vec<Vec<f64>>; 2]> {
    let exact = pairs(truth, part)?;
    let mut found = [vec![Vec::new(); EIGENVALUES], vec![Vec::new(); EIGENVALUES]];
    for seed in 0..seeds {
        let used = settings(SAMPLES[0], seed);
        let of_matrix = pairs(&assemble(tracer, &used, Channels::Luma)?, part)?;
        let asked: Vec<Question<'_>> =
            of_matrix.vectors.iter().map(|pattern| Question { pattern, shift: 0.0 }).collect();
        let products = retraced(tracer, with_other_seed(&used)).estimated_products(part, 0, &asked)?;
        let estimates = eigenpair_estimates(&of_matrix, &products, 1.0).ok_or("complex eigenvalues")?;
        for (index, estimate) in estimates.iter().enumerate() {
            let off = [estimate.value, of_matrix.values[index]].map(|value| value - exact.values[index]);
            for (found, off) in found.iter_mut().zip(off) {
                found[index].push(off / estimate.standard_error);
            }
        }
    }
    Ok(found)
}

fn pairs(traced: &Assembled, part: Part) -> Outcome<Eigs> {
    let options =
        EigsOptions { count: EIGENVALUES, products: 200, tolerance: 1e-6, ..EigsOptions::default() };
    Ok(eigs(&mut MatrixOperator::new(&traced.matrix, part, 0), &options)?)
}

/// The root mean square of the pixels' deviations under white and under a checkerboard, and the share of them beyond two.
fn photos(tracer: &mut Tracer, truth: &Assembled, seeds: u32) -> Outcome<[f64; 2]> {
    let size = Resolution::new(SIDE, SIDE);
    let square = |pixel: usize| f64::from(((pixel % SIDE / 4 + pixel / SIDE / 4) % 2) as u8);
    let checkers: Vec<f64> = (0..size.pixels()).map(square).collect();
    let mut off = Vec::new();
    for pattern in [Image::filled(size, 1, 1.0), Image::from_planes(size, &[checkers])?] {
        let mut exact = vec![0.0; size.pixels()];
        MatrixOperator::new(&truth.matrix, Part::Full, 0).apply(&pattern.plane(0), &mut exact)?;
        exact.iter_mut().zip(truth.ambient.plane(0)).for_each(|(exact, ambient)| *exact += ambient);
        for seed in 0..seeds {
            let (photo, error) =
                retraced(tracer, settings(SAMPLES[0], seed)).photograph_with_error(&pattern)?;
            let stated = pooled(&error)?.plane(0);
            let pixels = photo.plane(0).into_iter().zip(&exact).zip(stated).filter(|pixel| pixel.1 > 0.0);
            off.extend(pixels.map(|((photo, exact), stated)| (photo - exact) / stated));
        }
    }
    let beyond = off.iter().filter(|off: &&f64| off.abs() > 2.0).count() as f64 / off.len() as f64;
    Ok([rms(&off), beyond])
}
