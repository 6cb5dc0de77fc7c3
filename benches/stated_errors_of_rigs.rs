//! Whether the errors that a rig's answers state are the true ones: deviations from the truth in units of the stated standard errors, over many
//! repeats of a realistic virtual rig. `cargo bench --bench stated_errors_of_rigs -- [SCENE]... [--repeats N]`; see `benches/README.md`.

#[path = "arguments/flags.rs"]
mod flags;
#[path = "arguments/names.rs"]
mod names;
#[path = "arguments/record.rs"]
mod record;

use std::path::Path;

use krylux::analysis::low_rank::{LowRankCapture, capture};
use krylux::analysis::separate::{SeparateBy, separate};
use krylux::image::{Image, Resolution};
use krylux::krylov::{EigsOptions, eigs};
use krylux::lab::Lab;
use krylux::measure::RigFile;
use krylux::operator::{Closure, Operator, Symmetry};
use krylux::scene::{Scene, builtin};
use krylux::transport::Part;
use record::Record;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const REALISTIC: &str = include_str!("../assets/rigs/realistic.toml");

/// Pixels of the projector along each side, and camera pixels for each of them.
const SIDE: usize = 24;
const FINER: f64 = 2.5;

/// Photos of eigenvalues and of a model.
const PHOTOS: usize = 30;

/// The largest eigenvalues that are compared.
const EIGENVALUES: usize = 3;

