//! Lists of what the pinhole sees against the search tree: the same paths, to the last bit.

use std::ops::ControlFlow;

use crate::image::Resolution;
use crate::render::{Batch, TraceSettings, TraceSummary, Tracer};
use crate::scene::{Scene, builtin};

/// What a path left: rays, direct light and connections, as bits.
type Left = (u64, [u32; 3], Vec<(u32, u32, [u32; 3])>);

/// All paths of a scene, by the lists or by the tree.
fn paths(scene: &Scene, settings: &TraceSettings, sight: bool) -> Vec<Left> {
    let mut tracer = Tracer::new(scene, None).expect("the README's test command installs a Vulkan driver");
    let mut strategies = tracer.stage().strategies(settings).expect("the settings are sound");
    assert_eq!(strategies.len(), 1, "{}: a coaxial pinhole", scene.path.display());
    let strategy = &mut strategies[0];
    assert!(strategy.features.sight, "{}: nothing here lets light straight through", scene.path.display());
    strategy.features.sight = sight;
    let mut left = Vec::new();
    let mut visit = |batch: &Batch<'_>| {
        left.extend((0..batch.len()).map(|path| {
            let connections = batch.connections(path).map(|connection| {
                (connection.camera, connection.projector, connection.value.map(f32::to_bits))
            });
            (batch.rays(path), batch.direct(path).map(f32::to_bits), connections.collect())
        }));
        Ok(())
    };
    let mut go_on = |_| ControlFlow::Continue(());
    let total = strategy.paths();
    tracer
        .run(strategy, total, &mut TraceSummary::default(), &mut go_on, &mut visit)
        .expect("shipped scenes can be traced");
    left
}

#[test]
fn lists_find_what_the_tree_finds() {
    let shipped = |name: &str| {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("assets/scenes")
            .join(name)
            .join("scene.glb");
        crate::scene::load(&path, None).expect("shipped scenes load")
    };
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
        let [with, without] = [true, false].map(|sight| paths(scene, &settings, sight));
        assert_eq!(with.len(), 56 * 40 * 16);
        let different = with.iter().zip(&without).filter(|(a, b)| a != b).count();
        assert_eq!(different, 0, "{}, of {} paths", scene.path.display(), with.len());
    }
}
