//! `.obj` files and their libraries as exporters write them.

use glam::Vec3;
use krylux::scene;

use super::{FACE, obj, warns};
use crate::scene_support::{png, write_bytes};

#[test]
fn paths_of_another_computer_lead_to_the_file_of_that_name_beside_the_scene() {
    let dot = png(1, 1, &[[9, 9, 9, 255]]);
    let text = format!("mtllib C:\\Users\\me\\m.mtl\n{FACE}usemtl m\nf 1/1 2/2 3/3\n");
    for picture in ["/home/me/dot.png", "D:\\textures\\dot.png", "https://example.org/dot.png"] {
        let library = format!("newmtl m\nmap_Kd {picture}\n");
        let scene = obj(&[("scene.obj", text.as_bytes()), ("m.mtl", library.as_bytes()), ("dot.png", &dot)]);
        assert_eq!(scene.textures.len(), 1, "{picture}");
        let scene = obj(&[("scene.obj", text.as_bytes()), ("m.mtl", library.as_bytes())]);
        assert!(scene.textures.is_empty(), "{picture}");
        warns(&scene, "dot.png is missing");
    }
}

#[test]
fn names_of_libraries_may_have_spaces_and_comments_behind_them() {
    let material = b"newmtl red paint # 1\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n".as_slice();
    for line in [
        "my colours.mtl # of the house",
        "other.mtl my colours.mtl",
        "lost colours.mtl my\\ colours.mtl",
        "my colours.mtl",
    ] {
        let text = format!("mtllib {line}\n{FACE}usemtl red paint # here\nf 1 2 3\nusemtl blue\nf 1 3 2\n");
        let scene = obj(&[("scene.obj", text.as_bytes()), ("my colours.mtl", material), ("other.mtl", b"")]);
        let colors: Vec<Vec3> = scene
            .triangles
            .iter()
            .map(|triangle| scene.materials[triangle.material as usize].base_color)
            .collect();
        assert_eq!(colors, [Vec3::X, Vec3::Z], "{line}");
    }
    // A library that is missing is named as a whole.
    let text = format!("mtllib my lost colours.mtl other.mtl\n{FACE}f 1 2 3\n");
    let scene = obj(&[("scene.obj", text.as_bytes()), ("other.mtl", b"")]);
    warns(&scene, "my lost colours.mtl is missing");
}

#[test]
fn a_material_without_a_name_is_one() {
    let text = format!("mtllib m.mtl\n{FACE}usemtl\nf 1 2 3\n");
    let scene = obj(&[("scene.obj", text.as_bytes()), ("m.mtl", b"newmtl \nKd 1 0 0\n")]);
    assert_eq!(scene.materials[scene.triangles[0].material as usize].base_color, Vec3::X);
}

#[test]
fn a_picture_on_black_is_the_picture() {
    let text = format!("mtllib m.mtl\n{FACE}usemtl m\nf 1/1 2/2 3/3\n");
    let library = b"newmtl m\nKd 0 0 0\nmap_Kd dot.png\n";
    let dot = png(1, 1, &[[9, 9, 9, 255]]);
    let scene = obj(&[("scene.obj", text.as_bytes()), ("m.mtl", library), ("dot.png", &dot)]);
    assert_eq!(scene.materials[0].base_color, Vec3::ONE);
}

#[test]
fn options_of_maps_that_do_not_matter_here_are_read_past() {
    let text = format!("mtllib m.mtl\n{FACE}usemtl m\nf 1/1 2/2 3/3\n");
    let dot = png(1, 1, &[[9, 9, 9, 255]]);
    let library = b"newmtl m\nmap_Kd -colorspace sRGB -type sphere -mm 0.1 2 -imfchan r -t 1 1 1 dot.png\n";
    let scene = obj(&[("scene.obj", text.as_bytes()), ("m.mtl", library), ("dot.png", &dot)]);
    assert_eq!(scene.textures.len(), 1);
    for option in ["-mm", "-imfchan", "-t"] {
        warns(&scene, &format!("the option {option} of"));
    }
}

#[test]
fn obj_files_in_utf_16_are_read() {
    let text = format!("{FACE}g Wände\nf 1 2 3\n");
    let wide = |bytes: fn(u16) -> [u8; 2]| {
        let units = std::iter::once(0xFEFF).chain(text.encode_utf16());
        units.flat_map(bytes).collect::<Vec<u8>>()
    };
    for bytes in [wide(u16::to_be_bytes), wide(u16::to_le_bytes)] {
        let scene = obj(&[("scene.obj", &bytes)]);
        assert_eq!((scene.triangles.len(), scene.regions.as_slice()), (1, ["Wände".to_owned()].as_slice()));
    }
}

#[test]
fn a_file_of_points_or_lines_says_so() {
    let written = write_bytes("scene.obj", b"v 0 0 0\nv 1 0 0\nl 1 2\np 1\n");
    let error = scene::load(&written.path, None).expect_err("it has no faces").to_string();
    assert!(error.contains("but points or lines, which have no area"), "{error}");
}
