//! Time and memory of computing a matrix, against pixels (64² to 1024²), samples (16 to 1024) and triangles (10² to 10⁶). `cargo
//! bench --bench growth`; `-- --record --svg DIR` writes tables and plots; see `benches/README.md`.

#[path = "arguments/record.rs"]
mod record;

use std::path::Path;
use std::time::Instant;

use krylux::image::Resolution;
use krylux::io::atomic;
use krylux::render::{TraceSettings, Tracer};
use krylux::report::plot::{LinePlot, Series};
use krylux::scene::{Scene, builtin};
use krylux::transport::{Channels, assemble};
use record::Record;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// One point of a sweep: the zigzag, or the tessellated box if a number of triangles is given.
#[derive(Clone, Copy)]
struct Case {
    side: usize,
    samples: u32,
    triangles: Option<usize>,
}

const BASE: Case = Case { side: 128, samples: 64, triangles: None };

/// Measurements of one process.
struct Figures {
    /// Time for scene upload, kernel and light buffer, in seconds.
    opening: f64,
    /// Time for tracing and matrix assembly, in seconds.
    seconds: f64,
    /// Memory before tracing, peak memory, and memory of the matrix, in MiB.
    start: f64,
    peak: f64,
    matrix: f64,
}

impl Case {
    fn scene(self) -> Scene {
        self.triangles.map_or_else(|| builtin::zigzag().to_scene(), builtin::tessellated_box)
    }

    /// Number of light paths, in millions.
    fn paths(self) -> f64 {
        (self.side * self.side) as f64 * f64::from(self.samples) / 1e6
    }

    /// Measures in a separate process, so that earlier memory use does not count.
    fn figures(self) -> Outcome<Figures> {
        let triangles = self.triangles.unwrap_or_default().to_string();
        let child = std::process::Command::new(std::env::current_exe()?)
            .args(["--case", &self.side.to_string(), &self.samples.to_string(), &triangles])
            .output()?;
        if !child.status.success() {
            return Err(String::from_utf8_lossy(&child.stderr).into());
        }
        let text = String::from_utf8_lossy(&child.stdout);
        let numbers = text.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let &[opening, seconds, start, peak, matrix] = numbers.as_slice() else { return Err(text.into()) };
        Ok(Figures { opening, seconds, start, peak, matrix })
    }
}

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let after = |name: &str, nth: usize| {
        let at = arguments.iter().position(|argument| argument == name)?;
        arguments.get(at + nth).map(String::as_str)
    };
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if arguments.iter().any(|argument| argument == "--test") {
        return Ok(());
    }
    if let (Some(side), Some(samples), Some(triangles)) =
        (after("--case", 1), after("--case", 2), after("--case", 3))
    {
        let triangles = Some(triangles.parse()?).filter(|&count| count > 0);
        return measure(Case { side: side.parse()?, samples: samples.parse()?, triangles });
    }
    let mut record = Record::new("growth", "six bounces");
    let columns = [PATHS, SECONDS, PER_PATH, PEAK, BYTES, MATRIX];
    let sides = [64, 128, 192, 256, 384, 512, 768, 1024];
    let pixels =
        sweep(&mut record, "zigzag, 64 samples: side", &columns, &sides, |side| Case { side, ..BASE })?;
    let columns = [PATHS, SECONDS, PER_PATH, PEAK, MATRIX];
    let samples =
        sweep(&mut record, "zigzag, 128×128: samples", &columns, &[16, 64, 256, 1024], |samples| Case {
            samples: samples as u32,
            ..BASE
        })?;
    let columns = [OPENING, SECONDS, PER_PATH, PEAK];
    let counts = [100, 1000, 10_000, 100_000, 1_000_000];
    let triangles =
        sweep(&mut record, "box, 128×128, 64 samples: triangles", &columns, &counts, |triangles| Case {
            triangles: Some(triangles),
            ..BASE
        })?;
    record.finish()?;
    let Some(folder) = after("--svg", 1) else { return Ok(()) };
    let by_paths = |y: fn(&Figures) -> f64| {
        [("more pixels, at 64 samples", &pixels), ("more samples, at 128×128", &samples)]
            .map(|(name, sweep)| series(name, sweep, |case| case.paths(), y))
            .into()
    };
    let by_triangles = |name: &str, y: fn(&Figures) -> f64| {
        series(name, &triangles, |case| (case.triangles.unwrap_or(1) as f64).log10(), y)
    };
    let paths = "light paths, millions";
    write(folder, "time", paths, "tracing and matrix, s", by_paths(|figures| figures.seconds))?;
    write(folder, "memory", paths, "peak memory, GiB", by_paths(|figures| figures.peak / 1024.0))?;
    let of_triangles = vec![
        by_triangles("tracing and matrix, s", |figures| figures.seconds),
        by_triangles("opening the scene, s", |figures| figures.opening),
        by_triangles("peak memory, GiB", |figures| figures.peak / 1024.0),
    ];
    write(folder, "triangles", "triangles, power of ten", "s, GiB", of_triangles)
}

