//! Lists of what the pinhole sees, and rays that test every pair of triangles, against the search tree: the same paths, to the last bit.

use glam::Vec3;

use super::path_records::{PathRecord, path_records};
use crate::image::Resolution;
use crate::render::{TraceSettings, Tracer};
use crate::scene::{Scene, Triangle, builtin};

/// How rays find what they hit.
#[derive(Clone, Copy)]
struct By {
    /// Those from and to the pinhole by its lists.
    light_buffer: bool,
    /// The others by testing every pair of triangles.
    each: bool,
}

const TREE: By = By { light_buffer: false, each: false };

/// All paths of a scene, by the lists, by every pair or by the tree.
fn paths(scene: &Scene, settings: &TraceSettings, by: By) -> Vec<PathRecord> {
    let mut tracer = Tracer::new(scene, None).expect("the README's test command installs a Vulkan driver");
    let pairs = tracer.strategy_builder().scene.pairs_in_order.len() as u32;
    let mut strategies = tracer.strategy_builder().strategies(settings).expect("the settings are sound");
    assert_eq!(strategies.len(), 1, "{}: a coaxial pinhole", scene.path.display());
    let strategy = &mut strategies[0];
    assert!(
        strategy.features.light_buffer_side > 0,
        "{}: nothing here lets light straight through",
        scene.path.display()
    );
    if !by.light_buffer {
        strategy.features.light_buffer_side = 0;
    }
    strategy.features.scene.few_pairs = if by.each { pairs } else { 0 };
    path_records(&mut tracer, strategy)
}

fn shipped(name: &str) -> Scene {
    let path =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes").join(name).join("scene.glb");
    crate::scene::load(&path, None).expect("shipped scenes load")
}

#[test]
fn every_triangle_tested_finds_what_the_tree_finds() {
    // Few triangles and more, with a mirror, and with a ceiling that rays meet at all angles.
    for scene in [shipped("corner"), shipped("mirror"), shipped("zigzag"), shipped("cornell")] {
        let settings = TraceSettings::new(Resolution::new(56, 40), 16);
        let [each, tree] =
            [By { light_buffer: false, each: true }, TREE].map(|by| paths(&scene, &settings, by));
        assert_eq!(tree.len(), 56 * 40 * 16);
        let different = each.iter().zip(&tree).filter(|(a, b)| a != b).count();
        assert_eq!(different, 0, "{}, of {} paths", scene.path.display(), tree.len());
    }
}

#[test]
fn lists_find_what_the_tree_finds() {
    let scenes = [
        shipped("zigzag"),
        shipped("carton"),
        shipped("cornell"),
        shipped("mirror"),
        builtin::tessellated_box(1000),
        builtin::tessellated_box(100_000),
    ];
    for scene in &scenes {
        // Not square, so that both tangents count.
        let settings = TraceSettings::new(Resolution::new(56, 40), 16);
        let [with, without] =
            [By { light_buffer: true, each: false }, TREE].map(|by| paths(scene, &settings, by));
        assert_eq!(with.len(), 56 * 40 * 16);
        let different = with.iter().zip(&without).filter(|(a, b)| a != b).count();
        assert_eq!(different, 0, "{}, of {} paths", scene.path.display(), with.len());
    }
}

#[test]
fn a_small_trees_layout_finds_what_a_large_ones_does() {
    for small in [shipped("cornell"), shipped("carton")] {
        let mut large = small.clone();
        // Without an area, so that no ray meets them; and apart, so that the tree is not too deep.
        large.triangles.extend((0..20_000).map(|at| {
            let corner = Vec3::new(10.0 + at as f32, 10.0, 10.0);
            Triangle::flat([corner, corner + 0.1, corner + 0.2], 0, 0)
        }));
        let settings = TraceSettings::new(Resolution::new(40, 56), 16);
        let layout = |scene: &Scene| {
            let mut tracer = Tracer::new(scene, None).expect("the README's test command installs a driver");
            tracer.strategy_builder().strategies(&settings).expect("sound settings")[0]
                .features
                .scene
                .small_tree
        };
        assert!(layout(&small) && !layout(&large), "{}", small.path.display());
        let [of_small, of_large] = [&small, &large].map(|scene| paths(scene, &settings, TREE));
        let different = of_small.iter().zip(&of_large).filter(|(a, b)| a != b).count();
        assert_eq!((of_small.len(), different), (40 * 56 * 16, 0), "{}", small.path.display());
    }
}
