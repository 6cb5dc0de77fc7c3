//! Errors of a realistic rig's answers against the true light transport, for variants of the rig, scenes and seeds.
//! `cargo bench --bench rig_errors -- [SCENE or VARIANT]... [--seeds N] [--samples N] [--record [TABLE]...]`; see `benches/README.md`.

#[path = "arguments/flags.rs"]
mod flags;
#[path = "arguments/names.rs"]
mod names;
#[path = "arguments/record.rs"]
mod record;

use std::ops::ControlFlow;
use std::path::Path;

use krylux::analysis::adjusted_rand_index;
use krylux::krylov::{Method, SolveOptions, norm, solve};
use krylux::lab::Lab;
use krylux::measure::RigFile;
use krylux::observer::{Estimate, OnStep, Step};
use krylux::operator::{Observed, Operator, Recorded};
use krylux::scene::{Scene, builtin};
use krylux::transport::Part;
use krylux::verbs::Segment;
use record::Record;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const REALISTIC: &str = include_str!("../assets/rigs/realistic.toml");

/// Pixels of the projector along each side, as the rig file says.
const SIDE: usize = 64;

/// Variants of the rig: lines of its file that are replaced.
const VARIANTS: [(&str, Option<[&str; 2]>); 7] = [
    ("realistic", None),
    ("4 takes", Some(["takes = 1", "takes = 4"])),
    ("ambient 0.2", Some(["level = 0.1 ", "level = 0.2 "])),
    ("full well 5,000", Some(["full_well = 60000", "full_well = 5000"])),
    ("camera 64x64", Some(["size = [160, 160]", "size = [64, 64]"])),
    ("blur 0.6", Some(["blur = 0.2", "blur = 0.6"])),
    ("gamma 2.8", Some(["gamma = 2.2", "gamma = 2.8"])),
];

/// The tables of the guide: all are recorded where none is named.
const TABLES: [&str; 3] = ["segmentation", "compensation", "global"];

/// The pattern's compensation is compared with the optimum among this many products of the true matrix.
const OPTIMUM: usize = 300;

fn main() -> Outcome<()> {
    let Some(mut arguments) = flags::given() else { return Ok(()) };
    let seeds = flags::number(&mut arguments, "--seeds", 1)?;
    let samples = flags::number(&mut arguments, "--samples", 256)?;
    // Nothing was tuned on the last two.
    let scenes: [(&str, Scene); 4] = [
        ("zigzag", builtin::zigzag().to_scene()),
        ("corner", builtin::corner().to_scene()),
        ("two-sheets", builtin::two_sheets().to_scene()),
        ("cornell", builtin::cornell().to_scene()),
    ];
    let scene_names = scenes.iter().map(|scene| scene.0).collect::<Vec<_>>();
    let variant_names = VARIANTS.map(|variant| variant.0);
    println!("{SIDE}x{SIDE} pixels; relative errors, with the standard errors that are stated in brackets\n");
    println!(
        "| scene | variant | seed | white | direct light | global light | global product | the same two from other pixels | Rand index, regions | frames | residual 12 photos, optimum | MINRES, GMRES, 8 photos | at the frames of the 12 photos: MINRES, GMRES |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    let mut rows = Vec::new();
    for (scene, built) in scenes {
        if !names::asked(&arguments, &scene_names, scene) {
            continue;
        }
        let mut exact = Lab::builder_of_scene(built).size(SIDE, SIDE).samples(samples).seed(7).open()?;
        for (variant, replaced) in VARIANTS {
            for seed in 1..=seeds {
                if !names::asked(&arguments, &variant_names, variant) {
                    continue;
                }
                let mut text = REALISTIC.replace("seed = 1  ", &format!("seed = {seed}  "));
                if let Some([from, to]) = replaced {
                    if !text.contains(from) {
                        return Err(format!("the rig file has no `{from}`").into());
                    }
                    text = text.replace(from, to);
                }
                let row = Row::measure(&mut exact, &text)?;
                println!("| {scene} | {variant} | {seed} | {row} |");
                rows.push((scene, variant, row));
            }
        }
    }
    println!();
    let [groups, patterns, light] =
        tables(&rows, &format!("{SIDE}×{SIDE} pixels, {samples} light paths, seeds 1 to {seeds}"));
    for (name, table) in TABLES.into_iter().zip([groups, patterns, light]) {
        if names::asked(&arguments, &TABLES, name) {
            table.finish()?;
        }
    }
    Ok(())
}

/// The tables of the guide: segmentation by all seeds of a scene and a rig, compensation and global light row by row.
fn tables(rows: &[(&str, &str, Row)], first: &str) -> [Record; 3] {
    let mut groups = Record::new("rig_errors_segmentation", first);
    groups.columns(&["scene", "rig", "least adjusted Rand index", "regions"]);
    for seeds in rows.chunk_by(|one, other| one.0 == other.0 && one.1 == other.1) {
        let least = seeds.iter().map(|row| row.2.rand_index).fold(f64::INFINITY, f64::min);
        let regions: Vec<String> = seeds.iter().map(|row| row.2.regions.to_string()).collect();
        groups.row(&[seeds[0].0, seeds[0].1, &format!("{least:.3}"), &regions.join(", ")]);
    }
    let mut patterns = Record::new("rig_errors_compensation", first);
    patterns.columns(&[
        "scene",
        "rig",
        "12 photos inside the box, optimum",
        "frames",
        "MINRES, GMRES, 8 photos before clamping",
        "clamped, at these frames",
    ]);
    for (scene, rig, row) in rows {
        let pair = |[one, other]: [f64; 2]| format!("{one:.4}, {other:.4}");
        let (frames, shown) = row.at_frames;
        patterns.row(&[*scene, rig, &pair(row.boxed), &frames.to_string(), &pair(row.solvers), &pair(shown)]);
    }
    let mut light = Record::new("rig_errors_global", first);
    light.columns(&["scene", "rig", "white", "wave"]);
    for (scene, rig, row) in rows {
        let [white, wave] = [(row.others[0], row.products[2][1]), (row.others[1], row.products[3][1])]
            .map(|(error, stated)| format!("{error:.3} ({stated:.3})"));
        light.row(&[*scene, rig, &white, &wave]);
    }
    [groups, patterns, light]
}

/// A calibrated rig, and the truth behind it.
struct Pair<'a> {
    rig: Lab,
    exact: &'a mut Lab,
    /// The rig's reading for 1 W/(m² sr), from the white photo.
    unit: f64,
}

