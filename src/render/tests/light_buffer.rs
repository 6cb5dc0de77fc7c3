//! The light buffer, and tests of every pair of triangles, against the search tree: all give the same paths,
//! to the last bit.

use super::path_records::{PathRecord, path_records};
use crate::image::Resolution;
use crate::render::unit::Unit;
use crate::render::{TraceSettings, Tracer};
use crate::scene::{Scene, Triangle, builtin};

/// The method by which rays find their hits.
#[derive(Clone, Copy)]
struct By {
    /// Rays from and to the pinhole use the light buffer.
    light_buffer: bool,
    /// The other rays test every pair of triangles.
    each: bool,
}

const TREE: By = By { light_buffer: false, each: false };

/// All paths of a scene, by this method.
fn paths(scene: &Scene, settings: &TraceSettings, by: By) -> Vec<PathRecord> {
    let mut tracer = Tracer::new(scene, None).expect("the README's test command installs a Vulkan driver");
    let pairs = tracer.strategy_builder().scene.pairs_in_order.len() as u32;
    let mut strategies = tracer.strategy_builder().strategies(settings).expect("the settings are sound");
    assert_eq!(strategies.len(), 1, "{}: a coaxial pinhole", scene.path.display());
    let strategy = &mut strategies[0];
    assert!(
        strategy.features.light_buffer_side > 0,
        "{}: no surface here lets light pass straight through",
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
fn testing_every_pair_gives_the_hits_of_the_search_tree() {
    // Scenes of a few and of more triangles, with a mirror, and with a ceiling that rays meet at all angles.
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
fn the_light_buffer_gives_the_hits_of_the_search_tree() {
    let scenes = [
        shipped("zigzag"),
        shipped("carton"),
        shipped("cornell"),
        shipped("mirror"),
        builtin::tessellated_box(1000),
        builtin::tessellated_box(100_000),
    ];
    for scene in &scenes {
        // The image is not square, so that both tangents matter.
        let settings = TraceSettings::new(Resolution::new(56, 40), 16);
        let [with, without] =
            [By { light_buffer: true, each: false }, TREE].map(|by| paths(scene, &settings, by));
        assert_eq!(with.len(), 56 * 40 * 16);
        let different = with.iter().zip(&without).filter(|(a, b)| a != b).count();
        assert_eq!(different, 0, "{}, of {} paths", scene.path.display(), with.len());
    }
}

#[test]
fn small_and_large_tree_layouts_give_the_same_hits() {
    for small in [shipped("cornell"), shipped("carton")] {
        let mut large = small.clone();
        // Triangles with two equal corners, so that no ray meets them, on a lattice, so that the tree is not too deep. Its corners are between
        // 1.25 and 1.44 units from the camera, so that the unit of length stays the same, and with it every bit of a path.
        let (unit, camera) = (Unit::of(&small), &small.camera);
        large.triangles.extend((0..20_000).map(|at| {
            let [across, up] = [(at % 200) as f32 / 200.0 - 0.5, (at / 200) as f32 / 100.0 - 0.5];
            let away = across * camera.right + up * camera.up - 1.25 * camera.forward;
            let corner = |to: f32| camera.position + unit.metres as f32 * (away + to);
            Triangle::flat([corner(0.0), corner(0.0), corner(0.001)], 0, 0)
        }));
        assert_eq!(Unit::of(&large), unit);
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
