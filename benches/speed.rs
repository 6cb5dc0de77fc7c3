//! Speed of tracing, products and a whole run, as ratios measured in one process. `cargo bench --bench speed -- [SCENE]...`; see
//! `benches/README.md`.

#[path = "arguments/record.rs"]
mod record;
#[path = "arguments/spread.rs"]
mod spread;

use std::time::{Duration, Instant};

use krylux::analysis::{Capture, SegmentOptions};
use krylux::image::{Image, Resolution};
use krylux::render::{TraceSettings, TraceSummary, Tracer};
use krylux::scene::{Scene, builtin};
use krylux::transport::{Assembled, Channels, MatrixOperator, Part, Retraced, Transport, assemble};
use record::Record;
use spread::spread;

/// Repetitions of each measurement; median and range are printed.
const TURNS: usize = 5;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn main() -> Outcome {
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if std::env::args().any(|argument| argument == "--test") {
        return Ok(());
    }
    // Peak memory is measured in a separate process, so that earlier memory use does not count.
    if std::env::args().any(|argument| argument == "--peak-memory") {
        return print_peak_memory();
    }
    let is_name = |argument: &String| !["--bench", "--record"].contains(&argument.as_str());
    let only: Vec<String> = std::env::args().skip(1).filter(is_name).collect();
    let cores = std::thread::available_parallelism()?.get();
    if only.is_empty() {
        tracing()?;
    }
    let mut record = Record::new("speed", &format!("{cores} cores, {TURNS} turns, median (least to most)"));
    record.columns(&[
        "64 samples, six bounces",
        "tracing pass, s",
        "matrix / tracing pass",
        "one product, ms",
        "50-photo run in all / tracing pass",
        "cores in use, %",
    ]);
    let mut retraced = Vec::new();
    for (name, side, scene) in runs() {
        if only.is_empty() || only.iter().any(|wanted| wanted == name) {
            retraced.push(format!("    {name:<11} {}", whole_run(name, &scene, side, cores, &mut record)?));
        }
    }
    println!("\none retraced photo / one product\n{}\n", retraced.join("\n"));
    record.finish()?;
    if only.is_empty() { memory() } else { Ok(()) }
}

