//! Matrices on disk: the same bits again, other settings apart, damage noticed, limits kept, company survived.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use crate::common::{load, settings, trace, tracer};
use krylux::cache::{Cache, Found, Key, LIMIT};
use krylux::image::Resolution;
use krylux::io::sparse;
use krylux::render::{Sampler, TraceSettings, Tracer};
use krylux::scene::Scene;
use krylux::transport::{Assembled, Channels, assemble_layers};
use tempfile::TempDir;

fn folder() -> TempDir {
    TempDir::new().expect("a temporary folder can be made")
}

fn glowing_cornell() -> Scene {
    let mut scene = load("cornell");
    scene.materials[0].emission = glam::vec3(0.01, 0.02, 0.03);
    scene
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let listing = std::fs::read_dir(folder).expect("it is there");
    let mut files: Vec<PathBuf> = listing.map(|file| file.expect("it is readable").path()).collect();
    files.sort();
    files
}

fn whole(found: Found) -> Assembled {
    match found {
        Found::Whole(traced) => *traced,
        other => unreachable!("{other:?}"),
    }
}

#[test]
fn what_comes_back_is_what_was_traced_to_the_last_bit() {
    let scene = glowing_cornell();
    let mut tracer = tracer(&scene);
    let settings = settings(12, 8, 6, 1);
    for channels in [Channels::Luma, Channels::Rgb] {
        for split in [false, true] {
            let folder = folder();
            let cache = Cache::new(folder.path().join("new"), LIMIT);
            let key = Key::new(&scene, tracer.adapter(), &settings, channels, split);
            assert!(matches!(cache.load(&key), Found::Missing));
            let traced = assemble_layers(&mut tracer, &settings, channels, split)
                .expect("shipped scenes can be traced");
            assert!(cache.store(&key, &traced).expect("the folder is writable"));
            let found = whole(cache.load(&key));
            assert_eq!(traced.matrix, found.matrix);
            assert_eq!(traced.ambient, found.ambient);
            assert!(traced.noise.is_some() && traced.noise == found.noise);
            assert!(traced.ambient.samples().iter().any(|&sample| sample > 0.0), "nothing to compare");
            assert_eq!(
                (traced.summary.paths, traced.summary.rays),
                (found.summary.paths, found.summary.rays)
            );
            // For SciPy, each file is a matrix: the last layer, on and above the diagonal.
            let files = files(cache.folder());
            assert_eq!(files.len(), channels.count());
            let layers = traced.matrix.layers().expect("they are in this process");
            let layer = layers.last().expect("there is global light");
            let upper = |channel| {
                let layer = layer.to_csr(channel).expect("a layer is well formed");
                layer.entries().filter(|(row, column, _)| column >= row).collect::<Vec<_>>()
            };
            let matrices: Vec<_> = (0..channels.count()).map(upper).collect();
            for file in files {
                let found = sparse::read(&file).expect("it is in SciPy's format");
                assert!(matrices.contains(&found.entries().collect::<Vec<_>>()));
            }
        }
    }
}

#[test]
fn a_matrix_with_one_sample_per_pixel_comes_back_without_noise() {
    let (scene, folder) = (load("corner"), folder());
    let mut tracer = tracer(&scene);
    let settings = settings(8, 1, 1, 0);
    let traced = trace(&mut tracer, settings, Channels::Luma);
    let cache = Cache::new(folder.path(), LIMIT);
    let key = Key::new(&scene, tracer.adapter(), &settings, Channels::Luma, false);
    assert!(cache.store(&key, &traced).expect("the folder is writable"));
    let found = whole(cache.load(&key));
    assert!(found.noise.is_none() && found.matrix == traced.matrix);
}

#[test]
fn whatever_the_matrix_depends_on_is_in_its_key() {
    let scene = load("corner");
    let tracer = tracer(&scene);
    let base = settings(12, 8, 6, 1);
    let key = |scene: &Scene, settings: TraceSettings, channels, split| {
        Key::new(scene, tracer.adapter(), &settings, channels, split).hex().to_owned()
    };
    let of = |settings| key(&scene, settings, Channels::Luma, false);
    let changed = |change: &dyn Fn(&mut Scene)| {
        let mut scene = scene.clone();
        change(&mut scene);
        key(&scene, base, Channels::Luma, false)
    };
    let mut other_adapter = tracer.adapter().clone();
    other_adapter.driver_version.push('1');
    let keys = [
        of(base),
        of(TraceSettings { resolution: Resolution::new(12, 13), ..base }),
        of(TraceSettings { projector: Some(Resolution::new(12, 12)), ..base }),
        of(TraceSettings { samples: 9, ..base }),
        of(TraceSettings { max_bounces: 5, ..base }),
        of(TraceSettings { seed: 2, ..base }),
        of(TraceSettings { sampler: Sampler::Independent, ..base }),
        key(&scene, base, Channels::Rgb, false),
        key(&scene, base, Channels::Luma, true),
        changed(&|scene| scene.hash[7] ^= 1),
        changed(&|scene| scene.camera.tan_half_fov *= 1.0 + f32::EPSILON),
        changed(&|scene| scene.projector = Some(scene.camera.clone())),
        changed(&|scene| scene.materials[0].emission.x += 0.5),
        Key::new(&scene, &other_adapter, &base, Channels::Luma, false).hex().to_owned(),
    ];
    for (index, key) in keys.iter().enumerate() {
        assert!(!keys[..index].contains(key), "change {index} makes no other key");
    }
    assert_eq!(keys[0], changed(&|_| {}), "equal things have equal keys");
}

