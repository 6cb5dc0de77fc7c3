//! The graphics adapter by its own clock: tracing, assembly of the matrix and products, each beside its limit; and on the clock of the
//! host: the start, the matrix, and 50 photos. `cargo bench --bench device`; `-- --force` also measures software Vulkan;
//! see `guide/src/right/gpu.md`.

#[path = "arguments/spread.rs"]
mod spread;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use krylux::image::Resolution;
use krylux::krylov::{EigsOptions, eigs};
use krylux::render::{AdapterSummary, TraceSettings, Tracer};
use krylux::scene::{Scene, builtin};
use krylux::transport::{Assembled, Backend, Channels, GpuMatrix, Part, assemble};
use spread::spread;

/// Repetitions of each measurement.
const TURNS: usize = 9;
/// Products that are timed together: those of a run.
const PHOTOS: u32 = 50;
/// How long a GPU works before each measurement.
const BUSY: Duration = Duration::from_millis(150);

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let has = |wanted: &str| std::env::args().any(|argument| argument == wanted);
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if has("--test") {
        return Ok(());
    }
    let start = Instant::now();
    let adapter = Tracer::new(&builtin::corner().to_scene(), None)?.adapter().clone();
    let opened = 1e3 * start.elapsed().as_secs_f64();
    println!(
        "krylux {}, {} ({}), {} {}; 64 samples, six bounces; {TURNS} turns, median (least to most); times in ms",
        env!("CARGO_PKG_VERSION"),
        adapter.name,
        adapter.kind,
        adapter.driver,
        adapter.driver_version
    );
    println!("instance and device opened in {opened:.0} ms\n");
    if adapter.is_processor() && !has("--force") {
        println!(
            "on software Vulkan the host assembles and multiplies; -- --force measures the device all the same"
        );
        return Ok(());
    }
    let sides: &[usize] = if adapter.is_processor() { &[128] } else { &[128, 512, 1024] };
    println!(
        "| scene, pixels | entries, millions | tracing | Grays/s | assembly | limit | tracing and matrix, with the host | \
         50 products | share of a copy's rate | 50 photos |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (name, scene) in [
        ("corner", builtin::corner().to_scene()),
        ("cornell", builtin::cornell().to_scene()),
        ("box of 100,000", builtin::tessellated_box(100_000)),
    ] {
        for &side in sides {
            if let Err(error) = row(&adapter, name, &scene, side) {
                println!("| {name} {side}² | {error} |");
            }
        }
    }
    Ok(())
}

/// Prints the figures of a scene at one size.
fn row(adapter: &AdapterSummary, name: &str, scene: &Scene, side: usize) -> Outcome<()> {
    let mut tracer = Tracer::new(scene, None)?;
    tracer.assemble_on_device(true);
    let settings = TraceSettings::new(Resolution::new(side, side), 64);
    let made = |tracer: &mut Tracer| assemble(tracer, &settings, Channels::Luma);
    // The first pass compiles the kernels and makes the buffers.
    drop(made(&mut tracer)?);
    let [mut tracing, mut assembly, mut host] = [const { Vec::new() }; 3];
    let mut last: Option<Assembled> = None;
    for _ in 0..TURNS {
        // A GPU that has little to do lowers its clock: the last matrix keeps it busy.
        if let Some(last) = last.take() {
            let resident = GpuMatrix::new(&tracer, &last.matrix)?;
            let begin = Instant::now();
            while !adapter.is_processor() && begin.elapsed() < BUSY {
                resident.time_products(PHOTOS)?;
            }
        }
        let (traced, times) = tracer.timed(made)?;
        let mut sum = BTreeMap::<&str, f64>::new();
        times.iter().for_each(|(name, time)| *sum.entry(name).or_default() += 1e3 * time.as_secs_f64());
        if std::env::args().any(|argument| argument == "--kernels") {
            println!("{name} {side}²: {sum:.3?}");
        }
        let traced_in = sum.remove("tracing").unwrap_or(0.0);
        tracing.push(traced_in);
        assembly.push(sum.values().sum());
        drop(traced);
        let start = Instant::now();
        let traced = made(&mut tracer)?;
        host.push(1e3 * start.elapsed().as_secs_f64());
        last = Some(traced);
    }
    let mut traced = last.ok_or("no turn")?;
    traced.place(&tracer, Backend::Gpu)?;
    let fastest = tracing.iter().copied().fold(f64::INFINITY, f64::min);
    let rays = traced.summary.rays as f64 / fastest / 1e6;
    let resident = GpuMatrix::new(&tracer, &traced.matrix)?;
    let bytes = resident.bytes_of_product();
    let pixels = side * side;
    let x: Vec<f64> = (0..pixels).map(|pixel| (pixel * 7919 % 1013) as f64 / 1013.0 - 0.5).collect();
    resident.apply(Part::Full, 0, &x, &mut vec![0.0; pixels])?;
    // A copy reads and writes each byte: it moves as many bytes as a product if it copies half as many.
    let half = (bytes / 2).min(adapter.max_storage_binding).min(adapter.max_buffer);
    let copies = u32::try_from((1 << 30) / half.max(1)).unwrap_or(1).clamp(1, 1000);
    let [mut products, mut shares, mut photos, mut limits] = [const { Vec::new() }; 4];
    for _ in 0..TURNS {
        let (_, times) = tracer.timed(|_| resident.time_products(PHOTOS))?;
        let product: Duration = times.iter().map(|(_, time)| *time).sum();
        let copied =
            resident.time_copies(half, copies)?.as_secs_f64() / f64::from(copies) / (2.0 * half as f64);
        products.push(1e3 * product.as_secs_f64());
        shares.push(copied * bytes as f64 * f64::from(PHOTOS) / product.as_secs_f64());
        // A term is written, read, written to two rows and read there; an entry is written, read and written. There are half as many
        // terms as entries. The records of the paths, from which terms are made, come on top.
        limits.push(1e3 * copied * 6.0 * bytes as f64);
        let start = Instant::now();
        let mut operator = traced.operator(Part::Full, 0);
        let options =
            EigsOptions { count: 10, products: PHOTOS as usize, tolerance: 0.0, ..EigsOptions::default() };
        eigs(&mut operator, &options)?;
        photos.push(1e3 * start.elapsed().as_secs_f64());
    }
    println!(
        "| {name} {side}² | {:.1} | {} | {rays:.2} | {} | {} | {} | {} | {} | {} |",
        traced.matrix.nonzeros() as f64 / 1e6,
        spread(tracing),
        spread(assembly),
        spread(limits),
        spread(host),
        spread(products),
        spread(shares),
        spread(photos),
    );
    Ok(())
}
