//! Peak memory and time of making a matrix, from 64×64 to 512×512 at 64 samples. `cargo bench --bench growth`, with
//! `-- --svg DIR` for the two plots; see `benches/README.md`.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use krylux::image::Resolution;
use krylux::render::{TraceSettings, Tracer};
use krylux::report::atomic;
use krylux::report::plot::{LinePlot, Series};
use krylux::scene::builtin;
use krylux::transport::{Channels, assemble};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const SIDES: [usize; 6] = [64, 128, 192, 256, 384, 512];
const SAMPLES: u32 = 64;

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |name: &str| {
        let at = arguments.iter().position(|argument| argument == name)?;
        arguments.get(at + 1).map(String::as_str)
    };
    // `cargo test --benches` passes this; there is nothing to test here.
    if arguments.iter().any(|argument| argument == "--test") {
        return Ok(());
    }
    if let Some(side) = value("--side") {
        return measure(side.parse()?);
    }
    println!("zigzag, {SAMPLES} samples, 6 bounces, luma");
    println!("  side   paths, M   s        µs/path   peak, MiB   bytes/path   matrix, MiB");
    let [mut memory, mut time] = [const { Vec::new() }; 2];
    for side in SIDES {
        // A process of its own each time, so that nothing before it counts.
        let child = std::process::Command::new(std::env::current_exe()?)
            .args(["--side", &side.to_string()])
            .output()?;
        if !child.status.success() {
            return Err(String::from_utf8_lossy(&child.stderr).into());
        }
        let text = String::from_utf8_lossy(&child.stdout);
        let numbers = text.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let &[seconds, start, peak, matrix] = numbers.as_slice() else { return Err(text.into()) };
        let paths = (side * side) as f64 * f64::from(SAMPLES) / 1e6;
        println!(
            "  {side:>4}   {paths:>8.2}   {seconds:>6.2}   {:>7.2}   {:>9.0}   {:>10.1}   {matrix:>11.1}",
            seconds / paths,
            peak,
            (peak - start) * f64::from(1 << 20) / (paths * 1e6)
        );
        memory.push((paths, peak / 1024.0));
        time.push((paths, seconds));
    }
    if let Some(folder) = value("--svg") {
        for (name, y_label, points) in
            [("memory", "peak memory, GiB", memory), ("time", "tracing and matrix, s", time)]
        {
            let plot = LinePlot {
                x_label: format!(
                    "light paths, millions ({} to {} pixels a side)",
                    SIDES[0],
                    SIDES[SIDES.len() - 1]
                ),
                y_label: y_label.into(),
                series: vec![Series { name: name.into(), points }],
                ..LinePlot::default()
            };
            atomic::write_bytes(
                &Path::new(folder).join(format!("growth-{name}.svg")),
                plot.render().as_bytes(),
            )?;
        }
    }
    Ok(())
}

/// Prints seconds, memory before the start, peak memory and the matrix's bytes, these in MiB.
fn measure(side: usize) -> Outcome<()> {
    let mut tracer = Tracer::new(&builtin::zigzag().to_scene(), None)?;
    let go_on = &mut |_| ControlFlow::Continue(());
    // Compiles the kernel.
    assemble(&mut tracer, &TraceSettings::new(Resolution::new(8, 8), 1), Channels::Luma, go_on)?;
    let before = status("VmHWM:")?;
    let start = Instant::now();
    let settings = TraceSettings::new(Resolution::new(side, side), SAMPLES);
    let traced = assemble(&mut tracer, &settings, Channels::Luma, go_on)?;
    let seconds = start.elapsed().as_secs_f64();
    let matrix = traced.matrix.bytes() as f64 / f64::from(1 << 20);
    println!("{seconds} {before} {} {matrix}", status("VmHWM:")?);
    Ok(())
}

/// A line of the kernel's record of this process, in MiB.
fn status(name: &str) -> Outcome<f64> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix(name)).ok_or("no such line")?;
    Ok(line.trim().trim_end_matches(" kB").parse::<f64>()? / 1024.0)
}
