//! The reader of each kind of file. A mutated file should give an error; `main.rs` lists the outcomes that must not occur.

use std::path::Path;

use krylux::cache::{Cache, Found, Key, LIMIT, ShardFile, ShardOrigin, write_shard};
use krylux::image::{Image, Resolution};
use krylux::io::model::{ChannelArrays, DirectArrays, ModelArrays};
use krylux::io::{exr, npy, picture, sparse};
use krylux::journal::Journal;
use krylux::measure::{Calibration, RigFile};
use krylux::render::{AdapterSummary, TraceSettings, Tracer};
use krylux::scene;
use krylux::transport::{Channels, assemble, join_shards, trace_shard};

use crate::{Reader, seeds};

pub fn npy() -> Reader {
    Reader {
        name: "npy",
        file: "file.npy",
        seeds: seeds::npy,
        read: |folder| {
            let _ = npy::read_npy(&folder.join("file.npy"));
            let _ = npy::read_image(&folder.join("file.npy"));
            let _ = sparse::read_file(&folder.join("file.npy"));
        },
    }
}

pub fn npz() -> Reader {
    Reader {
        name: "npz",
        file: "file.npz",
        seeds: seeds::npz,
        read: |folder| drop(sparse::read_file(&folder.join("file.npz"))),
    }
}

pub fn mtx() -> Reader {
    Reader {
        name: "mtx",
        file: "file.mtx",
        seeds: seeds::mtx,
        read: |folder| drop(sparse::read_file(&folder.join("file.mtx"))),
    }
}

pub fn mtx_gz() -> Reader {
    Reader {
        name: "mtx_gz",
        file: "file.mtx.gz",
        seeds: seeds::mtx_gz,
        read: |folder| drop(sparse::read_file(&folder.join("file.mtx.gz"))),
    }
}

pub fn mat() -> Reader {
    Reader {
        name: "mat",
        file: "file.mat",
        seeds: seeds::mat,
        read: |folder| drop(sparse::read_file(&folder.join("file.mat"))),
    }
}

pub fn png() -> Reader {
    Reader {
        name: "png",
        file: "file.png",
        seeds: seeds::png,
        read: |folder| {
            let path = folder.join("file.png");
            let _ = picture::read(&path);
            let _ = picture::read_sized(&path, Resolution::new(4, 2), "the test");
        },
    }
}

pub fn jpeg() -> Reader {
    Reader {
        name: "jpeg",
        file: "file.jpg",
        seeds: seeds::jpeg,
        read: |folder| drop(picture::read(&folder.join("file.jpg"))),
    }
}

/// The formats of patterns that no scene has; their content tells which it is.
pub fn other_picture() -> Reader {
    Reader {
        name: "other_picture",
        file: "file.tif",
        seeds: seeds::other_picture,
        read: |folder| drop(picture::read(&folder.join("file.tif"))),
    }
}

pub fn exr() -> Reader {
    Reader {
        name: "exr",
        file: "file.exr",
        seeds: seeds::exr,
        read: |folder| {
            let path = folder.join("file.exr");
            let _ = picture::stated_sizes(&path);
            let _ = exr::read_exr(&path, None);
            let _ = exr::read_exr(&path, Some("photo"));
        },
    }
}

pub fn glb() -> Reader {
    Reader {
        name: "glb",
        file: "file.glb",
        seeds: seeds::glb,
        read: |folder| drop(scene::load(&folder.join("file.glb"), None)),
    }
}

pub fn gltf() -> Reader {
    Reader {
        name: "gltf",
        file: "file.gltf",
        seeds: seeds::gltf,
        read: |folder| drop(scene::load(&folder.join("file.gltf"), None)),
    }
}

/// Meshes that are compressed by Draco or meshopt.
#[cfg(feature = "compressed")]
pub fn compressed() -> Reader {
    Reader {
        name: "compressed",
        file: "file.glb",
        seeds: seeds::compressed,
        read: |folder| drop(scene::load(&folder.join("file.glb"), None)),
    }
}

/// Formats of pictures for textures only. Files of unknown format are read as TGA, which only a file's name tells.
pub fn texture() -> Reader {
    let seeds = |folder: &Path| {
        write_scene(folder, "");
        let mtl = seeds::mtl(folder).swap_remove(0);
        let mtl = String::from_utf8_lossy(&mtl).replace("red.png", "red.tga");
        std::fs::write(folder.join("scene.mtl"), mtl).expect("the temporary folder can be written");
        seeds::texture(folder)
    };
    Reader { name: "texture", file: "red.tga", seeds, read: read_scene }
}

