//! Errors of a realistic rig's answers against the true light transport, for variants of the rig, scenes and seeds.
//! `cargo bench --bench rig_errors`; see `benches/README.md`.

use std::path::Path;

use krylux::analysis::segment::segment;
use krylux::analysis::{SegmentOptions, adjusted_rand_index};
use krylux::krylov::{Method, SolveOptions, norm, solve};
use krylux::lab::Lab;
use krylux::measure::RigFile;
use krylux::operator::Operator;
use krylux::scene::{Scene, builtin};
use krylux::transport::Part;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const REALISTIC: &str = include_str!("../assets/rigs/realistic.toml");

/// Replacements in the text of the realistic rig's file.
const VARIANTS: [(&str, &[(&str, &str)]); 11] = [
    (
        "evensq2",
        &[
            ("vignetting = 0.1 ", "vignetting = 0.0 "),
            ("vignetting = 0.15", "vignetting = 0.0"),
            ("takes = 1\nblack", "takes = 1\ndirect_square = 2\nblack"),
        ],
    ),
    (
        "evensq2takes4",
        &[
            ("vignetting = 0.1 ", "vignetting = 0.0 "),
            ("vignetting = 0.15", "vignetting = 0.0"),
            ("takes = 1\nblack", "takes = 4\ndirect_square = 2\nblack"),
        ],
    ),
    (
        "evensq3",
        &[
            ("vignetting = 0.1 ", "vignetting = 0.0 "),
            ("vignetting = 0.15", "vignetting = 0.0"),
            ("takes = 1\nblack", "takes = 1\ndirect_square = 3\nblack"),
        ],
    ),
    ("even", &[("vignetting = 0.1 ", "vignetting = 0.0 "), ("vignetting = 0.15", "vignetting = 0.0")]),
    (
        "even nodist",
        &[
            ("vignetting = 0.1 ", "vignetting = 0.0 "),
            ("vignetting = 0.15", "vignetting = 0.0"),
            ("distortion = 0.002", "distortion = 0.0"),
            ("rotation = 0.1", "rotation = 0.0"),
            ("scale = 1.002", "scale = 1.0"),
            ("shift = [0.3, 0.4]", "shift = [0, 0]"),
            ("blur = 0.2", "blur = 0.0"),
        ],
    ),
    ("realistic", &[]),
    ("ambient 0.2", &[("level = 0.1 ", "level = 0.2 ")]),
    ("full well 5,000", &[("full_well = 60000", "full_well = 5000")]),
    ("camera 64x64", &[("size = [160, 160]", "size = [64, 64]")]),
    ("blur 0.6", &[("blur = 0.2", "blur = 0.6")]),
    ("gamma 2.8", &[("gamma = 2.2", "gamma = 2.8")]),
];

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    if arguments.iter().any(|argument| argument == "--test") {
        return Ok(());
    }
    let wanted = |name: &str| arguments.is_empty() || arguments.iter().any(|a| name.contains(a.as_str()));
    let scenes: [(&str, Scene); 4] = [
        ("zigzag", builtin::zigzag().to_scene()),
        ("corner", builtin::corner().to_scene()),
        ("two-sheets", builtin::two_sheets().to_scene()),
        ("cornell", builtin::cornell().to_scene()),
    ];
    println!(
        "scene       variant          seed  direct  global white  product stated  | ARI regions | frames | compensated/optimum MINRES/GMRES"
    );
    for (scene, built) in scenes {
        if !wanted(scene) {
            continue;
        }
        let mut exact = Lab::builder_of_scene(built).size(64, 64).samples(256).seed(7).open()?;
        for (variant, replacements) in VARIANTS {
            if !arguments.iter().any(|a| a == "all")
                && !wanted(variant)
                && (std::env::var("ONLY").is_ok() || variant != "realistic")
            {
                continue;
            }
            for seed in 1..=std::env::var("SEEDS").ok().and_then(|s| s.parse().ok()).unwrap_or(1) {
                let mut text = REALISTIC.replace("seed = 1  ", &format!("seed = {seed}  "));
                for (from, to) in replacements {
                    assert!(text.contains(from), "{from}");
                    text = text.replace(from, to);
                }
                let line = measure(&mut exact, &text).unwrap_or_else(|e| e.to_string());
                println!("{scene:11} {variant:16} {seed:4} {line}");
            }
        }
    }
    Ok(())
}

/// `‖found / unit − truth‖ / ‖truth‖`.
fn off(found: &[f64], unit: f64, truth: &[f64]) -> f64 {
    let misfit: Vec<f64> = found.iter().zip(truth).map(|(a, b)| a / unit - b).collect();
    norm(&misfit) / norm(truth)
}

fn product(lab: &mut Lab, part: Part, x: &[f64]) -> Outcome<(Vec<f64>, Option<f64>)> {
    let mut operator = lab.reference_operators(part)?.swap_remove(0);
    let mut y = vec![0.0; x.len()];
    operator.apply(x, &mut y)?;
    Ok((y, operator.standard_errors().first().copied()))
}