fn stored(folder: &Path, limit: u64) -> (Cache, Key, Assembled, Tracer) {
    let scene = load("corner");
    let mut tracer = tracer(&scene);
    let settings = settings(8, 4, 4, 0);
    let traced = trace(&mut tracer, settings, Channels::Luma);
    let cache = Cache::new(folder, limit);
    let key = Key::new(&scene, tracer.adapter(), &settings, Channels::Luma, false);
    assert!(cache.store(&key, &traced).expect("the folder is writable"));
    (cache, key, traced, tracer)
}

#[test]
fn damage_anywhere_is_noticed_or_does_no_harm() {
    let folder = folder();
    let (cache, key, traced, _) = stored(folder.path(), LIMIT);
    let file = &files(folder.path())[0];
    let sound = std::fs::read(file).expect("it was stored");
    let mut noticed = 0;
    let mut check = |bytes: &[u8], what: String| {
        std::fs::write(file, bytes).expect("the folder is writable");
        match cache.load(&key) {
            Found::Damaged(why) => {
                assert!(!why.is_empty());
                noticed += 1;
            }
            // Dates and the like.
            Found::Whole(found) => {
                assert!(found.matrix == traced.matrix && found.noise == traced.noise, "{what}");
            }
            Found::Missing => unreachable!("{what}"),
        }
    };
    let places = (0..sound.len()).step_by(29);
    let count = places.len();
    for at in places {
        let mut bytes = sound.clone();
        bytes[at] ^= 1 << (at % 8);
        check(&bytes, format!("byte {at}"));
    }
    for length in [0, 1, sound.len() / 2, sound.len() - 1] {
        check(&sound[..length], format!("cut off after {length}"));
    }
    // Nearly all bytes are the arrays'.
    assert!(noticed > count / 2, "{noticed} of {count}");
    std::fs::write(file, sound).expect("the folder is writable");
    assert_eq!(whole(cache.load(&key)).matrix, traced.matrix);
}

#[test]
fn another_keys_file_is_not_taken() {
    let folder = folder();
    let (cache, key, _, tracer) = stored(folder.path(), LIMIT);
    let other = Key::new(&load("corner"), tracer.adapter(), &settings(8, 4, 4, 1), Channels::Luma, false);
    let file = files(folder.path()).remove(0);
    let name = file.display().to_string().replace(key.hex(), other.hex());
    std::fs::rename(&file, name).expect("the folder is writable");
    assert!(matches!(cache.load(&other), Found::Damaged(_)));
    assert!(matches!(cache.load(&key), Found::Missing));
}

#[test]
fn what_was_unused_for_longest_goes_first() {
    let folder = folder();
    let (cache, first, traced, tracer) = stored(folder.path(), LIMIT);
    let size = cache.entries().expect("the folder is readable")[0].bytes;
    // Room for two.
    let cache = Cache::new(folder.path(), 5 * size / 2);
    let key =
        |seed| Key::new(&load("corner"), tracer.adapter(), &settings(8, 4, 4, seed), Channels::Luma, false);
    let (second, third) = (key(1), key(2));
    let age = |key: &Key, hours: u64| {
        let file = folder.path().join(format!("{}.luma.npz", key.hex()));
        let file = std::fs::File::options().append(true).open(file).expect("it was stored");
        let when = SystemTime::now() - Duration::from_secs(3600 * hours);
        file.set_modified(when).expect("files have times");
    };
    assert!(cache.store(&second, &traced).expect("the folder is writable"));
    age(&first, 2);
    age(&second, 1);
    // The first is older, but now it is used.
    whole(cache.load(&first));
    assert!(cache.store(&third, &traced).expect("the folder is writable"));
    let is_there = |key| matches!(cache.load(key), Found::Whole(_));
    assert_eq!([&first, &second, &third].map(is_there), [true, false, true]);

    let tiny = Cache::new(folder.path().join("tiny"), 100);
    assert!(!tiny.store(&first, &traced).expect("nothing is written"), "larger than the whole cache");
    assert!(matches!(tiny.load(&first), Found::Missing));
}

#[test]
fn clearing_leaves_what_is_not_the_caches() {
    let folder = folder();
    let (cache, key, ..) = stored(folder.path(), LIMIT);
    std::fs::write(folder.path().join("thesis.npz"), "mine").expect("the folder is writable");
    let unfinished = |count: u32| folder.path().join(format!(".{}.luma.npz.1-{count}.tmp", key.hex()));
    for count in [1, 2] {
        std::fs::write(unfinished(count), "of a killed run, perhaps").expect("the folder is writable");
    }
    let old = std::fs::File::options().append(true).open(unfinished(1)).expect("it is there");
    old.set_modified(SystemTime::now() - Duration::from_secs(7200)).expect("files have times");
    let (count, bytes) = cache.clear().expect("the folder is writable");
    assert!(count == 1 && bytes > 0);
    assert_eq!(
        files(folder.path()),
        [unfinished(2), folder.path().join("thesis.npz")],
        "another run may write"
    );
    assert_eq!(cache.clear().expect("it is empty"), (0, 0));
    assert_eq!(Cache::new(folder.path().join("none"), LIMIT).clear().expect("there is nothing"), (0, 0));
}

#[test]
fn runs_that_share_a_cache_never_see_half_a_matrix() {
    let folder = folder();
    let (cache, key, traced, _) = stored(folder.path(), LIMIT);
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                for _ in 0..20 {
                    assert!(cache.store(&key, &traced).expect("the folder is writable"));
                }
            });
        }
        scope.spawn(|| {
            for _ in 0..10 {
                cache.clear().expect("the folder is writable");
            }
        });
        scope.spawn(|| {
            for _ in 0..40 {
                match cache.load(&key) {
                    Found::Whole(found) => assert_eq!(found.matrix, traced.matrix),
                    Found::Missing => {}
                    Found::Damaged(why) => unreachable!("{why}"),
                }
            }
        });
    });
}
