//! Kernels that an earlier process compiled.

use crate::image::Resolution;
use crate::render::{TraceSettings, Tracer};
use crate::scene::builtin;

/// All values of a trace of 8 × 8 pixels at 4 paths each, by a tracer that was given these kernels.
fn traced(kept: Option<&[u8]>) -> (Vec<f32>, Tracer) {
    let mut tracer = Tracer::new(&builtin::zigzag().to_scene(), None)
        .expect("the README's test command installs a Vulkan driver");
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
    // A driver with nothing to give out is one that keeps its kernels itself.
    let kept = first.compiled_kernels();
    let garbage = vec![7_u8; 4096];
    let mut foreign = kept.clone().unwrap_or_else(|| b"WGPUPLCH".to_vec());
    foreign.iter_mut().skip(8).for_each(|byte| *byte ^= 0x55);
    for data in [kept.as_deref(), Some(&garbage[..]), Some(&foreign[..]), Some(&[][..])] {
        assert_eq!(traced(data).0, expected);
    }
}
