//! What holds for every scene that is loaded to be changed.

use std::path::Path;

use glam::DVec3;
use krylux::scene::{EditableScene, LoadOptions, Material, Scene, Triangle};

/// Asserts that the file, loaded to be changed, is the scene `loaded`, also after it was saved and loaded again.
pub fn check(path: &Path, loaded: &Scene) {
    let options = LoadOptions { auto_camera: true, ..LoadOptions::default() };
    let editable = EditableScene::load(path, &options).expect("the scene loads");
    let made = editable.to_scene(false).expect("its parts fit together");
    same(loaded, &made);
    assert_eq!((loaded.origin, loaded.hash.len()), (made.origin, made.hash.len()));
    let saved = editable.to_glb().expect("it can be written");
    let again = EditableScene::from_glb(&editable.name, &saved).expect("it can be read again");
    same(loaded, &again.to_scene(false).expect("its parts fit together"));
    assert_eq!(again.origin, DVec3::ZERO);
    assert_eq!(again.meshes.len(), editable.meshes.len());
    for (before, after) in editable.meshes.iter().zip(&again.meshes) {
        assert_eq!(
            (&before.name, &before.vertices, &before.faces),
            (&after.name, &after.vertices, &after.faces)
        );
    }
    for path in again.parameters() {
        assert_eq!(again.get(&path).ok(), editable.get(&path).ok(), "{path}");
    }
    assert_eq!(again.to_glb().expect("it can be written"), saved, "written twice");
}

/// Asserts that two scenes have the same light. Numbers of materials and textures, and their names, may differ.
fn same(a: &Scene, b: &Scene) {
    let geometry = |scene: &Scene| -> Vec<Triangle> {
        scene.triangles.iter().map(|triangle| Triangle { material: 0, ..*triangle }).collect()
    };
    assert_eq!(geometry(a), geometry(b));
    assert_eq!((&a.camera, &a.projector), (&b.camera, &b.projector));
    assert_eq!((&a.regions, a.regions_are_labels), (&b.regions, b.regions_are_labels));
    assert_eq!(a.projector_resolution, b.projector_resolution);
    for (of_a, of_b) in a.triangles.iter().zip(&b.triangles) {
        assert_eq!(surface(a, of_a), surface(b, of_b));
    }
}

/// The material of a triangle without names, and its pictures.
fn surface(scene: &Scene, triangle: &Triangle) -> String {
    let material = &scene.materials[triangle.material as usize];
    let pictures: Vec<String> = material
        .textures()
        .map(|(role, of)| {
            let texture = &scene.textures[of.texture as usize];
            let (wrap, size) = (texture.wrap, (texture.width, texture.height, texture.linear));
            format!("{role} {} {:?} {wrap:?} {size:?} {:?}", of.set, of.transform, texture.texels)
        })
        .collect();
    let mut plain = Material { name: String::new(), ..material.clone() };
    for slot in [
        &mut plain.base_color_texture,
        &mut plain.metallic_roughness_texture,
        &mut plain.normal_texture,
        &mut plain.emission_texture,
        &mut plain.specular_texture,
        &mut plain.specular_color_texture,
        &mut plain.transmission_texture,
        &mut plain.diffuse_transmission_texture,
        &mut plain.diffuse_transmission_color_texture,
    ] {
        *slot = None;
    }
    // Only a normal texture reads its scale, and only it states one in a file.
    if material.normal_texture.is_none() {
        plain.normal_scale = 1.0;
    }
    format!("{plain:?} {pictures:?}")
}
