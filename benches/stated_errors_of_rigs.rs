//! Whether the errors that a rig's answers state are the true ones: deviations from the truth in units of the stated standard errors, over many
//! repeats of a realistic virtual rig. `cargo bench --bench stated_errors_of_rigs -- [SCENE]... [--repeats N]`; see `benches/README.md`.

use std::path::Path;

use krylux::analysis::low_rank::{LowRankCapture, capture};
use krylux::analysis::separate::{SeparateBy, separate};
use krylux::image::{Image, Resolution};
use krylux::krylov::{EigsOptions, eigs};
use krylux::lab::Lab;
use krylux::measure::RigFile;
use krylux::operator::Operator;
use krylux::scene::{Scene, builtin};
use krylux::transport::Part;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const REALISTIC: &str = include_str!("../assets/rigs/realistic.toml");

/// Pixels of the projector along each side, and those of the camera for each.
const SIDE: usize = 24;
const FINER: f64 = 2.5;

/// Photos of eigenvalues and of a model.
const PHOTOS: usize = 30;

/// The largest eigenvalues that are compared.
const EIGENVALUES: usize = 3;

fn main() -> Outcome<()> {
    let mut arguments: Vec<String> = std::env::args().skip(1).filter(|text| text != "--bench").collect();
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if arguments.iter().any(|text| text == "--test") {
        return Ok(());
    }
    let mut repeats = 200;
    if let Some(at) = arguments.iter().position(|text| text == "--repeats") {
        repeats =
            arguments.get(at + 1).and_then(|text| text.parse().ok()).ok_or("--repeats needs a number")?;
        arguments.drain(at..at + 2);
    }
    let scenes: [(&str, Scene); 3] = [
        ("zigzag", builtin::zigzag().to_scene()),
        ("corner", builtin::corner().to_scene()),
        ("two-sheets", builtin::two_sheets().to_scene()),
    ];
    println!(
        "{SIDE}x{SIDE} pixels through realistic.toml, {repeats} repeats: deviations in stated standard errors, and the least error stated\n"
    );
    println!(
        "| scene | answer | of the noise alone, one calibration | of the truth, one calibration | of the truth, calibrated anew |"
    );
    println!("|---|---|---|---|---|");
    for (name, scene) in scenes {
        if arguments.is_empty() || arguments.iter().any(|text| text == name) {
            judge(name, scene, repeats)?;
        }
    }
    Ok(())
}

/// One answer: its values in the units of the truth, and their stated standard errors.
#[derive(Clone)]
struct Stated {
    name: &'static str,
    values: Vec<f64>,
    errors: Vec<f64>,
}

fn judge(scene: &str, built: Scene, repeats: u64) -> Outcome<()> {
    let mut exact = Lab::builder_of_scene(built).size(SIDE, SIDE).samples(256).seed(7).open()?;
    let truth = truths(&mut exact)?;
    let known = calibrated(&exact, 0)?.rig().map(|rig| rig.calibration.clone()).ok_or("it is a rig")?;
    let (mut same, mut anew) = (Vec::new(), Vec::new());
    for seed in 1..=repeats {
        let mut rig = exact.through_rig(file(seed)?)?;
        rig.set_calibration(known.clone())?;
        same.push(answers(&mut rig, &mut exact)?);
        anew.push(answers(&mut calibrated(&exact, seed)?, &mut exact)?);
    }
    for (index, of) in truth.iter().enumerate() {
        let one =
            |runs: &[Vec<Stated>]| -> Vec<Stated> { runs.iter().map(|run| run[index].clone()).collect() };
        let (same, anew) = (one(&same), one(&anew));
        let count = same.len() as f64;
        // The mean of all repeats has a share of each one's noise: deviations from it are too small by the root of 1 − 1/n.
        let mean: Vec<f64> =
            (0..of.values.len()).map(|i| same.iter().map(|run| run.values[i]).sum::<f64>() / count).collect();
        let noise = rms(&same, &mean) / (1.0 - 1.0 / count).sqrt();
        println!(
            "| {scene} | {} | {noise:.2} | {:.2} | {:.2} |",
            of.name,
            rms(&same, &of.values),
            rms(&anew, &of.values)
        );
    }
    Ok(())
}

