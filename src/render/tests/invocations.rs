//! However many paths one invocation takes, each path is the same, to the last bit.

use glam::Vec3;

use super::path_records::{PathRecord, path_records};
use crate::image::Resolution;
use crate::render::{TraceSettings, Tracer};
use crate::scene::{Scene, Triangle, builtin};

/// All paths of either end, when an invocation takes so many.
fn paths(scene: &Scene, settings: &TraceSettings, each: u32, by_light_buffer: bool) -> Vec<PathRecord> {
    let mut tracer = Tracer::new(scene, None).expect("the README's test command installs a Vulkan driver");
    let mut strategies = tracer.strategy_builder().strategies(settings).expect("the settings are sound");
    let mut all = Vec::new();
    for strategy in &mut strategies {
        strategy.features.several_paths = each > 1;
        strategy.max_paths_per_invocation = each;
        if !by_light_buffer {
            strategy.features.light_buffer_side = 0;
        }
        all.extend(path_records(&mut tracer, strategy));
    }
    all
}

#[test]
fn a_path_is_the_same_in_whatever_invocation() {
    let mirror_ball = builtin::mirror_ball().to_scene();
    let apart = Scene { projector: Some(Scene::clone(&mirror_ball).camera), ..builtin::carton().to_scene() };
    let scenes = [
        (builtin::carton().to_scene(), true),
        (builtin::carton().to_scene(), false),
        (mirror_ball, true),
        (apart, false),
    ];
    for (scene, by_light_buffer) in &scenes {
        // So many samples that pixels begin and end amid an invocation's paths, and its last ones are none.
        let settings = TraceSettings::new(Resolution::new(41, 30), 13);
        let one = paths(scene, &settings, 1, *by_light_buffer);
        assert!(one.len() >= 41 * 30 * 13);
        for each in [3, 64] {
            let several = paths(scene, &settings, each, *by_light_buffer);
            assert!(
                one == several,
                "{}, by lists: {by_light_buffer}, {each} paths each",
                scene.path.display()
            );
        }
    }
}

/// A wall, and before it so many strips one behind another, as broad as the field of view and lower than anything that a list of what
/// the pinhole sees tells apart: whatever goes there has to be tested against each.
fn strips(count: usize) -> Scene {
    let mut scene = builtin::plane(1.0, 0.8);
    scene.triangles.extend((0..count).map(|at| {
        let z = -0.5 - 1e-6 * at as f32;
        let corners = [Vec3::new(-1.0, 1e-4, z), Vec3::new(1.0, 1e-4, z), Vec3::new(0.0, 2e-4, z)];
        Triangle::flat(corners, 0, 0)
    }));
    scene
}

#[test]
fn paths_with_too_long_a_way_for_one_invocation_get_one_each() {
    // Some sixty paths of an invocation's meet eight thousand strips each; software Vulkan ends it at 65,535 turns.
    let scene = strips(8000);
    let settings = TraceSettings::new(Resolution::new(64, 64), 32);
    let [one, many] = [1, 64].map(|each| paths(&scene, &settings, each, true));
    assert!(!one.is_empty() && one == many);
}
