//! Tests of whole traces: paths are equal for every search structure and for every number of paths per invocation. Further tests are about
//! photons, the observer and stored kernels.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};

use glam::Vec3;

use super::support::{PathRecord, path_records, run, tracer};
use crate::error::Error;
use crate::gpu::Gpu;
use crate::image::Resolution;
use crate::observer::{Observer, Step};
use crate::render::geometry::Unit;
use crate::render::photons::hash;
use crate::render::{TraceSettings, Tracer};
use crate::scene::{Scene, Triangle, builtin};

#[derive(Clone, Copy)]
struct By {
    /// Whether rays from and to the pinhole use the light buffer.
    light_buffer: bool,
    /// Whether rays that do not use the light buffer test every pair of triangles.
    each: bool,
}

const TREE: By = By { light_buffer: false, each: false };

fn paths(scene: &Scene, settings: &TraceSettings, by: By) -> Vec<PathRecord> {
    let mut tracer = tracer(scene);
    let pairs = tracer.scene.pairs_in_order.len() as u32;
    let mut strategies = tracer.strategies(settings).expect("the settings are sound");
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

/// Asserts that each path is that of the search tree.
fn assert_paths_of_the_tree(scenes: &[Scene], by: By) {
    for scene in scenes {
        // The image is not square, so that both tangents matter.
        let settings = TraceSettings::new(Resolution::new(56, 40), 16);
        let [found, tree] = [by, TREE].map(|by| paths(scene, &settings, by));
        assert_eq!(found.len(), 56 * 40 * 16);
        assert_eq!(tree.len(), 56 * 40 * 16);
        let different = found.iter().zip(&tree).filter(|(a, b)| a != b).count();
        assert_eq!(different, 0, "{}, of {} paths", scene.path.display(), tree.len());
    }
}

#[test]
fn testing_every_pair_gives_the_hits_of_the_search_tree() {
    // The scenes have few and many triangles, a mirror, and a ceiling that rays hit at all angles.
    let scenes = ["corner", "mirror", "zigzag", "cornell"].map(shipped);
    assert_paths_of_the_tree(&scenes, By { light_buffer: false, each: true });
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
    assert_paths_of_the_tree(&scenes, By { light_buffer: true, each: false });
}

#[test]
fn small_and_large_tree_layouts_give_the_same_hits() {
    for small in [shipped("cornell"), shipped("carton")] {
        let mut large = small.clone();
        // The added triangles have two equal corners, so no ray hits them. They lie on a lattice, so that the tree is not too deep. The
        // lattice's corners are between 1.25 and 1.44 units from the camera, so the unit of length stays the same, and with it every bit of
        // a path.
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
            let mut tracer = tracer(scene);
            tracer.strategies(&settings).expect("sound settings")[0].features.scene.small_tree
        };
        assert!(layout(&small) && !layout(&large), "{}", small.path.display());
        let [of_small, of_large] = [&small, &large].map(|scene| paths(scene, &settings, TREE));
        let different = of_small.iter().zip(&of_large).filter(|(a, b)| a != b).count();
        assert_eq!((of_small.len(), different), (40 * 56 * 16, 0), "{}", small.path.display());
    }
}

