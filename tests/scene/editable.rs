//! Tests of scenes that a program makes or changes. `scene_support::editable` holds for every document of the other tests.

use std::path::Path;

use glam::{Vec2, Vec3, vec3};
use krylux::error::Error;
use krylux::scene::{self, EditableScene, LoadOptions, Mesh, Value, builtin};
use proptest::prelude::*;

use crate::scene_support::{editable, write_files};

#[test]
fn shipped_scenes_can_be_changed_and_saved() {
    for model in builtin::shipped() {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes").join(model.name).join("scene.glb");
        editable::check(&path, &scene::load(&path, None).expect("shipped scenes load"));
        let made = model.editable().to_scene(false).expect("a shipped model fits together");
        assert_eq!(made.triangles, model.to_scene().triangles, "{}", model.name);
    }
}

#[test]
fn an_obj_file_can_be_changed_and_saved() {
    let text = "v 0 0 -2\nv 1 0 -2\nv 0 1 -2\nv 1 1 -2\no sheet\nf 1 2 3\no other\nf 2 4 3\n";
    let camera = "[camera]\nposition = [0.3, 0.2, 1]\nlook_at = [0.1, 0, -2]\nvertical_fov_degrees = 50";
    let written = write_files(&[("a.obj", text.as_bytes()), ("a.rig.toml", camera.as_bytes())]);
    editable::check(&written.path, &scene::load(&written.path, None).expect("it loads"));
    let scene = EditableScene::load(&written.path, &LoadOptions::default()).expect("it loads");
    assert_eq!(scene.meshes.iter().map(|mesh| mesh.name.as_str()).collect::<Vec<_>>(), ["sheet", "other"]);
}

/// A mesh of random triangles, with everything that a mesh can have.
fn mesh(name: &'static str) -> impl Strategy<Value = Mesh> {
    let corner = || (-2.0_f32..2.0, -2.0_f32..2.0, -6.0_f32..-2.0).prop_map(Vec3::from);
    let number = || prop_oneof![Just(0.0_f32), Just(1.0), -3.0_f32..3.0];
    let normal = (number(), number(), number())
        .prop_map(|normal| Vec3::from(normal).as_dvec3().normalize_or_zero().as_vec3());
    let vertex = (corner(), normal, (number(), number()).prop_map(Vec2::from), any::<[u16; 4]>());
    (prop::collection::vec(vertex, 3..9), any::<[bool; 3]>(), prop::collection::vec(any::<[u8; 3]>(), 1..9))
        .prop_map(move |(vertices, [normals, uv, colors], faces)| {
            let count = vertices.len() as u32;
            let face = |[a, b, c]: [u8; 3]| {
                // Two different steps around give three different vertices.
                let (first, step) = (u32::from(a), 1 + u32::from(b) % (count - 2));
                [
                    first % count,
                    (first + step) % count,
                    (first + step + 1 + u32::from(c) % (count - 1 - step)) % count,
                ]
            };
            Mesh {
                vertices: vertices.iter().map(|vertex| vertex.0).collect(),
                normals: vertices.iter().filter(|_| normals).map(|vertex| vertex.1).collect(),
                texcoords: [vertices.iter().filter(|_| uv).map(|vertex| vertex.2).collect(), Vec::new()],
                colors: vertices.iter().filter(|_| colors).map(|vertex| vertex.3).collect(),
                faces: faces.into_iter().map(face).collect(),
                ..Mesh::new(name)
            }
        })
}