impl Pair<'_> {
    /// The relative error of a product of the rig, and the standard error that it states.
    fn product(&mut self, part: Part, x: &[f64]) -> Outcome<[f64; 2]> {
        let (found, stated) = product(&mut self.rig, part, x)?;
        let (truth, _) = product(self.exact, part, x)?;
        Ok([misfit(&found, self.unit, &truth), stated / self.unit / norm(&truth)])
    }

    /// The relative error of a global product against the light that reaches other pixels than it left. What returns to its pixel by way of
    /// other surfaces is direct light to every pattern: both are on the diagonal, which is `own`.
    fn of_others(&mut self, own: &[f64], x: &[f64]) -> Outcome<f64> {
        let (found, _) = product(&mut self.rig, Part::Global, x)?;
        let (all, _) = product(self.exact, Part::Full, x)?;
        let truth: Vec<f64> =
            all.iter().zip(own.iter().zip(x)).map(|(all, (own, x))| all - own * x).collect();
        Ok(misfit(&found, self.unit, &truth))
    }

    /// The relative residual of a pattern by the true matrix.
    fn residual(&mut self, pattern: &[f64], wanted: &[f64]) -> Outcome<f64> {
        Ok(misfit(&product(self.exact, Part::Full, pattern)?.0, 1.0, wanted))
    }
}

/// The figures of one row.
struct Row {
    products: [[f64; 2]; 4],
    /// The errors of global white and of the global product against the light that reaches other pixels.
    others: [f64; 2],
    rand_index: f64,
    regions: usize,
    frames: u64,
    boxed: [f64; 2],
    solvers: [f64; 2],
    /// Frames of the 12 photos inside the box, and the residuals of MINRES and GMRES after as many frames at most, clamped as they are shown.
    at_frames: (u64, [f64; 2]),
}

impl Row {
    fn measure(exact: &mut Lab, text: &str) -> Outcome<Self> {
        let file = RigFile::from_bytes(Path::new("assets/rigs/realistic.toml"), text.as_bytes())?;
        let mut rig = exact.through_rig(file)?;
        rig.calibrate(&Default::default())?;
        rig.measure_flat_field()?;
        let white = vec![1.0; SIDE * SIDE];
        let (truth, seen) = (product(exact, Part::Full, &white)?.0, product(&mut rig, Part::Full, &white)?.0);
        let unit = seen.iter().sum::<f64>() / truth.iter().sum::<f64>();
        let mut pair = Pair { rig, exact, unit };
        let wave = picture(|x, y| (0.21 * x + 0.5).sin() * (0.13 * y + 0.2).cos());
        let products = [
            pair.product(Part::Full, &white)?,
            pair.product(Part::Direct, &white)?,
            pair.product(Part::Global, &white)?,
            pair.product(Part::Global, &wave)?,
        ];
        let own = pair.exact.matrix(Part::Full, 0)?.diagonal();
        let others = [pair.of_others(&own, &white)?, pair.of_others(&own, &wave)?];
        let (rand_index, regions, frames) = segmented(&mut pair)?;
        let (boxed, solvers, at_frames) = compensated(&mut pair, &truth, &seen)?;
        Ok(Self { products, others, rand_index, regions, frames, boxed, solvers, at_frames })
    }
}

impl std::fmt::Display for Row {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for [error, stated] in self.products {
            write!(formatter, "{error:.4} ({stated:.4}) | ")?;
        }
        write!(formatter, "{:.4}, {:.4} | ", self.others[0], self.others[1])?;
        let [[reached, optimum], [minres, gmres]] = [self.boxed, self.solvers];
        let (budget, [few_minres, few_gmres]) = self.at_frames;
        write!(
            formatter,
            "{:.4}, {} | {} | {reached:.4}, {optimum:.4} | {minres:.4}, {gmres:.4} | {budget}: {few_minres:.4}, {few_gmres:.4}",
            self.rand_index, self.regions, self.frames
        )
    }
}