/// The scenes of whole runs, with the pixels along a side.
fn runs() -> [(&'static str, usize, Scene); 7] {
    [
        ("corner", 128, builtin::corner().to_scene()),
        ("zigzag", 128, builtin::zigzag().to_scene()),
        ("cornell", 128, builtin::cornell().to_scene()),
        ("carton", 128, builtin::carton().to_scene()),
        ("box", 128, builtin::tessellated_box(100_000)),
        ("mirror", 128, builtin::mirror().to_scene()),
        ("cornell-512", 512, builtin::cornell().to_scene()),
    ]
}

fn settings(side: usize, samples: u32) -> TraceSettings {
    TraceSettings::new(Resolution::new(side, side), samples)
}

fn trace(tracer: &mut Tracer, settings: &TraceSettings) -> krylux::Result<Assembled> {
    assemble(tracer, settings, Channels::Luma)
}

/// Paths and rays per second for several numbers of triangles.
fn tracing() -> Outcome {
    println!("tracing, 128x128, 64 samples, 6 bounces");
    for triangles in [100, 100_000] {
        let scene = builtin::tessellated_box(triangles);
        let start = Instant::now();
        let mut tracer = Tracer::new(&scene, None)?;
        let opened = start.elapsed();
        // The first pass compiles the kernel.
        let first = trace(&mut tracer, &settings(16, 4))?.summary.tracing;
        let mut passes = Vec::new();
        for _ in 0..TURNS {
            passes.push(trace(&mut tracer, &settings(128, 64))?.summary);
        }
        let rate = |count: fn(&TraceSummary) -> u64| {
            spread(passes.iter().map(|pass| count(pass) as f64 / pass.tracing.as_secs_f64() / 1e6))
        };
        let longest = passes.iter().map(|pass| pass.longest).max().unwrap_or_default();
        println!("  {} triangles, on {}", scene.triangles.len(), tracer.adapter().name);
        println!("    paths per second, millions         {}", rate(|pass| pass.paths));
        println!("    rays per second, millions          {}", rate(|pass| pass.rays));
        println!("    to open the scene                  {:8.3} s", opened.as_secs_f64());
        println!("    first dispatches, compiling        {:8.3} s", first.as_secs_f64());
        println!("    longest dispatch after that        {:8.3} s", longest.as_secs_f64());
    }
    println!();
    Ok(())
}

/// Records the times of a product and of a run of 50 photos, each relative to the tracing pass; returns how many products a retraced photo takes.
fn whole_run(
    name: &str,
    scene: &Scene,
    side: usize,
    cores: usize,
    record: &mut Record,
) -> Result<String, Box<dyn std::error::Error>> {
    let settings = settings(side, 64);
    let mut tracer = Tracer::new(scene, None)?;
    let white = Image::filled(settings.resolution, 1, 1.0);
    trace(&mut tracer, &TraceSettings { samples: 1, ..settings })?;
    let [mut pass, mut matrix, mut product, mut photo, mut run, mut busy] = [const { Vec::<f64>::new() }; 6];
    for _ in 0..TURNS {
        let (start, processor) = (Instant::now(), processor_time());
        let traced = trace(&mut tracer, &settings)?;
        let to_matrix = start.elapsed().as_secs_f64();
        let to_photos = time(|| capture(&traced).map(drop))?.as_secs_f64();
        let processor = processor_time() - processor;
        let (x, mut y) = (vec![1.0; settings.resolution.pixels()], vec![0.0; settings.resolution.pixels()]);
        let twenty = time(|| {
            (0..20).for_each(|_| traced.matrix.apply(Part::Full, 0, &x, &mut y));
            Ok(())
        })?;
        let retraced = time(|| {
            let channels = Channels::Luma;
            Retraced { tracer: &mut tracer, settings, channels }.photograph(&white).map(drop)
        })?;
        let tracing = traced.summary.tracing.as_secs_f64();
        let one = twenty.as_secs_f64() / 20.0;
        pass.push(tracing);
        matrix.push(to_matrix / tracing - 1.0);
        product.push(one * 1e3);
        photo.push(retraced.as_secs_f64() / one);
        run.push((to_matrix + to_photos) / tracing);
        busy.push(100.0 * processor / (cores as f64 * (to_matrix + to_photos)));
    }
    let name = name.trim_end_matches("-512");
    let name = format!("{name}, {} triangles, {side}×{side}", scene.triangles.len());
    record.row(&[name, spread(pass), spread(matrix), spread(product), spread(run), spread(busy)]);
    Ok(spread(photo))
}

/// The time that all cores worked for this process so far, in seconds. The system counts it in hundredths of a second.
fn processor_time() -> f64 {
    let all = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name of the program, the second field, may have spaces. User and system time are fields 14 and 15.
    let fields = all.rsplit(')').next().unwrap_or_default().split_whitespace();
    let hundredths = fields.skip(11).take(2).filter_map(|field| field.parse::<f64>().ok());
    hundredths.sum::<f64>() / 100.0
}

/// Takes all photos of a segmentation, without stopping early.
fn capture(traced: &Assembled) -> krylux::Result<Capture> {
    let mut operator = MatrixOperator::new(&traced.matrix, Part::Global, 0);
    let mut capture =
        Capture::new(SegmentOptions { photos: 50, tolerance: 0.0, ..SegmentOptions::default() })?;
    capture.run(&mut operator)?;
    assert_eq!(capture.photos(), 50, "the run is to take 50 photos");
    Ok(capture)
}

fn time(work: impl FnOnce() -> krylux::Result<()>) -> krylux::Result<Duration> {
    let start = Instant::now();
    work()?;
    Ok(start.elapsed())
}

/// Peak memory of a 50-photo run at 256×256, in a child process.
fn memory() -> Outcome {
    let child = std::process::Command::new(std::env::current_exe()?).arg("--peak-memory").output()?;
    print!("{}", String::from_utf8_lossy(&child.stdout));
    if child.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&child.stderr).into()) }
}

fn print_peak_memory() -> Outcome {
    let mut tracer = Tracer::new(&builtin::zigzag().to_scene(), None)?;
    let traced = trace(&mut tracer, &settings(256, 64))?;
    capture(&traced)?.segmentation()?;
    let status = std::fs::read_to_string("/proc/self/status")?;
    let peak =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")).ok_or("no VmHWM in /proc/self/status")?;
    let kibibytes: f64 = peak.trim().trim_end_matches(" kB").parse()?;
    println!("zigzag, 256x256, 64 samples, 50 photos");
    println!("    peak memory, GiB                   {:8.3}", kibibytes / f64::from(1 << 20));
    println!(
        "    of it the matrix, GiB              {:8.3}",
        traced.matrix.bytes() as f64 / f64::from(1 << 30)
    );
    Ok(())
}