/// A scene of three files, of which one is mutated.
fn write_scene(folder: &Path, mutated: &str) {
    let [obj, mtl] = [seeds::obj(folder), seeds::mtl(folder)].map(|mut seeds| seeds.swap_remove(0));
    for (name, bytes) in [("scene.obj", obj), ("scene.mtl", mtl), ("scene.rig.toml", seeds::CAMERA.into())] {
        if name != mutated {
            std::fs::write(folder.join(name), bytes).expect("the temporary folder can be written");
        }
    }
}

fn read_scene(folder: &Path) {
    drop(scene::load(&folder.join("scene.obj"), None));
}

pub fn obj() -> Reader {
    let seeds = |folder: &Path| {
        write_scene(folder, "scene.obj");
        seeds::obj(folder)
    };
    Reader { name: "obj", file: "scene.obj", seeds, read: read_scene }
}

pub fn mtl() -> Reader {
    let seeds = |folder: &Path| {
        write_scene(folder, "scene.mtl");
        seeds::mtl(folder)
    };
    Reader { name: "mtl", file: "scene.mtl", seeds, read: read_scene }
}

pub fn camera_file() -> Reader {
    let seeds = |folder: &Path| {
        write_scene(folder, "scene.rig.toml");
        seeds::camera_file(folder)
    };
    Reader { name: "camera_file", file: "scene.rig.toml", seeds, read: read_scene }
}

pub fn rig() -> Reader {
    Reader {
        name: "rig",
        file: "rig.toml",
        seeds: seeds::rig,
        read: |folder| drop(RigFile::load(&folder.join("rig.toml"))),
    }
}

pub fn journal() -> Reader {
    Reader {
        name: "journal",
        file: "photos.journal",
        seeds: seeds::journal,
        read: |folder| {
            let Ok(mut journal) = Journal::read_only(folder) else { return };
            let keys: Vec<_> = journal.entries().iter().map(|entry| entry.key).collect();
            for key in keys {
                let _ = journal.get(key);
            }
            let _ = journal.read_note("a note");
            let _ = journal.verify();
        },
    }
}

/// An adapter that no machine has: the keys of its matrices are the same everywhere.
fn adapter() -> AdapterSummary {
    AdapterSummary {
        name: "none".into(),
        kind: "software".into(),
        driver: String::new(),
        driver_version: String::new(),
        max_storage_binding: 0,
        max_buffer: 0,
        max_texture_side: 0,
        double_precision: false,
    }
}

fn key() -> Key {
    let scene =
        scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/corner/scene.glb"), None);
    let settings = TraceSettings::new(Resolution::new(4, 4), 4);
    Key::new(&scene.expect("shipped scenes load"), &adapter(), &settings, Channels::Luma, false)
}

/// The name of the cached file of [`key`], which depends on the sources of the shaders.
fn cached(folder: &Path) -> std::path::PathBuf {
    folder.join(format!("{}.luma.npz", key().hex()))
}

pub fn cache() -> Reader {
    Reader {
        name: "cache",
        file: "file.npz",
        seeds: |folder| {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/corner/scene.glb");
            let scene = scene::load(&path, None).expect("shipped scenes load");
            let mut tracer = Tracer::new(&scene, None).expect("there is a Vulkan driver");
            let settings = TraceSettings::new(Resolution::new(4, 4), 4);
            let traced =
                assemble(&mut tracer, &settings, Channels::Luma).expect("shipped scenes can be traced");
            let stored = Cache::new(folder, LIMIT).store(&key(), &traced);
            assert!(stored.expect("the folder can be written"));
            vec![std::fs::read(cached(folder)).expect("it was stored")]
        },
        read: |folder| {
            std::fs::rename(folder.join("file.npz"), cached(folder)).expect("it was just written");
            let cache = Cache::new(folder, LIMIT);
            let _ = cache.entries();
            if let Found::Whole(found) = cache.load(&key()) {
                let mut photo = vec![0.0; 16];
                found.matrix.apply(krylux::transport::Part::Full, 0, &[1.0; 16], &mut photo);
            }
        },
    }
}

