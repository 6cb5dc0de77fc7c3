//! Speed of the graphics adapter: tracing in rays per second with the longest dispatch, and GPU matrix products against copies in
//! GPU memory. `cargo bench --bench device`; `-- --force` also measures products on software Vulkan; see `guide/src/right/gpu.md`.

#[path = "arguments/spread.rs"]
mod spread;

use std::time::{Duration, Instant};

use krylux::image::Resolution;
use krylux::render::{AdapterSummary, TraceSettings, Tracer};
use krylux::scene::{Scene, builtin};
use krylux::transport::{Assembled, Channels, GpuMatrix, Part, TransportMatrix, assemble};
use spread::spread;

/// Repetitions of each measurement; products and copies alternate.
const TURNS: usize = 9;
/// Minimum duration of a measurement, in seconds.
const ENOUGH: f64 = 0.1;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let has = |wanted: &str| std::env::args().any(|argument| argument == wanted);
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if has("--test") {
        return Ok(());
    }
    let adapter = adapter()?;
    println!(
        "krylux {}, {} ({}), {} {}; 64 samples, six bounces; {TURNS} turns, median (least to most)\n",
        env!("CARGO_PKG_VERSION"),
        adapter.name,
        adapter.kind,
        adapter.driver,
        adapter.driver_version
    );
    let sides: &[usize] = if adapter.is_processor() { &[128] } else { &[128, 512] };
    let takes_products = !adapter.is_processor() || has("--force");
    for &side in sides {
        for (name, scene) in
            [("corner", builtin::corner().to_scene()), ("box of 100,000", builtin::tessellated_box(100_000))]
        {
            println!("{name}, {side}x{side}");
            let (mut tracer, matrix) = trace(&scene, side)?;
            merging(&mut tracer, side)?;
            if takes_products {
                products(&tracer, &matrix)?;
            }
        }
    }
    if !takes_products {
        println!(
            "\nproducts are the processor's own on software Vulkan; -- --force takes them there all the same"
        );
    }
    Ok(())
}

/// The adapter that is chosen by default.
fn adapter() -> Outcome<AdapterSummary> {
    Ok(Tracer::new(&builtin::corner().to_scene(), None)?.adapter().clone())
}

/// Traces twice, since the first dispatches compile the kernel, and prints the figures of the second pass.
fn trace(scene: &Scene, side: usize) -> Outcome<(Tracer, TransportMatrix)> {
    let mut tracer = Tracer::new(scene, None)?;
    let settings = TraceSettings::new(Resolution::new(side, side), 64);
    let trace = |tracer: &mut Tracer, samples| {
        let settings = TraceSettings { samples, ..settings };
        assemble(tracer, &settings, Channels::Luma)
    };
    trace(&mut tracer, 1)?;
    let start = Instant::now();
    let traced = trace(&mut tracer, 64)?;
    let seconds = start.elapsed().as_secs_f64();
    let summary = traced.summary;
    println!(
        "  tracing   {:.4} Grays/s while the device worked, {:.4} with all that the host does; {} dispatches, the longest {:.0} ms",
        summary.rays as f64 / summary.tracing.as_secs_f64() / 1e9,
        summary.rays as f64 / seconds / 1e9,
        summary.dispatches,
        1e3 * summary.longest.as_secs_f64()
    );
    Ok((tracer, traced.matrix))
}

/// From the scene on the device to the finished matrix, where the host and where the device sorts and sums the contributions, in turns.
fn merging(tracer: &mut Tracer, side: usize) -> Outcome<()> {
    let settings = TraceSettings::new(Resolution::new(side, side), 64);
    let mut timed = |on_device: bool| -> krylux::Result<(f64, Assembled)> {
        tracer.merge_on_device(on_device);
        let start = Instant::now();
        let made = assemble(tracer, &settings, Channels::Luma)?;
        Ok((1e3 * start.elapsed().as_secs_f64(), made))
    };
    // The first one by the device compiles its kernels, and is compared with the host.
    let (_, first) = timed(true)?;
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..TURNS {
        for (on_device, times) in [false, true].into_iter().zip(&mut times) {
            times.push(timed(on_device)?.0);
        }
    }
    let [host, device] = times.map(spread);
    let agrees =
        if first.summary.merged > 0 { "" } else { " (it does not agree with the host, and is not used)" };
    println!(
        "  to the finished matrix: sorted and summed by the host {host} ms, by the device {device} ms{agrees}"
    );
    Ok(())
}

fn products(tracer: &Tracer, matrix: &TransportMatrix) -> Outcome<()> {
    let start = Instant::now();
    let resident = GpuMatrix::new(tracer, matrix)?;
    let moved = start.elapsed();
    let bytes = resident.bytes_of_product();
    let [rows, cols] = [matrix.resolution(), matrix.projector_resolution()].map(Resolution::pixels);
    let x: Vec<f64> = (0..cols).map(|pixel| (pixel * 7919 % 1013) as f64 / 1013.0 - 0.5).collect();
    let mut y = vec![0.0; rows];
    resident.apply(Part::Full, 0, &x, &mut y)?;
    let times = enough(|count| resident.time_products(count))?;
    // A copy reads and writes each byte: it moves as many bytes as a product if it copies half as many.
    let adapter = tracer.adapter();
    let half = (bytes / 2).min(adapter.max_storage_binding).min(adapter.max_buffer);
    let copies = enough(|count| resident.time_copies(half, count))?;
    let bands = resident.dispatches();
    let [mut product, mut copied, mut shares, mut dispatches, mut photos, mut here] =
        [const { Vec::new() }; 6];
    for _ in 0..TURNS {
        let rate = |bytes, time: Duration, count| bytes as f64 * f64::from(count) / time.as_secs_f64() / 1e9;
        let taken = resident.time_products(times)?;
        let of_product = rate(bytes, taken, times);
        dispatches.push(1e3 * taken.as_secs_f64() / f64::from(times) / bands as f64);
        let of_copy = rate(2 * half, resident.time_copies(half, copies)?, copies);
        product.push(of_product);
        copied.push(of_copy);
        shares.push(of_product / of_copy);
        let start = Instant::now();
        resident.apply(Part::Full, 0, &x, &mut y)?;
        photos.push(1e3 * start.elapsed().as_secs_f64());
        let start = Instant::now();
        matrix.apply(Part::Full, 0, &x, &mut y);
        here.push(1e3 * start.elapsed().as_secs_f64());
    }
    println!(
        "  matrix    {:.1} million entries, {:.1} MiB, there within {:.2} s; dispatches: {bands}, of {} ms",
        matrix.nonzeros() as f64 / 1e6,
        bytes as f64 / f64::from(1 << 20),
        moved.as_secs_f64(),
        spread(dispatches)
    );
    println!(
        "  product   {} GB/s, a copy there {} GB/s, share {}",
        spread(product),
        spread(copied),
        spread(shares)
    );
    println!(
        "  a photo   {} ms with its way there and back, {} ms on the processor",
        spread(photos),
        spread(here)
    );
    Ok(())
}

/// Number of repetitions of `work` that last long enough to be timed reliably.
fn enough(mut work: impl FnMut(u32) -> krylux::Result<Duration>) -> krylux::Result<u32> {
    work(1)?;
    Ok((ENOUGH / work(1)?.as_secs_f64().max(1e-7)).ceil().clamp(1.0, 1000.0) as u32)
}