fn measure(exact: &mut Lab, text: &str) -> Outcome<String> {
    let file = RigFile::from_bytes(Path::new("assets/rigs/realistic.toml"), text.as_bytes())?;
    let mut file = file;
    if let Some(side) = std::env::var("SQUARE").ok().and_then(|s| s.parse().ok()) {
        file.measurement.direct_square = Some(side);
    }
    let mut rig = exact.through_rig(file)?;
    let report = rig.calibrate(&Default::default())?;
    if std::env::var("SHOW").is_ok() {
        println!("{:?} {:?}", report.map.error, report.evenness);
    }
    if std::env::var("SHEET").is_ok() {
        rig.measure_flat_field()?;
    }
    let n = exact.resolution().pixels();
    let ones = vec![1.0; n];
    let (white, _) = product(exact, Part::Full, &ones)?;
    let (seen, _) = product(&mut rig, Part::Full, &ones)?;
    let unit = seen.iter().sum::<f64>() / white.iter().sum::<f64>();
    let pair = |rig: &mut Lab, exact: &mut Lab, part, x: &[f64]| -> Outcome<(f64, f64)> {
        let (found, stated) = product(rig, part, x)?;
        let (truth, _) = product(exact, part, x)?;
        Ok((off(&found, unit, &truth), stated.unwrap_or(0.0) / unit / norm(&truth)))
    };
    let (width, resolution) = (exact.resolution().width, exact.resolution());
    let full = off(&seen, unit, &white);
    if std::env::var("SHOW").is_ok() {
        for y in 0..width {
            println!(
                "{}",
                (0..width)
                    .map(|x| {
                        let i = y * width + x;
                        format!("{:4.0}", 1000.0 * (seen[i] / unit / white[i] - 1.0))
                    })
                    .collect::<String>()
            );
        }
    }
    let direct = pair(&mut rig, exact, Part::Direct, &ones)?;
    let global = pair(&mut rig, exact, Part::Global, &ones)?;
    let wave: Vec<f64> = (0..n)
        .map(|i| (0.21 * (i % width) as f64 + 0.5).sin() * (0.13 * (i / width) as f64 + 0.2).cos())
        .collect();
    let wavy = pair(&mut rig, exact, Part::Global, &wave)?;
    let options = SegmentOptions { photos: 40, resolution: Some(resolution), ..SegmentOptions::default() };
    let labels = exact.labels()?;
    let before = rig.costs()?.map_or(0, |c| c.effort.taken);
    let found = segment(&mut rig.reference_operators(Part::Global)?.swap_remove(0), &options)?;
    let frames = rig.costs()?.map_or(0, |c| c.effort.taken) - before;
    if std::env::var("EIG").is_ok() {
        println!("values {:.3?} errors {:.3?}", found.eigenvalues, found.residuals);
        for g in [2] {
            let o = SegmentOptions { groups: vec![g], ..options.clone() };
            let f = segment(&mut rig.reference_operators(Part::Global)?.swap_remove(0), &o)?;
            println!("ari with {g}: {:.4}", adjusted_rand_index(&f.labels[0].1, &labels)?);
        }
    }
    if std::env::var("LAB").is_ok() {
        for y in (0..width).step_by(2) {
            println!(
                "{}  {}",
                (0..width)
                    .map(|x| (b'0' + found.labels[0].1[y * width + x].min(9)) as char)
                    .collect::<String>(),
                (0..width).map(|x| (b'0' + labels[y * width + x].min(9)) as char).collect::<String>()
            );
        }
    }
    let ari = adjusted_rand_index(&found.labels[0].1, &labels)?;
    let target: Vec<f64> = (0..n)
        .map(|i| 0.35 + 0.25 * (0.3 * (i % width) as f64).sin() * (0.2 * (i / width) as f64).cos())
        .collect();
    let mut sorted = white.clone();
    sorted.sort_by(f64::total_cmp);
    let peak = 0.5 * sorted[n / 2];
    let b: Vec<f64> = target.iter().map(|t| peak * t / 0.6).collect();
    let wanted: Vec<f64> = b.iter().map(|v| unit * v).collect();
    let boxed = |lab: &mut Lab, b: &[f64], white: &[f64], method, products| -> Outcome<Vec<f64>> {
        let options =
            SolveOptions { products, rtol: 0.0, diagonal: Some(white.to_vec()), ..SolveOptions::default() };
        let mut operator = lab.reference_operators(Part::Full)?.swap_remove(0);
        Ok(solve(method, &mut operator, b, &options)?.x)
    };
    let clamp = |x: &[f64]| -> Vec<f64> { x.iter().map(|v| v.clamp(0.0, 1.0)).collect() };
    let optimum = boxed(exact, &b, &white, Method::Fista, 300)?;
    let best = off(&product(exact, Part::Full, &clamp(&optimum))?.0, 1.0, &b);
    let ours = boxed(&mut rig, &wanted, &seen, Method::KrylovBox, 12)?;
    let reached = off(&product(exact, Part::Full, &clamp(&ours))?.0, 1.0, &b);
    let score = |rig: &mut Lab, exact: &mut Lab, method| -> Outcome<f64> {
        let options = SolveOptions { products: 8, rtol: 0.0, ..SolveOptions::default() };
        let mut operator = rig.reference_operators(Part::Full)?.swap_remove(0);
        let x = solve(method, &mut operator, &wanted, &options)?.x;
        Ok(off(&product(exact, Part::Full, &x)?.0, 1.0, &b))
    };
    let minres = score(&mut rig, exact, Method::Minres)?;
    let gmres = score(&mut rig, exact, Method::Gmres)?;
    Ok(format!(
        "full {full:.4} direct {:.3} ({:.3}) global {:.3} ({:.3}) product {:.3} ({:.3}) | ARI {ari:.4} {:?} | {frames} | {reached:.4}/{best:.4} = {:.3} | {minres:.4}/{gmres:.4}",
        direct.0,
        direct.1,
        global.0,
        global.1,
        wavy.0,
        wavy.1,
        found.regions,
        reached / best
    ))
}
