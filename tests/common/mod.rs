//! Helpers for several tests: shipped scenes, tracing them, reading reference data.
#![allow(dead_code, reason = "each test binary uses its own part of this")]

use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};

use krylux::image::{Image, Resolution};
use krylux::io::npy;
use krylux::render::{TraceSettings, Tracer};
use krylux::scene::{self, Scene};
use krylux::sparse::Csr;
use krylux::transport::{Assembled, Channels, Part, TransportMatrix, assemble};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// The repository's root.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The file of a shipped scene.
pub fn scene_path(name: &str) -> PathBuf {
    root().join("assets/scenes").join(name).join("scene.glb")
}

/// A shipped scene.
pub fn load(name: &str) -> Scene {
    scene::load(&scene_path(name), None).expect("shipped scenes load")
}

/// A scene on the first adapter.
pub fn tracer(scene: &Scene) -> Tracer {
    Tracer::new(scene, None).expect("the README's test command installs a Vulkan driver")
}

/// Settings for a square image.
pub fn settings(side: usize, samples: u32, max_bounces: u32, seed: u32) -> TraceSettings {
    TraceSettings { max_bounces, seed, ..TraceSettings::new(Resolution::new(side, side), samples) }
}

/// Traces without looking on.
pub fn trace(tracer: &mut Tracer, settings: TraceSettings, channels: Channels) -> Assembled {
    assemble(tracer, &settings, channels).expect("shipped scenes can be traced")
}

/// A shipped scene as it is traced with these settings. All tests of a binary that ask for the same share one trace, which must therefore
/// not be what they test.
pub fn traced(name: &'static str, settings: TraceSettings, channels: Channels) -> &'static Assembled {
    type Key = (&'static str, TraceSettings, Channels);
    type Shared = Vec<(Key, &'static OnceLock<Assembled>)>;
    static TRACED: Mutex<Shared> = Mutex::new(Vec::new());
    let key = (name, settings, channels);
    // The list is free again while one of them is traced.
    let cell = {
        let mut shared = TRACED.lock().unwrap_or_else(PoisonError::into_inner);
        match shared.iter().find(|(other, _)| *other == key) {
            Some((_, cell)) => *cell,
            None => {
                let cell: &'static OnceLock<Assembled> = Box::leak(Box::default());
                shared.push((key, cell));
                cell
            }
        }
    };
    cell.get_or_init(|| trace(&mut tracer(&load(name)), settings, channels))
}

/// A part as a matrix of its own.
pub fn csr(matrix: &TransportMatrix, part: Part, channel: usize) -> Csr {
    matrix.to_csr(part, channel).expect("a transport matrix is well formed")
}

/// An array of `tests/reference`, as it lies there.
pub fn reference(name: &str) -> Vec<f64> {
    let path = root().join("tests/reference").join(name);
    let array = npy::read_npy(&path).expect("reference data is in the repository");
    array.values
}

/// The pattern `checker:N`, its top left square lit.
pub fn checker(resolution: Resolution, period: usize) -> Image {
    let lit = |pixel: usize| {
        let (x, y) = (pixel % resolution.width, pixel / resolution.width);
        f32::from(u8::from((x / period + y / period).is_multiple_of(2)))
    };
    Image::new(resolution, 1, (0..resolution.pixels()).map(lit).collect()).expect("one sample per pixel")
}

/// Mean and standard error, element by element, of independent estimates of one vector.
pub fn mean_and_error(estimates: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
    let count = estimates.len() as f64;
    let each = |index: usize| estimates.iter().map(move |estimate| estimate[index]);
    let indices = 0..estimates[0].len();
    let mean: Vec<f64> = indices.clone().map(|index| each(index).sum::<f64>() / count).collect();
    let error = indices.map(|index| {
        let squares: f64 = each(index).map(|value| (value - mean[index]).powi(2)).sum();
        (squares / (count - 1.0) / count).sqrt()
    });
    let error = error.collect();
    (mean, error)
}

/// Root of the mean square.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// Signed, as the Krylov methods' vectors are.
pub fn random_vector(length: usize, seed: u64) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    (0..length).map(|_| random.random_range(-1.0..1.0)).collect()
}

/// `Σ_i |A_ji| |x_i|`: what the rounding of a row's sum is relative to.
pub fn magnitudes(csr: &Csr, x: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0; csr.rows()];
    csr.entries().for_each(|(row, column, weight)| sums[row] += weight.abs() * x[column].abs());
    sums
}
