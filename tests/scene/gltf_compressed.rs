//! Compressed meshes, written by another program, equal the meshes of the file that was compressed.

use std::path::{Path, PathBuf};

use glam::Vec3;
use krylux::scene::{self, Scene};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::scene_support::write_bytes;

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/compressed").join(name)
}

fn plain() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/carton/scene.glb");
    scene::load(&path, None).expect("shipped scenes load")
}

/// The centre of each triangle, and its normal times twice its area.
fn shapes(scene: &Scene) -> Vec<[Vec3; 2]> {
    let shape = |[a, b, c]: [Vec3; 3]| [(a + b + c) / 3.0, (b - a).cross(c - a)];
    scene.triangles.iter().map(|triangle| shape(triangle.positions)).collect()
}

/// Asserts that a scene has the triangles of the carton in any order, with corners moved by at most `moved` metres.
fn is_the_carton(name: &str, moved: f32) {
    let (plain, found) = (plain(), scene::load(&path(name), None).expect("it is whole"));
    let (plain_shapes, found_shapes) = (shapes(&plain), shapes(&found));
    assert_eq!(plain_shapes.len(), found_shapes.len(), "{name}");
    for [center, normal] in plain_shapes {
        let near = |[other, _]: &&[Vec3; 2]| other.distance(center) <= moved;
        // A side of at most 2 cm, moved at both ends, changes the product of two sides by at most four times this.
        let same = |[_, other]: &[Vec3; 2]| other.distance(normal) <= 4.0 * 0.02 * moved;
        assert!(found_shapes.iter().filter(near).any(same), "{name}: a triangle at {center} is missing");
    }
    assert_eq!(found.regions, plain.regions, "{name}");
    assert!(found.warnings.is_empty(), "{name}: {:?}", found.warnings);
    assert!(found.camera.position.distance(plain.camera.position) < 1e-6, "{name}");
}

#[test]
fn draco_meshes_are_decompressed() {
    // Positions have 14 bits by default. The largest mesh is less than 0.6 m wide.
    is_the_carton("carton-draco.glb", 0.6 / 16384.0);
}

#[test]
fn meshopt_buffers_are_decompressed() {
    // Positions have 14 bits by default here, too.
    is_the_carton("carton-meshopt.glb", 0.6 / 16384.0);
}

#[test]
fn damaged_compressed_meshes_are_scenes_or_errors() {
    let mut random = Pcg64::seed_from_u64(7);
    for name in ["carton-draco.glb", "carton-meshopt.glb"] {
        let whole = std::fs::read(path(name)).expect("it is shipped");
        // The binary chunk begins after the JSON chunk, whose length is at byte 12.
        let json = u32::from_le_bytes([whole[12], whole[13], whole[14], whole[15]]) as usize;
        let mut errors = 0;
        for _ in 0..200 {
            let mut bytes = whole.clone();
            for _ in 0..random.random_range(1..4) {
                let at = random.random_range(28 + json..whole.len());
                bytes[at] = random.random();
            }
            let written = write_bytes("scene.glb", &bytes);
            errors += usize::from(scene::load(&written.path, None).is_err());
        }
        assert!(errors > 0, "{name}: some damage is noticed");
    }
}