/// The adjusted Rand index of the default segmentation by 40 photos, the number of regions, and the frames taken.
fn segmented(pair: &mut Pair<'_>) -> Outcome<(f64, usize, u64)> {
    let taken = |rig: &mut Lab| -> Outcome<u64> { Ok(rig.costs()?.map_or(0, |costs| costs.effort.taken)) };
    let before = taken(&mut pair.rig)?;
    let found = pair.rig.ask(&Segment { photos: Some(40), ..Segment::default() })?.segmentation;
    let rand_index = adjusted_rand_index(&found.labels[0].1, &pair.exact.labels()?)?;
    Ok((rand_index, found.regions.count, taken(&mut pair.rig)? - before))
}

/// The residuals of a compensation: of 12 photos inside the box and the optimum, of MINRES and GMRES by 8 photos; and the frames of the
/// first with what the others show after as many.
type Compensated = ([f64; 2], [f64; 2], (u64, [f64; 2]));

fn compensated(pair: &mut Pair<'_>, white: &[f64], seen: &[f64]) -> Outcome<Compensated> {
    let mut sorted = white.to_vec();
    sorted.sort_by(f64::total_cmp);
    let peak = 0.5 * sorted[white.len() / 2];
    let target = picture(|x, y| peak * (0.58 + 0.42 * (0.3 * x).sin() * (0.2 * y).cos()));
    let wanted: Vec<f64> = target.iter().map(|light| pair.unit * light).collect();
    let clamped = |x: &[f64]| -> Vec<f64> { x.iter().map(|value| value.clamp(0.0, 1.0)).collect() };
    let best = solved(pair.exact, &target, Method::Fista, OPTIMUM, Some(white.to_vec()))?;
    let ours = solved(&mut pair.rig, &wanted, Method::KrylovBox, 12, Some(seen.to_vec()))?;
    let boxed =
        [pair.residual(&clamped(&ours.last), &target)?, pair.residual(&clamped(&best.last), &target)?];
    let budget = ours.frames.last().copied().unwrap_or(0);
    let (mut solvers, mut few) = ([0.0; 2], [0.0; 2]);
    for (index, method) in [Method::Minres, Method::Gmres].into_iter().enumerate() {
        let found = solved(&mut pair.rig, &wanted, method, 8, None)?;
        solvers[index] = pair.residual(&found.last, &target)?;
        let answer = found.within(budget).unwrap_or(&[]);
        let answer = if answer.is_empty() { vec![0.0; white.len()] } else { clamped(answer) };
        few[index] = pair.residual(&answer, &target)?;
    }
    Ok((boxed, solvers, (budget, few)))
}

/// The answers of a method after each photo, and the frames until then.
struct Solved {
    answers: Vec<Vec<f64>>,
    frames: Vec<u64>,
    last: Vec<f64>,
}

impl Solved {
    /// The last answer whose photos took at most `budget` frames.
    fn within(&self, budget: u64) -> Option<&[f64]> {
        let count = self.frames.iter().take_while(|&&frames| frames <= budget).count();
        self.answers.get(count.min(self.answers.len()).checked_sub(1)?).map(Vec::as_slice)
    }
}

fn solved(
    lab: &mut Lab,
    b: &[f64],
    method: Method,
    products: usize,
    diagonal: Option<Vec<f64>>,
) -> Outcome<Solved> {
    let options = SolveOptions { products, rtol: 0.0, diagonal, ..SolveOptions::default() };
    let mut operator = lab.reference_operators(Part::Full)?.swap_remove(0);
    let mut recorded = Recorded::of_frames(&mut operator);
    let mut answers = Vec::new();
    let observer = OnStep::new(|step: &Step<'_>| {
        if let Estimate::Solution { iterate, .. } = &step.estimate {
            while (answers.len() as u64) < step.done {
                answers.push(iterate());
            }
        }
        ControlFlow::Continue(())
    });
    let last = solve(method, &mut Observed::new(&mut recorded, &observer), b, &options)?.x;
    let frames = recorded.frames;
    Ok(Solved { answers, frames, last })
}

/// A product and the standard error that the operator states for it.
fn product(lab: &mut Lab, part: Part, x: &[f64]) -> Outcome<(Vec<f64>, f64)> {
    let mut operator = lab.reference_operators(part)?.swap_remove(0);
    let mut y = vec![0.0; x.len()];
    operator.apply(x, &mut y)?;
    Ok((y, operator.standard_error()))
}

/// `‖found / unit − truth‖ / ‖truth‖`.
fn misfit(found: &[f64], unit: f64, truth: &[f64]) -> f64 {
    let difference: Vec<f64> = found.iter().zip(truth).map(|(found, truth)| found / unit - truth).collect();
    norm(&difference) / norm(truth)
}

fn picture(value: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    (0..SIDE * SIDE).map(|pixel| value((pixel % SIDE) as f64, (pixel / SIDE) as f64)).collect()
}