type Sweep = Vec<(Case, Figures)>;

/// A column of a table: its heading, and what it says of a case.
type Column = (&'static str, fn(Case, &Figures) -> String);

const PATHS: Column = ("light paths, millions", |case, _| format!("{:.2}", case.paths()));
const OPENING: Column = ("opening, s", |_, figures| format!("{:.2}", figures.opening));
const SECONDS: Column = ("s", |_, figures| format!("{:.2}", figures.seconds));
const PER_PATH: Column = ("µs/path", |case, figures| format!("{:.2}", figures.seconds / case.paths()));
const PEAK: Column = ("peak memory, MiB", |_, figures| format!("{:.0}", figures.peak));
const BYTES: Column = ("bytes/path beyond the start", |case, figures| {
    format!("{:.0}", (figures.peak - figures.start) * f64::from(1 << 20) / (case.paths() * 1e6))
});
const MATRIX: Column = ("matrix, MiB", |_, figures| format!("{:.1}", figures.matrix));

fn sweep(
    record: &mut Record,
    name: &str,
    columns: &[Column],
    values: &[usize],
    case: impl Fn(usize) -> Case,
) -> Outcome<Sweep> {
    record.columns(&[vec![name], columns.iter().map(|column| column.0).collect()].concat());
    let mut measured = Vec::new();
    for &value in values {
        let case = case(value);
        let figures = case.figures()?;
        let cells = columns.iter().map(|(_, text)| text(case, &figures));
        record.row(&std::iter::once(value.to_string()).chain(cells).collect::<Vec<_>>());
        measured.push((case, figures));
    }
    Ok(measured)
}

fn series(name: &str, sweep: &Sweep, x: impl Fn(Case) -> f64, y: fn(&Figures) -> f64) -> Series {
    Series { name: name.into(), points: sweep.iter().map(|(case, figures)| (x(*case), y(figures))).collect() }
}

fn write(folder: &str, name: &str, x_label: &str, y_label: &str, series: Vec<Series>) -> Outcome<()> {
    let plot = LinePlot { x_label: x_label.into(), y_label: y_label.into(), series, ..LinePlot::default() };
    let path = Path::new(folder).join(format!("growth-{name}.svg"));
    Ok(atomic::write_bytes(&path, plot.render().as_bytes())?)
}

/// Prints the measurements of one case.
fn measure(case: Case) -> Outcome<()> {
    let scene = case.scene();
    let start = Instant::now();
    let mut tracer = Tracer::new(&scene, None)?;
    // Compiles the kernel before the measurement.
    assemble(&mut tracer, &TraceSettings::new(Resolution::new(8, 8), 1), Channels::Luma)?;
    let opening = start.elapsed().as_secs_f64();
    let before = status("VmHWM:")?;
    let start = Instant::now();
    let settings = TraceSettings::new(Resolution::new(case.side, case.side), case.samples);
    let traced = assemble(&mut tracer, &settings, Channels::Luma)?;
    let seconds = start.elapsed().as_secs_f64();
    let matrix = traced.matrix.bytes() as f64 / f64::from(1 << 20);
    println!("{opening} {seconds} {before} {} {matrix}", status("VmHWM:")?);
    Ok(())
}

/// An entry of this process's `/proc/self/status`, in MiB.
fn status(name: &str) -> Outcome<f64> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix(name)).ok_or("no such line")?;
    Ok(line.trim().trim_end_matches(" kB").parse::<f64>()? / 1024.0)
}
