//! Tests that `.obj` files and their material libraries are loaded into the scene or refused.

#![allow(clippy::panic, reason = "a failed test panics")]

use crate::scene_support::{Written, png, write_files};
use glam::{Vec3, vec2, vec3};
use krylux::error::Error;
use krylux::scene::{self, AlphaMode, Material, Scene, Volume, Wrap};

const RIG: &[u8] = b"[camera]
position = [0, 0, 2]
look_at = [0, 0, 0]
vertical_fov_degrees = 40
";

/// A unit square in z = 0, with texture coordinates.
const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

fn written(obj: &str, library: &str) -> Written {
    let picture = png(2, 1, &[[10, 20, 30, 255], [40, 50, 60, 255]]);
    let mask = png(1, 2, &[[255, 255, 255, 255], [0, 0, 51, 255]]);
    write_files(&[
        ("scene.obj", obj.as_bytes()),
        ("scene.rig.toml", RIG),
        ("paint.mtl", library.as_bytes()),
        ("leaf one.png", &picture),
        ("mask.png", &mask),
    ])
}

#[track_caller]
fn load(obj: &str, library: &str) -> Scene {
    let written = written(obj, library);
    scene::load(&written.path, None).unwrap_or_else(|error| panic!("the scene should load: {error}"))
}

/// The name of the file at fault and the fault.
#[track_caller]
fn fault(obj: &str, library: &str) -> (String, String) {
    match scene::load(&written(obj, library).path, None) {
        Err(Error::Scene { path, fault, .. }) => {
            (path.file_name().expect("a file").to_string_lossy().into_owned(), fault)
        }
        other => panic!("not an error about the scene: {other:?}"),
    }
}

/// The material that a library with this entry defines.
#[track_caller]
fn material(entry: &str) -> Material {
    let obj = format!("mtllib paint.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3 4/4\n");
    load(&obj, &format!("newmtl m\n{entry}\n")).materials[0].clone()
}

/// The area of all triangles.
fn area(scene: &Scene) -> f32 {
    let doubled = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).length();
    scene.triangles.iter().map(|triangle| 0.5 * doubled(triangle.positions)).sum()
}

/// A scene of one face with these corners.
fn polygon(corners: &[[f32; 3]]) -> Scene {
    let vertices: String = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    let face: String = (1..=corners.len()).map(|corner| format!(" {corner}")).collect();
    load(&format!("{vertices}f{face}\n"), "")
}

#[test]
fn a_thin_ring_of_one_face_is_no_disc() {
    // A ring cut open at one place, as modellers write it: once around outside, and back inside.
    [64, 1500].into_iter().for_each(check_ring);
}

fn check_ring(steps: usize) {
    let [outer, inner] = [1.0_f32, 0.96];
    let at = |radius: f32, step: usize| {
        let angle = std::f32::consts::TAU * step as f32 / steps as f32;
        // In a plane that is tilted against every axis.
        [radius * angle.cos(), 0.8 * radius * angle.sin(), 0.6 * radius * angle.sin()]
    };
    let around = (0..=steps).map(|step| at(outer, step));
    let corners: Vec<_> = around.chain((0..=steps).rev().map(|step| at(inner, step))).collect();
    let scene = polygon(&corners);
    let expected =
        0.5 * steps as f32 * (std::f32::consts::TAU / steps as f32).sin() * (outer * outer - inner * inner);
    assert!((area(&scene) - expected).abs() < 1e-4 * expected, "{} for {expected}", area(&scene));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn a_wall_keeps_its_window() {
    // The window is reached by a cut that is passed twice.
    let wall = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0], [0.0, 0.0]];
    let window = [[1.0, 1.0], [1.0, 2.0], [3.0, 2.0], [3.0, 1.0], [1.0, 1.0]];
    let corners: Vec<_> = wall.iter().chain(&window).map(|&[x, z]| [x, 5.0, z]).collect();
    let scene = polygon(&corners);
    assert!((area(&scene) - 10.0).abs() < 1e-4, "{}", area(&scene));
    for triangle in &scene.triangles {
        let [a, b, c] = triangle.positions;
        let center = (a + b + c) / 3.0;
        let in_window = (1.0..3.0).contains(&center.x) && (1.0..2.0).contains(&center.z);
        assert!(!in_window, "a triangle at {center} closes the window");
        // The front of the face looks towards −y, as its corners run.
        assert!((b - a).cross(c - a).y < 0.0);
    }
}