/// All paths of all strategies, with or without the light buffer. Each invocation traces `each` paths.
fn paths_by(scene: &Scene, settings: &TraceSettings, each: u32, by_light_buffer: bool) -> Vec<PathRecord> {
    let mut tracer = tracer(scene);
    let mut strategies = tracer.strategies(settings).expect("the settings are sound");
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
fn paths_do_not_depend_on_their_invocation() {
    let mirror_ball = builtin::mirror_ball().to_scene();
    let apart = Scene { projector: Some(Scene::clone(&mirror_ball).camera), ..builtin::carton().to_scene() };
    let scenes = [
        (builtin::carton().to_scene(), true),
        (builtin::carton().to_scene(), false),
        (mirror_ball, true),
        (apart, false),
    ];
    for (scene, by_light_buffer) in &scenes {
        // With these numbers, pixels begin and end in the middle of an invocation's paths, and the last invocation has fewer paths.
        let settings = TraceSettings::new(Resolution::new(41, 30), 13);
        let one = paths_by(scene, &settings, 1, *by_light_buffer);
        assert!(one.len() >= 41 * 30 * 13);
        for each in [3, 64] {
            let several = paths_by(scene, &settings, each, *by_light_buffer);
            assert!(
                one == several,
                "{}, by the light buffer: {by_light_buffer}, {each} paths each",
                scene.path.display()
            );
        }
    }
}

/// A wall, and in front of it `count` strips, one behind another. The strips are as wide as the field of view and thinner than a texel of
/// the light buffer, so a ray that passes them is tested against each strip.
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
fn paths_that_are_too_long_for_one_invocation_get_one_each() {
    // About sixty paths of an invocation pass eight thousand strips each. Software Vulkan stops the invocation after 65,535 loop
    // iterations.
    let scene = strips(8000);
    let settings = TraceSettings::new(Resolution::new(64, 64), 32);
    let [one, many] = [1, 64].map(|each| paths_by(&scene, &settings, each, true));
    assert!(!one.is_empty() && one == many);
}

#[test]
fn shader_and_host_agree_on_the_hash_of_a_cell() {
    let cells: Vec<[i32; 3]> =
        (0..500).map(|k| [k * 37 % 211 - 100, k * 53 % 307 - 150, 5 - k * 11 % 401]).collect();
    let input: Vec<[f32; 4]> = cells.iter().map(|&[x, y, z]| [x as f32, y as f32, z as f32, 0.0]).collect();
    // A 32-bit number is passed as two 16-bit numbers, which are exact in `f32`.
    let source = "#import photons
        fn work(index: u32) -> vec4f {
            let hash = photon_hash(vec3i(input[index].xyz));
            return vec4f(f32(hash >> 16u), f32(hash & 0xffffu), 0.0, 0.0);
        }";
    for (cell, [high, low, ..]) in cells.iter().zip(run(&Gpu::for_tests(), source, &[], &input, cells.len()))
    {
        assert_eq!((high as u32) << 16 | low as u32, hash(*cell), "{cell:?}");
    }
}

/// Records, for each step, the number of finished paths and the total. Stops the trace at step number `breaks_at`, counted from 1.
struct Notes {
    steps: Mutex<Vec<(u64, u64)>>,
    breaks_at: usize,
}

impl Observer for Notes {
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        assert_eq!(step.stage, "tracing");
        let mut steps = self.steps.lock().expect("no step panics");
        steps.push((step.done, step.total));
        if steps.len() == self.breaks_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// The steps of a trace of 16 × 16 pixels at 4 paths each, and its outcome.
fn observed(tracer: &mut Tracer, breaks_at: usize) -> (Vec<(u64, u64)>, crate::Result<u64>) {
    let notes = Arc::new(Notes { steps: Mutex::default(), breaks_at });
    tracer.observe(Arc::clone(&notes) as Arc<_>);
    let settings = TraceSettings::new(Resolution::new(16, 16), 4);
    let outcome = tracer.trace(&settings, &mut |_| Ok(())).map(|summary| summary.paths);
    let steps = notes.steps.lock().expect("no step panics").clone();
    (steps, outcome)
}

#[test]
fn the_observer_sees_each_dispatch_and_may_stop_the_trace() {
    let mut tracer = tracer(&builtin::corner().to_scene());
    let (steps, outcome) = observed(&mut tracer, 0);
    assert!(matches!(outcome, Ok(1024)));
    assert_eq!((steps.first(), steps.last()), (Some(&(0, 1024)), Some(&(1024, 1024))));
    assert!(steps.is_sorted() && steps.iter().all(|&(_, total)| total == 1024), "{steps:?}");

    let (stopped, outcome) = observed(&mut tracer, 1);
    assert!(matches!(outcome, Err(Error::Interrupted)) && stopped == [(0, 1024)]);

    // At the last step, everything has been traced, so stopping has no effect.
    let (_, outcome) = observed(&mut tracer, steps.len());
    assert!(matches!(outcome, Ok(1024)));
}

/// All values of a trace of 8 × 8 pixels with 4 paths each. The tracer was given these kernels.
fn traced(kept: Option<&[u8]>) -> (Vec<f32>, Tracer) {
    let mut tracer = tracer(&builtin::zigzag().to_scene());
    tracer.restore_kernels(kept);
    let mut values = Vec::new();
    let settings = TraceSettings::new(Resolution::new(8, 8), 4);
    let outcome = tracer.trace(&settings, &mut |batch| {
        let paths = batch.runs().flat_map(|run| run.paths);
        values.extend(paths.flat_map(|path| batch.ends(path).flat_map(|end| end.value)));
        Ok(())
    });
    assert!(outcome.is_ok(), "{outcome:?}");
    (values, tracer)
}

#[test]
fn kernels_of_another_device_and_garbage_change_nothing() {
    let (expected, first) = traced(None);
    assert!(expected.iter().any(|&value| value > 0.0));
    // A driver that does not return kernels keeps them itself.
    let kept = first.compiled_kernels();
    let garbage = vec![7_u8; 4096];
    let mut foreign = kept.clone().unwrap_or_else(|| b"WGPUPLCH".to_vec());
    foreign.iter_mut().skip(8).for_each(|byte| *byte ^= 0x55);
    for data in [kept.as_deref(), Some(&garbage[..]), Some(&foreign[..]), Some(&[][..])] {
        assert_eq!(traced(data).0, expected);
    }
}