/// Variants of the rig, by lines of its file that are replaced: what makes answers differ from the truth beyond their noise.
type Variant = (&'static str, &'static [[&'static str; 2]]);
const SHARP: [&str; 2] = ["blur = 0.2 ", "blur = 0.0 "];
const ALIGNED: [[&str; 2]; 4] = [
    ["shift = [0.3, 0.4]", "shift = [0.0, 0.0]"],
    ["rotation = 0.1 ", "rotation = 0.0 "],
    ["scale = 1.002", "scale = 1.0"],
    ["distortion = 0.002", "distortion = 0.0"],
];
const VARIANTS: [Variant; 4] = [
    ("realistic", &[]),
    ("no blur", &[SHARP]),
    ("aligned", &ALIGNED),
    ("aligned, no blur", &[SHARP, ALIGNED[0], ALIGNED[1], ALIGNED[2], ALIGNED[3]]),
];

fn main() -> Outcome<()> {
    let Some(mut arguments) = flags::given() else { return Ok(()) };
    let repeats = flags::number(&mut arguments, "--repeats", 200)?;
    let scenes: [(&str, Scene); 3] = [
        ("zigzag", builtin::zigzag().to_scene()),
        ("corner", builtin::corner().to_scene()),
        ("two-sheets", builtin::two_sheets().to_scene()),
    ];
    let first = format!(
        "{SIDE}×{SIDE} pixels through realistic.toml, {repeats} repeats: deviations in stated standard errors"
    );
    let mut record = Record::new("stated_errors_of_rigs", &first);
    record.columns(&[
        "scene",
        "rig",
        "answer",
        "of the noise alone, one calibration",
        "of the truth, one calibration",
        "of the truth, calibrated anew",
        "mean of the repeats off the truth",
    ]);
    for (name, scene) in scenes {
        if !names::asked(&arguments, &["zigzag", "corner", "two-sheets"], name) {
            continue;
        }
        let mut exact = Lab::builder_of_scene(scene).size(SIDE, SIDE).samples(256).seed(7).open()?;
        for variant in VARIANTS {
            if names::asked(&arguments, &VARIANTS.map(|variant| variant.0), variant.0) {
                judge(name, &mut exact, variant, repeats, &mut record)?;
            }
        }
    }
    Ok(record.finish()?)
}

/// One answer: its values in the units of the truth, and their stated standard errors.
#[derive(Clone)]
struct Stated {
    name: &'static str,
    values: Vec<f64>,
    errors: Vec<f64>,
}

fn judge(scene: &str, exact: &mut Lab, variant: Variant, repeats: u64, record: &mut Record) -> Outcome<()> {
    let truth = truths(exact)?;
    let known =
        calibrated(exact, 0, variant)?.rig().map(|rig| rig.calibration.clone()).ok_or("it is a rig")?;
    let (mut same, mut anew) = (Vec::new(), Vec::new());
    for seed in 1..=repeats {
        let mut rig = exact.through_rig(file(seed, variant)?)?;
        rig.set_calibration(known.clone())?;
        same.push(answers(&mut rig, exact)?);
        anew.push(answers(&mut calibrated(exact, seed, variant)?, exact)?);
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
        // The bias, which repeats do not average out.
        let off: f64 = mean.iter().zip(&of.values).map(|(mean, truth)| (mean - truth).powi(2)).sum();
        let bias = 100.0 * (off / of.values.iter().map(|truth| truth * truth).sum::<f64>()).sqrt();
        let off = [rms(&same, &of.values), rms(&anew, &of.values)].map(|rms| format!("{rms:.2}"));
        let [same, anew] = off;
        let cells = [scene.to_owned(), variant.0.to_owned(), of.name.to_owned()];
        record.row(&[&cells[..], &[format!("{noise:.2}"), same, anew, format!("{bias:.2} %")]].concat());
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

fn file(seed: u64, (_, replaced): Variant) -> Outcome<RigFile> {
    let camera = (FINER * SIDE as f64).round() as usize;
    let mut text = REALISTIC
        .replace("seed = 1  ", &format!("seed = {seed}  "))
        .replace("size = [160, 160]", &format!("size = [{camera}, {camera}]"));
    for [from, to] in replaced {
        if !text.contains(from) {
            return Err(format!("the rig file has no `{from}`").into());
        }
        text = text.replace(from, to);
    }
    Ok(RigFile::from_bytes(Path::new("assets/rigs/realistic.toml"), text.as_bytes())?)
}

fn calibrated(exact: &Lab, seed: u64, variant: Variant) -> Outcome<Lab> {
    let mut rig = exact.through_rig(file(seed, variant)?)?;
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

/// The values of all pixels but the two outermost on each side.
fn inside(values: &[f64]) -> Vec<f64> {
    let is_inside = |at: usize| (2..SIDE - 2).contains(&at);
    let kept = (0..values.len()).filter(|&pixel| is_inside(pixel % SIDE) && is_inside(pixel / SIDE));
    kept.map(|pixel| values[pixel]).collect()
}

/// The true answers, in the order of [`answers`].
fn truths(exact: &mut Lab) -> Outcome<Vec<Stated>> {
    let white = vec![1.0; SIDE * SIDE];
    let photo = product(exact, Part::Full, &white)?;
    let checked = product(exact, Part::Full, &checkers()?.plane(0))?;
    let (direct, global) = (product(exact, Part::Direct, &white)?, product(exact, Part::Global, &white)?);
    let [of_all, of_global] = [pairs(exact, Part::Full, 200)?, pairs(exact, Part::Global, 200)?];
    // No pattern tells direct light from light that returns to the pixel it left by way of other surfaces: both are the matrix's diagonal.
    let own = exact.matrix(Part::Full, 0)?.diagonal();
    let other: Vec<f64> = photo.iter().zip(&own).map(|(photo, own)| photo - own).collect();
    let of_others = eigenvalues_without(exact, &own)?;
    let named = |name, values| Stated { name, values, errors: Vec::new() };
    Ok(vec![
        named("pixels of white photos", photo),
        named("pixels of photos of a checkerboard", checked.clone()),
        named("the same without the two outermost pixels", inside(&checked)),
        named("the largest eigenvalues of all light", of_all.values),
        named("the largest eigenvalues of global light", of_global.values),
        named("the same, of light to other pixels", of_others),
        named("relit checkerboard, all pixels as one", checked),
        named("direct light by squares", direct),
        named("global light by squares", global),
        named("direct light and what returns to its pixel, by squares", own.clone()),
        named("global light from other pixels, by squares", other.clone()),
        named("direct light and what returns to its pixel, by codes", own),
        named("global light from other pixels, by codes", other),
    ])
}

/// The largest eigenvalues of the transport matrix without its diagonal.
fn eigenvalues_without(exact: &mut Lab, diagonal: &[f64]) -> Outcome<Vec<f64>> {
    let n = diagonal.len();
    let mut full = exact.reference_operators(Part::Full)?.swap_remove(0);
    let mut rest = Closure::new(n, n, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
        full.apply(x, y)?;
        y.iter_mut().zip(diagonal.iter().zip(x)).for_each(|(y, (own, x))| *y -= own * x);
        Ok(())
    });
    let options =
        EigsOptions { count: EIGENVALUES, products: 200, tolerance: 1e-6, ..EigsOptions::default() };
    Ok(eigs(&mut rest, &options)?.values)
}

fn pairs(lab: &mut Lab, part: Part, products: usize) -> Outcome<krylux::krylov::Eigs> {
    let options = EigsOptions { count: EIGENVALUES, products, tolerance: 1e-6, ..EigsOptions::default() };
    Ok(eigs(&mut lab.reference_operators(part)?.swap_remove(0), &options)?)
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
    let checked = &found[1];
    found.push(Stated { name: "inside", values: inside(&checked.values), errors: inside(&checked.errors) });
    for part in [Part::Full, Part::Global] {
        let eigenvalues = pairs(rig, part, PHOTOS)?;
        found.push(Stated {
            name: "eigenvalues",
            values: scaled(eigenvalues.values),
            errors: scaled(eigenvalues.standard_errors),
        });
    }
    found.extend(found.last().cloned());
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
    let [squares, codes] = [by, SeparateBy::Codes { photos: 16 }]
        .map(|by| separate(&mut full, (Resolution::new(SIDE, SIDE), None), by, 0));
    let stated = |(values, errors): (Vec<f64>, Option<Vec<f64>>)| Stated {
        name: "separated",
        values: scaled(values),
        errors: scaled(errors.unwrap_or_default()),
    };
    let (squares, codes) = (squares?, codes?);
    let of_squares =
        [(squares.direct, squares.standard_error), (squares.global, squares.global_error)].map(stated);
    found.extend(of_squares.clone());
    found.extend(of_squares);
    found.extend([(codes.direct, codes.standard_error), (codes.global, codes.global_error)].map(stated));
    Ok(found)
}
