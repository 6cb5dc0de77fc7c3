//! Fuzz tests of every reader of files: whatever the bytes are, reading ends with a result or an error, in bounded time and memory, and
//! without a panic. So it is for large files that repeat parts of small ones.
//!
//! Valid files are mutated: bits flipped, ends cut off, parts spliced, numbers set to extremes. In the test suite the cases are the same each
//! time and few; `KRYLUX_FUZZ_CASES=1000000 KRYLUX_FUZZ_SEED=7 cargo test --release --test fuzz` tries a million of each kind, others for each
//! seed. The bytes of a failed case are left in the temporary folder that the failure names. Put them into `tests/fuzz/corpus/READER/`: what is
//! there is read by every later run.

#![allow(clippy::panic, reason = "a failed test panics")]
#![allow(unsafe_code, reason = "a global allocator that counts cannot be written without")]

#[cfg(feature = "gige")]
mod cameras;
mod large;
#[path = "../matrix_support/mod.rs"]
mod matrix_support;
mod memory;
mod mutation;
mod readers;
mod seeds;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use mutation::{Mutation, mutated};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestCaseError, TestError, TestRunner};
use tempfile::TempDir;

/// The longest that a reader may take for a few kilobytes. A case takes a millisecond; a busy machine takes longer.
const LONGEST: Duration = Duration::from_secs(20);
/// The most bytes that a reader may allocate at a time for a few kilobytes: what the largest picture needs that is decoded at all.
const MOST_BYTES: usize = 4 << 30;

/// A kind of file: its name, the seeds, and what reads it.
pub struct Reader {
    /// The name of its folder in the corpus.
    pub name: &'static str,
    /// The name that a file of this kind has in a folder.
    pub file: &'static str,
    /// Whole files of this kind.
    pub seeds: fn(&Path) -> Vec<Vec<u8>>,
    /// Reads the file in the folder. It must not panic.
    pub read: fn(&Path),
}

fn setting(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

/// The files in the corpus of a reader.
fn corpus(name: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus").join(name);
    let listing = std::fs::read_dir(folder).into_iter().flatten();
    listing.filter_map(|file| Some(file.ok()?.path())).collect()
}

/// Reads `bytes` as a file in `folder`. `Err` says what a reader must not do.
fn read(reader: &Reader, folder: &Path, bytes: &[u8]) -> Result<(), String> {
    let path = folder.join(reader.file);
    std::fs::write(&path, bytes).expect("the temporary folder can be written");
    memory::begin();
    let began = Instant::now();
    let ended = catch_unwind(AssertUnwindSafe(|| (reader.read)(folder)));
    let (took, most) = (began.elapsed(), memory::most());
    match ended {
        Err(_) => Err("it panics".into()),
        Ok(()) if took > LONGEST => Err(format!("it takes {took:?}")),
        Ok(()) if most > MOST_BYTES => Err(format!("it allocates {most} bytes")),
        Ok(()) => Ok(()),
    }
}

/// Reads the corpus and mutated seeds.
fn fuzz(reader: &Reader) {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let seeds = (reader.seeds)(folder.path());
    for bytes in &seeds {
        read(reader, folder.path(), bytes)
            .unwrap_or_else(|why| panic!("{}: a whole file: {why}", reader.name));
    }
    for path in corpus(reader.name) {
        let bytes = std::fs::read(&path).expect("the corpus can be read");
        read(reader, folder.path(), &bytes).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
    }
    let config = Config {
        cases: setting("KRYLUX_FUZZ_CASES").unwrap_or(1000) as u32,
        rng_seed: RngSeed::Fixed(setting("KRYLUX_FUZZ_SEED").unwrap_or(1)),
        failure_persistence: None,
        ..Config::default()
    };
    let cases = (any::<prop::sample::Index>(), prop::collection::vec(any::<Mutation>(), 1..6));
    let ran = TestRunner::new(config).run(&cases, |(seed, mutations)| {
        let bytes = mutated(&seeds, seed.index(seeds.len()), &mutations);
        read(reader, folder.path(), &bytes).map_err(TestCaseError::fail)
    });
    if let Err(TestError::Fail(why, (seed, mutations))) = ran {
        let bytes = mutated(&seeds, seed.index(seeds.len()), &mutations);
        let kept = std::env::temp_dir().join(format!("krylux-fuzz-{}-{}", reader.name, blake(&bytes)));
        std::fs::write(&kept, bytes).expect("the temporary folder can be written");
        panic!("{}: {why}; the bytes are in {}: add them to the corpus", reader.name, kept.display());
    }
}

/// A short name for some bytes.
fn blake(bytes: &[u8]) -> String {
    use std::hash::{DefaultHasher, Hash, Hasher};
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}

/// Reads large files that repeat parts of the seeds.
fn read_large(reader: &Reader) {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let seeds = (reader.seeds)(folder.path());
    let shaped = match reader.name {
        "obj" => large::obj(),
        "gltf" => large::gltf(&seeds[0]),
        "npz" => large::npz(),
        "png" => large::png(),
        _ => Vec::new(),
    };
    for (at, bytes) in shaped.into_iter().chain(seeds.iter().flat_map(|seed| large::of(seed))).enumerate() {
        if let Err(why) = read(reader, folder.path(), &bytes) {
            let kept = std::env::temp_dir().join(format!("krylux-large-{}-{at}", reader.name));
            std::fs::write(&kept, bytes).expect("the temporary folder can be written");
            panic!("{}: {why}; the bytes are in {}", reader.name, kept.display());
        }
    }
}

macro_rules! fuzzed_by {
    ($readers:ident: $($name:ident),* $(,)?) => {
        $(
            mod $name {
                #[test]
                fn mutated() {
                    crate::fuzz(&crate::$readers::$name());
                }

                #[test]
                fn large() {
                    crate::read_large(&crate::$readers::$name());
                }
            }
        )*
    };
}

fuzzed_by!(
    readers:
    npy,
    npz,
    mtx,
    mtx_gz,
    mat,
    png,
    jpeg,
    other_picture,
    exr,
    glb,
    gltf,
    texture,
    obj,
    mtl,
    rig,
    camera_file,
    journal,
    cache,
    shard,
    forged_shard,
    calibration,
    calibration_array,
    model,
    model_array
);

#[cfg(feature = "compressed")]
fuzzed_by!(readers: compressed);

/// Data that a camera sends: datagrams and its description.
#[cfg(feature = "gige")]
mod of_cameras {
    fuzzed_by!(cameras: gvcp, gvsp, camera_xml);
}
