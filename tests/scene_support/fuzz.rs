//! The properties of every scene that loads, and the number of mutated files that are tried.

use krylux::scene::{Camera, Scene};
use proptest::prelude::ProptestConfig;

/// Repeatable in the test suite; `KRYLUX_FUZZ_CASES` overrides the number of cases of each property.
pub fn config() -> ProptestConfig {
    let cases = std::env::var("KRYLUX_FUZZ_CASES").ok().and_then(|cases| cases.parse().ok());
    ProptestConfig {
        cases: cases.unwrap_or(2000),
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Asserts what the scene's types promise.
pub fn check(scene: &Scene) {
    assert!(!scene.triangles.is_empty());
    for triangle in &scene.triangles {
        assert!(triangle.positions.iter().all(|position| position.is_finite()));
        assert!(triangle.texcoords.as_flattened().iter().all(|coordinates| coordinates.is_finite()));
        for normal in triangle.normals {
            // The rounding of a unit vector in single precision.
            assert!(normal.length() == 0.0 || (normal.length() - 1.0).abs() < 1e-6, "{normal}");
        }
        assert!((triangle.material as usize) < scene.materials.len());
        assert!((triangle.region as usize) < scene.regions.len());
    }
    for material in &scene.materials {
        let fractions = [
            material.base_color.to_array().as_slice(),
            &[material.opacity, material.metallic, material.roughness, material.specular],
            &[material.transmission, material.diffuse_transmission],
            material.diffuse_transmission_color.to_array().as_slice(),
        ]
        .concat();
        assert!(fractions.iter().all(|fraction| (0.0..=1.0).contains(fraction)), "{material:?}");
        for color in [material.specular_color, material.emission] {
            assert!(color.is_finite() && color.min_element() >= 0.0, "{material:?}");
        }
        assert!(material.ior == 0.0 || material.ior >= 1.0, "{material:?}");
        if let Some(volume) = material.volume {
            let absorption = volume.absorption();
            assert!(absorption.is_finite() && absorption.min_element() >= 0.0, "{material:?}");
        }
        for (_, texture) in material.textures() {
            assert!((texture.texture as usize) < scene.textures.len());
            assert!(texture.set < 2 && texture.transform.is_finite());
        }
    }
    for texture in &scene.textures {
        assert_eq!(texture.texels.len(), texture.width as usize * texture.height as usize);
        assert!(!texture.texels.is_empty());
    }
    check_camera(&scene.camera);
    if let Some(projector) = &scene.projector {
        check_camera(projector);
    }
}

fn check_camera(camera: &Camera) {
    assert!((camera.right.cross(camera.up) + camera.forward).length() < 1e-5, "{camera:?}");
    assert!(camera.position.is_finite(), "{camera:?}");
    assert!(camera.tan_half_fov > 0.0 && camera.tan_half_fov.is_finite(), "{camera:?}");
    assert!(camera.lens.radius >= 0.0 && camera.lens.radius.is_finite(), "{camera:?}");
    assert!(camera.lens.focus > 0.0 && camera.lens.focus.is_finite(), "{camera:?}");
}