#[test]
fn concave_quads_are_cut_at_their_reflex_corner() {
    // An arrow head; a fan around its first corner would cover its notch.
    for first in 0..4 {
        let mut corners = [[0.0, 0.0, 1.0], [2.0, -1.0, 1.0], [0.5, 0.0, 1.0], [2.0, 1.0, 1.0]];
        corners.rotate_left(first);
        // Between the corners (0, 0), (2, −1), (0.5, 0) and (2, 1).
        assert!((area(&polygon(&corners)) - 0.5).abs() < 1e-6, "from corner {first}");
    }
}

#[test]
fn faces_without_a_clear_inside_give_a_warning() {
    let crossed = polygon(&[[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let expected = "1 faces cross themselves or have no area: their triangles may not cover them";
    assert_eq!(crossed.warnings.first().map(String::as_str), Some(expected));
    assert!(!crossed.triangles.is_empty());
    // A face of no area beside a good one.
    let scene = load("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nv 0 1 0\nf 1 2 3 4\nf 1 2 5\n", "");
    assert_eq!((scene.triangles.len(), scene.warnings.len()), (1, 2), "{:?}", scene.warnings);
}

#[test]
fn faces_are_triangles_and_quads_cut_at_their_first_corner() {
    let scene = load(&format!("{SQUARE}f 1 2 3 4\nf -4/-4 -3/-3 \\\n -1/-1\n"), "");
    let [a, b, c, d] = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(1.0, 1.0, 0.0), vec3(0.0, 1.0, 0.0)];
    let corners: Vec<_> = scene.triangles.iter().map(|triangle| triangle.positions).collect();
    assert_eq!(corners, [[a, b, c], [a, c, d], [a, b, d]]);
    // In the format v runs upwards; in pictures it runs downwards.
    let last = scene.triangles[2].texcoords.map(|[first, _]| first);
    assert_eq!(last, [vec2(0.0, 1.0), vec2(1.0, 1.0), vec2(0.0, 0.0)]);
    assert_eq!(scene.materials[scene.triangles[0].material as usize].base_color, Vec3::splat(0.8));
    assert_eq!(scene.camera.position, vec3(0.0, 0.0, 2.0));
}

#[test]
fn normals_and_colours_are_loaded() {
    let scene = load("v 0 0 0 1 0 0.5\nv 1 0 0\nv 0 1 0 0 0 0\nvn 0 3 4\nvn 0 0 0\nf 1//1 2//2 3\n", "");
    let triangle = &scene.triangles[0];
    assert_eq!(triangle.normals, [vec3(0.0, 0.6, 0.8), Vec3::ZERO, Vec3::ZERO]);
    assert_eq!(triangle.colors, [[65535, 0, 32768, 65535], [65535; 4], [0, 0, 0, 65535]]);
}

#[test]
fn objects_and_groups_are_regions() {
    let face = "f 1 2 3\n";
    let scene = load(&format!("{SQUARE}{face}o lid\n{face}g box lower\n{face}o empty\no lid\nf 1 3 4\n"), "");
    assert_eq!(scene.regions, ["unnamed", "lid", "box lower"]);
    assert_eq!(scene.triangles.iter().map(|triangle| triangle.region).collect::<Vec<_>>(), [0, 1, 2, 1]);
    assert!(!scene.regions_are_labels);
}

#[test]
fn matte_plastic_and_metal_are_recognized() {
    let matte = material("Kd 0.5 0.25 1\nKs 0 0 0\nNs 10\nillum 2");
    assert_eq!((matte.base_color, matte.specular, matte.metallic), (vec3(0.5, 0.25, 1.0), 0.0, 0.0));
    // Ks is ignored if the illumination model has no highlights.
    assert_eq!(material("Kd 0.5\nKs 1 1 1\nillum 1").specular, 0.0);
    let plastic = material("Kd 0.5\nKs 0.5 0.5 0.25\nNs 30\nNi 1.45\nillum 2");
    assert_eq!((plastic.specular, plastic.specular_color), (1.0, vec3(1.0, 1.0, 0.5)));
    assert_eq!((plastic.ior, plastic.base_color, plastic.metallic), (1.45, Vec3::splat(0.5), 0.0));
    // α = √(2/32) = 1/4 is the square of the roughness.
    assert_eq!(plastic.roughness, 0.5);
    let metal = material("Kd 0 0 0\nKs 0.9 0.6 0.3\nNs 30\nillum 3");
    assert_eq!((metal.base_color, metal.metallic, metal.roughness), (vec3(0.9, 0.6, 0.3), 1.0, 0.5));
    let modern = material("Kd 0.5\nKs 0.5 0.5 0.5\nPm 0.25\nPr 0.75\nKe 1 2 3");
    assert_eq!((modern.metallic, modern.roughness, modern.base_color), (0.25, 0.75, Vec3::splat(0.5)));
    assert_eq!(modern.emission, vec3(1.0, 2.0, 3.0));
}

#[test]
fn glass_is_a_solid_and_partly_opaque_materials_are_not_glass() {
    let glass = material("Kd 0 0 0\nTf 0.9 0.8 1\nNi 1.33\nillum 7\nd 0.1");
    assert_eq!((glass.transmission, glass.roughness, glass.ior), (1.0, 0.0, 1.33));
    assert_eq!((glass.base_color, glass.alpha_mode), (vec3(0.9, 0.8, 1.0), AlphaMode::Opaque));
    let clear = Volume { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY };
    assert_eq!(glass.volume, Some(clear));
    assert_eq!(material("Ni 1.5\nillum 4").transmission, 1.0);
    // Several exporters write `Tr` 1 for what covers fully; nothing else would be seen of it.
    let meshlab = material("Kd 0.5 0.5 0.5\nKs 1 1 1\nTr 1.000000\nillum 2\nNs 0.000000");
    assert_eq!((meshlab.opacity, meshlab.alpha_mode), (1.0, AlphaMode::Opaque));
    // Exporters use the illumination model of glass for all materials that are not fully opaque.
    for entry in ["d 0.25\nillum 9", "Tr 0.75\nillum 4"] {
        let sheet = material(entry);
        assert_eq!((sheet.transmission, sheet.opacity, sheet.alpha_mode), (0.0, 0.25, AlphaMode::Blend));
    }
}

#[test]
fn pictures_are_loaded_with_their_options() {
    let entry = "newmtl m\nmap_Kd -s 2 4 -o 0.5 0.25 -clamp on leaf one.png\nmap_Ke leaf one.png\n";
    let obj = format!("mtllib paint.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3\n");
    let scene = load(&obj, entry);
    let base = scene.materials[0].base_color_texture.expect("it has a picture");
    // The texture coordinate (0.25, 0.5) reads the picture at (0.5 + 0.5, 2 + 0.25). Counted from the top, v
    // is −1.25.
    assert_eq!(base.transform.transform_point2(vec2(0.25, 0.5)), vec2(1.0, -1.25));
    let texture = &scene.textures[base.texture as usize];
    assert_eq!((texture.wrap, texture.linear), ([Wrap::ClampToEdge; 2], true));
    assert_eq!(texture.texels, [[10, 20, 30, 255], [40, 50, 60, 255]]);
    let emission = scene.materials[0].emission_texture.expect("it has a picture");
    assert_eq!(scene.textures[emission.texture as usize].wrap, [Wrap::Repeat; 2]);
}

#[test]
fn opacity_maps_become_the_alpha_of_the_base_colour() {
    let texels = |entry: &str| {
        let obj = format!("mtllib paint.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3\n");
        let scene = load(&obj, &format!("newmtl m\n{entry}"));
        let material = &scene.materials[0];
        assert_eq!((material.alpha_mode, material.opacity), (AlphaMode::Blend, 1.0));
        let texture = material.base_color_texture.expect("it has a picture");
        scene.textures[texture.texture as usize].texels.clone()
    };
    // The mean of (0, 0, 51) is 17.
    assert_eq!(texels("map_d mask.png\n"), [[255; 4], [255, 255, 255, 17]]);
    // One picture has two columns and one row, the other one column and two rows. The centre of a texel of
    // the first is in the second row of the other.
    assert_eq!(texels("map_Kd leaf one.png\nmap_d mask.png\n"), [[10, 20, 30, 17], [40, 50, 60, 17]]);
    assert_eq!(texels("map_Kd leaf one.png\nmap_d leaf one.png\n"), [[10, 20, 30, 255], [40, 50, 60, 255]]);
}

#[test]
fn ignored_statements_give_warnings() {
    let scene = load(
        &format!("{SQUARE}mtllib paint.mtl\nusemtl gone\nf 1 2 3\nl 1 2\nl 2 3\ncurv 0 1 1 2\nf 1 1 2\n"),
        "newmtl m\nmap_Bump bump.png\nrefl cube.png\n",
    );
    assert_eq!(
        scene.warnings,
        [
            "points and lines have no area: ignored",
            "`curv` is not supported and ignored",
            "material `m`: `map_Bump` is not supported and ignored (line 2 of paint.mtl)",
            "material `m`: `refl` is not supported and ignored (line 3 of paint.mtl)",
            "material `gone` is in no library; its faces are matte",
            "1 triangles without area were dropped",
        ]
    );
}

#[test]
fn halos_spectra_and_xyz_colours_do_not_end_the_reading_of_a_library() {
    let scene = load(
        &format!("mtllib paint.mtl\n{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n"),
        "newmtl a\nd -halo 0.5\nKd xyz 0.4124 0.2126 0.0193\nnewmtl b\nKd spectral red.rfl\nKd spectral blue.rfl 2\nd 0.75\n",
    );
    let [a, b] = [&scene.materials[0], &scene.materials[1]];
    assert_eq!((a.opacity, b.opacity), (0.5, 0.75));
    // The primary red of sRGB, by a matrix of four digits.
    assert!((a.base_color - Vec3::X).abs().max_element() < 1e-3, "{}", a.base_color);
    let expected = "material `b`: `Kd spectral` is not supported and ignored (line 5 of paint.mtl)";
    assert_eq!(scene.warnings, [expected]);
}

#[test]
fn the_hash_covers_every_file() {
    let obj = format!("mtllib paint.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3\n");
    let entry = "newmtl m\nmap_Kd mask.png\n";
    let hash = |obj: &str, entry: &str, change: Option<(&str, &[u8])>| {
        let written = written(obj, entry);
        if let Some((name, bytes)) = change {
            std::fs::write(written.folder.path().join(name), bytes).expect("the folder is ours");
        }
        scene::load(&written.path, None).expect("it loads").hash
    };
    let first = hash(&obj, entry, None);
    assert_eq!(first, hash(&obj, entry, None));
    let picture = png(1, 1, &[[1; 4]]);
    let rig = [RIG, b"# moved"].concat();
    for other in [
        hash(&format!("{obj}#"), entry, None),
        hash(&obj, &format!("{entry}Kd 1"), None),
        hash(&obj, entry, Some(("mask.png", &picture))),
        hash(&obj, entry, Some(("scene.rig.toml", &rig))),
    ] {
        assert_ne!(first, other);
    }
}

#[test]
fn errors_about_lines_name_the_line_number() {
    for (lines, expected) in [
        ("v 0 0", "line 9: `v` takes at least three numbers"),
        ("v 0 0 nan", "line 9: `nan` is not a finite number"),
        ("v 0 0 0 1 1", "line 9: `v` takes three numbers, or six with a colour"),
        ("vt", "line 9: `vt` takes one to three numbers"),
        ("vn 1 2", "line 9: `vn` takes three numbers"),
        ("f 1 2", "line 9: a face has fewer than three corners"),
        ("f 1 2 5", "line 9: `5`: there is no such vertex; there are 4"),
        ("f 1 2 -5", "line 9: `-5`: there is no such vertex; there are 4"),
        ("f 1 2 0", "line 9: `0`: there is no such vertex; there are 4"),
        ("f 1 2 3/0", "line 9: `3/0`: there is no such texture coordinate; there are 4"),
        ("f 1 2 3//0", "line 9: `3//0`: there is no such normal; there are 0"),
        ("f 1 2 3/1/0/1", "line 9: `3/1/0/1`: there is no such normal; there are 0"),
        ("f 1 2 /1", "line 9: `/1` is no corner of a face"),
        ("", "no triangles in the scene"),
        ("v 2e9 0 0\nf 1 2 5", "a vertex at [2000000000, 0, 0] lies more than 1e9 m from the origin"),
        ("mtllib /", "mtllib: `/` is an absolute path; only files next to the scene are read"),
    ] {
        let (file, found) = fault(&format!("{SQUARE}{lines}\n"), "");
        assert_eq!((file.as_str(), found.as_str()), ("scene.obj", expected));
    }
}

#[test]
fn invalid_libraries_are_refused() {
    let obj = format!("mtllib paint.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3\n");
    for (entry, file, expected) in [
        ("Kd 1", "paint.mtl", "line 1: no `newmtl` comes before it"),
        ("newmtl m\nKd 1 1", "paint.mtl", "line 2: a colour is one or three numbers"),
        ("newmtl m\nKd -1 0 0", "paint.mtl", "line 2: a colour is negative"),
        ("newmtl m\nKd xyz 1 2", "paint.mtl", "line 2: a colour is one or three numbers"),
        ("newmtl m\nd -halo", "paint.mtl", "line 2: `-halo` is not a finite number"),
        ("newmtl m\nd 1.5", "paint.mtl", "line 2: `d` lies outside 0 to 1"),
        ("newmtl m\nNs -1", "paint.mtl", "line 2: `Ns` is negative"),
        ("newmtl m\nNs 1 2", "paint.mtl", "line 2: `Ns` takes one number"),
        ("newmtl m\nillum 11", "paint.mtl", "line 2: `illum` takes an integer from 0 to 10"),
        ("newmtl m\nmap_Kd", "paint.mtl", "line 2: `map_Kd` names no picture"),
        (
            "newmtl m\nmap_Kd -twist 1 1 1 mask.png",
            "scene.obj",
            "material `m`: `-twist 1 1 1 mask.png` has an option that is not known",
        ),
        (
            "newmtl m\nmap_Kd -s 2 2 mask.png\nmap_d mask.png",
            "scene.obj",
            "material `m`: map_Kd and map_d have different options",
        ),
    ] {
        assert_eq!(fault(&obj, entry), (file.to_string(), expected.to_string()));
    }
}

#[test]
fn a_missing_picture_or_library_is_left_out_with_a_warning_or_an_error_where_that_is_asked_for() {
    let obj = format!("{SQUARE}mtllib paint.mtl\nmtllib lost.mtl\nusemtl m\nf 1/1 2/1 3/1\n");
    let scene = written(&obj, "newmtl m\nKd 0.5 0.25 0.125\nmap_Kd gone.png");
    let strict = |strict| {
        scene::load_with(&scene.path, &scene::LoadOptions { strict, ..scene::LoadOptions::default() })
    };
    let found = strict(false).expect("what is missing is left out");
    assert!(found.textures.is_empty());
    assert_eq!(found.materials[0].base_color, vec3(0.5, 0.25, 0.125));
    for part in ["lost.mtl is missing", "material `m`: its picture", "gone.png is missing"] {
        assert!(found.warnings.iter().any(|warning| warning.contains(part)), "{part}: {:?}", found.warnings);
    }
    match strict(true) {
        Err(Error::Scene { path, .. }) => assert!(path.ends_with("lost.mtl")),
        other => panic!("not an error about the scene: {other:?}"),
    }
}

#[test]
fn weights_of_vertices_and_normals_that_are_not_there_are_ignored() {
    let [plain, loose] = ["f 1 2 3\n", "v 9 9 9 2\nf 1//7 2//-3 3//9\n"].map(|faces| {
        let scene = written(&format!("{SQUARE}{faces}"), "");
        scene::load(&scene.path, None).expect("it can be read")
    });
    assert_eq!(plain.triangles[0].positions, loose.triangles[0].positions);
    assert_eq!(plain.triangles[0].normals, loose.triangles[0].normals);
    let said = loose.warnings.join("; ");
    assert!(
        said.contains("weights of vertices") && said.contains("normals that the file does not have"),
        "{said}"
    );
}