fn any_scene() -> impl Strategy<Value = EditableScene> {
    let factors = prop::collection::vec((0_usize..10, 0.0_f64..=1.0), 0..6);
    let pose = (any::<[i8; 6]>(), 5.0_f64..170.0, any::<bool>());
    (mesh("one"), mesh("two"), factors, prop::collection::vec(pose, 1..3)).prop_map(|(one, two, factors, poses)| {
        let mut scene = EditableScene::new("any");
        for mesh in [one, two] {
            scene.add_mesh(mesh, None).expect("the names differ");
        }
        const NAMES: [&str; 10] = [
            "one.albedo", "one.roughness", "two.metallic", "two.specular", "one.transmission", "two.emission",
            "one.attenuation_color", "two.opacity", "one.diffuse_transmission", "two.specular_color",
        ];
        for (name, value) in factors {
            scene.set(NAMES[name], value).expect("fractions are in range");
        }
        for (role, (at, field, is_open)) in ["camera", "projector"].into_iter().zip(poses) {
            let [x, y, z, a, b, c] = at.map(|step| f64::from(step) / 100.0);
            let lens = if is_open { format!(r#", "aperture_radius": {}, "focus_distance": 3.7"#, 0.01 + x.abs()) } else { String::new() };
            let json = format!(
                r#"{{"position": [{x}, {y}, {z}], "look_at": [{a}, {b}, -4], "up": [{c}, 1, 0.1], "vertical_fov": {field}{lens}}}"#
            );
            scene.place(role, &json).expect("it looks forwards");
        }
        scene
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_saved_scene_is_read_to_the_last_bit(scene in any_scene()) {
        // Random corners may lie in a line.
        let Ok(made) = scene.to_scene(false) else { return Ok(()) };
        let saved = scene.to_glb().expect("a scene that is traced can be saved");
        let again = EditableScene::from_glb("any", &saved).expect("it is read");
        prop_assert_eq!(&again.meshes, &scene.meshes);
        prop_assert_eq!(&again.materials, &scene.materials);
        prop_assert_eq!((&again.camera, &again.projector), (&scene.camera, &scene.projector));
        prop_assert_eq!(again.parameters(), scene.parameters());
        prop_assert_eq!(again.to_scene(false).map(|scene| scene.hash).ok(), Some(made.hash));
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("any.glb");
        scene.save(&path).expect("the folder is ours");
        let loaded = scene::load(&path, None).expect("it loads");
        prop_assert_eq!(loaded.triangles, made.triangles);
        prop_assert_eq!((loaded.camera, loaded.projector), (made.camera, made.projector));
    }
}

#[test]
fn a_texture_that_is_shared_changes_for_one_material_only() {
    let corners = [vec3(0.0, 0.0, -2.0), vec3(1.0, 0.0, -2.0), vec3(0.0, 1.0, -2.0)];
    let mut scene = EditableScene::new("pictures");
    for name in ["one", "two"] {
        let texcoords = [vec![Vec2::ZERO, Vec2::X, Vec2::Y], Vec::new()];
        let mesh = Mesh { vertices: corners.to_vec(), faces: vec![[0, 1, 2]], texcoords, ..Mesh::new(name) };
        scene.add_mesh(mesh, None).expect("the names differ");
    }
    let picture = |level: u8| Value::Picture { width: 1, texels: vec![[level; 4]] };
    scene.set("one.albedo_texture", picture(1)).expect("there is a material");
    scene.materials[1].base_color_texture = scene.materials[0].base_color_texture;
    scene.set("two.albedo_texture", picture(2)).expect("there is a material");
    assert_eq!(scene.get("one.albedo_texture").ok(), Some(picture(1)));
    assert_eq!(scene.get("two.albedo_texture").ok(), Some(picture(2)));
    scene.set("two.albedo_texture", picture(3)).expect("there is a material");
    assert_eq!(scene.textures.len(), 2, "a texture of one material is replaced");
}

#[test]
fn errors_name_the_parameter_and_the_nearest_ones() {
    let mut scene = builtin::cornell().editable();
    let Err(Error::Option { option, help, .. }) = scene.set("wite.albedo", 0.5) else {
        panic!("it is refused")
    };
    assert_eq!(
        (option.as_str(), help.starts_with("the nearest are white.albedo")),
        ("wite.albedo", true),
        "{help}"
    );
    assert!(
        matches!(scene.set("white.albedo", 1.5), Err(Error::Option { option, .. }) if option == "white.albedo")
    );
    scene.meshes[0].faces[0][1] = 999;
    assert!(matches!(scene.to_glb(), Err(Error::Option { option, .. }) if option == "white.faces"));
}
