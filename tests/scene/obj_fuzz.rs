//! Fuzz tests of the `.obj` loader: for any content of the file, its libraries and its camera file, loading
//! ends with a scene or an error.
//!
//! `KRYLUX_FUZZ_CASES=100000 cargo test --release --test scene obj_fuzz` tests more cases.

#![allow(clippy::panic, reason = "a failed test panics")]

use crate::scene_support::{self, fuzz};
use krylux::scene;
use proptest::prelude::*;

const OBJ: &str = "mtllib a.mtl b.mtl
o left
v 0 0 -2
v 1 0 -2 1
v 0 1 -2
v 1 1 -2 0.5 0.25 1
vt 0 0
vt 1 0 0
vt 0 1
vn 0 0 1
usemtl glass
s off
f 1/1/1 2/2/1 3//1 \\
  4
g right
usemtl leaf
f -4/-3 -3/-2 -2/-1
f 1/1 2/2 4/3
l 1 2
";

const FIRST: &str = "# glass
newmtl glass
Kd 0 0 0
Tf 0.9 0.9 1
Ni 1.5
illum 7
Ns 100
newmtl other
Ka 1 1 1
Pm 1
Pr 0.25
Ke 1 2 3
";

const SECOND: &str = "newmtl leaf
Kd 0.5
Ks 0.5 0.5 0.5
Ns 20
Tr 0.25
map_Kd -s 2 2 1 -o 0.5 0.5 -clamp on leaf.png
map_d -s 2 2 1 -o 0.5 0.5 -clamp on leaf.png
norm leaf.png
";

const RIG: &str = "[camera]
position = [0.5, 0.5, 1.0]
look_at = [0.5, 0.5, -2.0]
vertical_fov_degrees = 40
aperture_radius = 0.01
focus_distance = 3.0

[projector]
position = [0, 0, 1]
forward = [0, 0, -1]
up = [1, 0, 0]
vertical_fov_degrees = 30.5
resolution = [64, 48]
";

const FILES: [(&str, &str); 4] =
    [("scene.obj", OBJ), ("a.mtl", FIRST), ("b.mtl", SECOND), ("scene.rig.toml", RIG)];

/// Loads the scene with the content of one file replaced.
fn load(file: usize, bytes: &[u8]) -> krylux::Result<scene::Scene> {
    let picture = scene_support::png(2, 1, &[[1, 2, 3, 255], [4, 5, 6, 0]]);
    let mut files = FILES.map(|(name, text)| (name, text.as_bytes())).to_vec();
    files[file].1 = bytes;
    files.push(("leaf.png", &picture));
    let written = scene_support::write_files(&files);
    scene::load(&written.path, None)
}

fn check(file: usize, bytes: &[u8]) {
    if let Ok(scene) = load(file, bytes) {
        fuzz::check(&scene);
    }
}

/// Words that mutations insert.
fn hostile() -> impl Strategy<Value = String> {
    prop_oneof![
        prop::sample::select(vec![
            "",
            "#",
            "\\",
            "\n",
            "nan",
            "inf",
            "-inf",
            "1e39",
            "-1",
            "0",
            "1/2/3/4",
            "//",
            "1//",
            "/1",
            "-9/-9/-9",
            "99999999999999999999",
            "9223372036854775807",
            "-9223372036854775808",
            "mtllib",
            "usemtl",
            "newmtl",
            "map_Kd",
            "-o",
            "-s",
            "-clamp",
            "on",
            "/etc",
            "..",
            "C:x",
            "spectral",
            "f",
            "v",
            "o",
            "é\u{a0}",
            "[",
            "]",
            "=",
            "\"",
            "{}",
        ])
        .prop_map(String::from),
        any::<i64>().prop_map(|number| number.to_string()),
        any::<f64>().prop_map(|number| number.to_string()),
        "\\PC{0,6}",
    ]
}

#[test]
fn the_unchanged_files_load() {
    let scene = load(0, OBJ.as_bytes()).expect("mutations must start from files that load");
    assert_eq!((scene.triangles.len(), scene.materials.len(), scene.textures.len()), (4, 3, 2));
    assert!(scene.projector.is_some() && scene.camera.lens.radius > 0.0);
    fuzz::check(&scene);
}

proptest! {
    #![proptest_config(fuzz::config())]

    #[test]
    fn changed_bytes_never_crash_the_loader(
        file in 0..FILES.len(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in prop::option::weighted(0.1, any::<prop::sample::Index>()),
    ) {
        let mut bytes = FILES[file].1.as_bytes().to_vec();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        check(file, &bytes);
    }

    #[test]
    fn changed_words_never_crash_the_loader(
        file in 0..FILES.len(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), hostile()), 1..5),
    ) {
        // Each word includes the white space after it, which is not changed, so that the line structure
        // stays.
        let mut words: Vec<String> =
            FILES[file].1.split_inclusive(char::is_whitespace).map(String::from).collect();
        for (at, with) in changes {
            let at = at.index(words.len());
            let gap: String = words[at].chars().last().filter(|last| last.is_whitespace()).into_iter().collect();
            words[at] = with + &gap;
        }
        check(file, words.concat().as_bytes());
    }

    #[test]
    fn faces_of_any_shape_keep_their_area(
        radii in prop::collection::vec(0.05_f32..1.0, 4..60),
        [pitch, yaw] in prop::array::uniform2(-3.0_f32..3.0),
    ) {
        // Seen from the origin every corner is in plain sight, so that the sectors add up to the area.
        let step = std::f32::consts::TAU / radii.len() as f32;
        let turn = glam::Mat3::from_euler(glam::EulerRot::XYZ, pitch, yaw, 0.0);
        let corners = radii.iter().zip(0_u8..).map(|(&radius, at)| {
            turn * (radius * glam::Vec2::from_angle(f32::from(at) * step)).extend(0.0)
        });
        let vertices: String = corners.map(|corner| format!("v {} {} {}\n", corner.x, corner.y, corner.z)).collect();
        let face: String = (1..=radii.len()).map(|corner| format!(" {corner}")).collect();
        let scene = load(0, format!("{vertices}f{face}\n").as_bytes()).expect("it is a whole scene");
        let next = radii.iter().cycle().skip(1);
        let expected: f32 = radii.iter().zip(next).map(|(a, b)| 0.5 * a * b * step.sin()).sum();
        let area: f32 = scene.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.positions;
            0.5 * (b - a).cross(c - a).length()
        }).sum();
        prop_assert!((area - expected).abs() < 1e-5, "{area} for {expected}");
    }

    #[test]
    fn faces_with_any_corners_never_crash_the_loader(
        corners in prop::collection::vec(prop::array::uniform3(0_u8..4), 3..16),
    ) {
        let vertices: String = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
        let face: String = (1..=corners.len()).map(|corner| format!(" {corner}")).collect();
        check(0, format!("{vertices}f{face}\n").as_bytes());
    }
}