/// The root mean square of all deviations from `truth`, in stated errors. What states no error is left out.
fn rms(runs: &[Stated], truth: &[f64]) -> f64 {
    let each = runs.iter().flat_map(|run| run.values.iter().zip(&run.errors).zip(truth));
    let z: Vec<f64> = each
        .filter(|((_, error), _)| **error > 0.0)
        .map(|((value, error), truth)| (value - truth) / error)
        .collect();
    (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt()
}

fn file(seed: u64) -> Outcome<RigFile> {
    let camera = (FINER * SIDE as f64).round() as usize;
    let text = REALISTIC
        .replace("seed = 1  ", &format!("seed = {seed}  "))
        .replace("size = [160, 160]", &format!("size = [{camera}, {camera}]"));
    Ok(RigFile::from_bytes(Path::new("assets/rigs/realistic.toml"), text.as_bytes())?)
}

fn calibrated(exact: &Lab, seed: u64) -> Outcome<Lab> {
    let mut rig = exact.through_rig(file(seed)?)?;
    rig.calibrate(&Default::default())?;
    rig.measure_flat_field()?;
    Ok(rig)
}

fn checkers() -> Outcome<Image> {
    let square = |pixel: usize| f64::from(((pixel % SIDE / 4 + pixel / SIDE / 4) % 2) as u8);
    Ok(Image::from_planes(Resolution::new(SIDE, SIDE), &[(0..SIDE * SIDE).map(square).collect()])?)
}

fn product(lab: &mut Lab, part: Part, x: &[f64]) -> Outcome<Vec<f64>> {
    let mut y = vec![0.0; x.len()];
    lab.reference_operators(part)?.swap_remove(0).apply(x, &mut y)?;
    Ok(y)
}

/// The true answers, in the order of [`answers`].
fn truths(exact: &mut Lab) -> Outcome<Vec<Stated>> {
    let white = vec![1.0; SIDE * SIDE];
    let photo = product(exact, Part::Full, &white)?;
    let checked = product(exact, Part::Full, &checkers()?.plane(0))?;
    let (direct, global) = (product(exact, Part::Direct, &white)?, product(exact, Part::Global, &white)?);
    let pairs = pairs(exact, 200)?;
    let named = |name, values| Stated { name, values, errors: Vec::new() };
    Ok(vec![
        named("pixels of white photos", photo),
        named("pixels of photos of a checkerboard", checked.clone()),
        named("the largest eigenvalues of global light", pairs.values),
        named("relit checkerboard, all pixels as one", checked),
        named("direct light, pixels", direct),
        named("global light, pixels", global),
    ])
}

fn pairs(lab: &mut Lab, products: usize) -> Outcome<krylux::krylov::Eigs> {
    let options = EigsOptions { count: EIGENVALUES, products, tolerance: 1e-6, ..EigsOptions::default() };
    Ok(eigs(&mut lab.reference_operators(Part::Global)?.swap_remove(0), &options)?)
}

/// The answers of a rig. Its unit is that by which its white photo has the light of the true one.
fn answers(rig: &mut Lab, exact: &mut Lab) -> Outcome<Vec<Stated>> {
    let n = SIDE * SIDE;
    let white = Image::filled(Resolution::new(SIDE, SIDE), 1, 1.0);
    let truth = product(exact, Part::Full, &vec![1.0; n])?;
    let seen = rig.single_photo(&white)?.photo.plane(0);
    let unit = seen.iter().sum::<f64>() / truth.iter().sum::<f64>();
    let scaled = |values: Vec<f64>| -> Vec<f64> { values.into_iter().map(|value| value / unit).collect() };
    let mut found = Vec::new();
    for (name, pattern) in [("white", white), ("checkers", checkers()?)] {
        let photo = rig.single_photo(&pattern)?;
        let errors = photo.standard_error.ok_or("a rig states errors")?.plane(0);
        found.push(Stated { name, values: scaled(photo.photo.plane(0)), errors: scaled(errors) });
    }
    let eigenvalues = pairs(rig, PHOTOS)?;
    found.push(Stated {
        name: "eigenvalues",
        values: scaled(eigenvalues.values),
        errors: scaled(eigenvalues.standard_errors),
    });
    let pattern = checkers()?.plane(0);
    let mut full = rig.reference_operators(Part::Full)?.swap_remove(0);
    let model = capture(&mut full, &[], &LowRankCapture { photos: PHOTOS, ..LowRankCapture::default() })?;
    // One number is stated for the whole photo.
    let each = model.error_of_rank(&pattern) / (n as f64).sqrt();
    found.push(Stated {
        name: "relit",
        values: scaled(model.relight(&pattern)),
        errors: scaled(vec![each; n]),
    });
    let by = SeparateBy::Checkerboards { square: 2, shifts: 4 };
    let parts = separate(&mut full, Resolution::new(SIDE, SIDE), by, 0)?;
    let [direct, global] =
        [(parts.direct, parts.standard_error), (parts.global, parts.global_error)].map(|(values, errors)| {
            Stated { name: "separated", values: scaled(values), errors: scaled(errors.unwrap_or_default()) }
        });
    found.extend([direct, global]);
    Ok(found)
}