/// The whole of a small matrix as one shard: in one channel, and in three with bounces and the projector apart.
fn shards(folder: &Path) -> Vec<Vec<u8>> {
    let shard = |scene: &str, channels, split, settings| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(scene);
        let scene = scene::load(&path, None).expect("shipped scenes load");
        let mut tracer = Tracer::new(&scene, None).expect("there is a Vulkan driver");
        let shard = trace_shard(&mut tracer, &settings, channels, split, (1, 1));
        let key = Key::new(&scene, &adapter(), &settings, channels, split);
        let origin = ShardOrigin { key, facts: [("seed".into(), "0".into())].into() };
        let path = folder.join("seed.krylux");
        write_shard(&path, &origin, &shard.expect("shipped scenes can be traced"))
            .expect("it can be written");
        std::fs::read(path).expect("it was written")
    };
    let settings = TraceSettings::new(Resolution::new(4, 4), 2);
    let apart = TraceSettings { projector: Some(Resolution::new(5, 3)), ..settings };
    vec![
        shard("assets/scenes/corner/scene.glb", Channels::Luma, false, settings),
        shard("tests/reference/peer/separated.glb", Channels::Rgb, true, apart),
    ]
}

fn read_shard(folder: &Path) {
    let shard = ShardFile::open(&folder.join("file.krylux")).and_then(ShardFile::read);
    if let Ok(joined) = shard.and_then(|shard| join_shards(vec![shard])) {
        let matrix = joined.matrix;
        let mut photo = vec![0.0; matrix.resolution().pixels()];
        matrix.apply(
            krylux::transport::Part::Full,
            0,
            &vec![1.0; matrix.projector_resolution().pixels()],
            &mut photo,
        );
    }
}

pub fn shard() -> Reader {
    Reader { name: "shard", file: "file.krylux", seeds: shards, read: read_shard }
}

/// Shards of a stranger, who can calculate digests.
pub fn forged_shard() -> Reader {
    Reader {
        name: "forged_shard",
        file: "file.krylux",
        seeds: shards,
        read: |folder| {
            let path = folder.join("file.krylux");
            let mut bytes = std::fs::read(&path).expect("it was just written");
            if let Some(end) = bytes.len().checked_sub(32) {
                let digest = blake3::hash(&bytes[..end]);
                bytes[end..].copy_from_slice(digest.as_bytes());
                std::fs::write(&path, bytes).expect("the folder can be written");
            }
            read_shard(folder);
        },
    }
}

/// The calibration of small ideal devices.
fn write_calibration(folder: &Path) {
    let rig = RigFile::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/rigs/ideal.toml"));
    let devices = rig.expect("shipped rigs load").kind;
    let mut projector = devices.projector_info();
    let mut camera = devices.camera_info();
    (projector.resolution, camera.resolution) = (Resolution::new(4, 3), Resolution::new(4, 3));
    Calibration::ideal(&projector, &camera).save(folder).expect("the folder can be written");
}

pub fn calibration() -> Reader {
    Reader {
        name: "calibration",
        file: "calibration.toml",
        seeds: |folder| {
            write_calibration(folder);
            vec![std::fs::read(folder.join("calibration.toml")).expect("it was written")]
        },
        read: |folder| drop(Calibration::load(folder)),
    }
}

pub fn calibration_array() -> Reader {
    Reader {
        name: "calibration_array",
        file: "projector-curve.npy",
        seeds: |folder| {
            write_calibration(folder);
            vec![std::fs::read(folder.join("projector-curve.npy")).expect("it was written")]
        },
        read: |folder| drop(Calibration::load(folder)),
    }
}

fn write_model(folder: &Path) {
    let resolution = Resolution::new(2, 2);
    let direct = [DirectArrays::Image(vec![0.5; 4]), DirectArrays::None];
    let channels = direct.map(|direct| ChannelArrays {
        patterns: vec![vec![0.5; 4]; 2],
        photos: vec![vec![0.25; 4]; 2],
        direct,
        captured: None,
    });
    let model = ModelArrays {
        channels: channels.into_iter().take(1).collect(),
        ambient: Image::filled(resolution, 1, 0.0),
        resolution,
        projector: resolution,
        unit: "W/(m² sr)".into(),
        source: "a test".into(),
        symmetric: true,
    };
    model.write(folder).expect("the folder can be written");
}

pub fn model() -> Reader {
    Reader {
        name: "model",
        file: "model/model.json",
        seeds: |folder| {
            write_model(folder);
            vec![std::fs::read(folder.join("model/model.json")).expect("it was written")]
        },
        read: |folder| drop(ModelArrays::read(folder)),
    }
}

pub fn model_array() -> Reader {
    Reader {
        name: "model_array",
        file: "model/photos-0.npy",
        seeds: |folder| {
            write_model(folder);
            vec![std::fs::read(folder.join("model/photos-0.npy")).expect("it was written")]
        },
        read: |folder| drop(ModelArrays::read(folder)),
    }
}
