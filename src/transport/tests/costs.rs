//! Tests of predictions: small traces predict the size and the cost of a matrix.

use std::time::Instant;

use crate::image::Resolution;
use crate::render::{TraceSettings, Tracer};
use crate::scene::{Scene, builtin};
use crate::transport::contributions::Share;
use crate::transport::scaling::{connections, pilot};
use crate::transport::tests::apart;
use crate::transport::{Channels, Probe, assemble, photo_bytes, predict};

fn tracer_of(scene: &Scene) -> Tracer {
    Tracer::new(scene, None).expect("the README's test command installs a Vulkan driver")
}

fn tracer() -> Tracer {
    tracer_of(&builtin::cornell().to_scene())
}

#[test]
fn a_pilot_has_one_path_from_each_of_few_pixels() {
    let long = TraceSettings::new(Resolution::new(100, 20), 9);
    let of_long = pilot(&long);
    assert_eq!(of_long, TraceSettings { resolution: Resolution::new(64, 20), samples: 1, ..long });
    let apart = TraceSettings { projector: Some(Resolution::new(3, 65)), seed: 5, ..long };
    assert_eq!(pilot(&apart), TraceSettings { projector: Some(Resolution::new(3, 64)), seed: 5, ..of_long });
    let mut tracer = tracer();
    let (paths, mean) = connections(&mut tracer, &of_long).expect("the scene can be traced");
    let mut counted = 0;
    let visit = &mut |batch: &crate::render::Batch<'_>| {
        counted += (0..batch.len()).map(|path| batch.connections(path).count()).sum::<usize>();
        Ok(())
    };
    tracer.trace(&of_long, visit).expect("the scene can be traced");
    assert_eq!((paths, mean * 1280.0), (1280, counted as f64), "the mean of 1280 paths");
    assert!(mean > 0.0);
}

#[test]
fn memory_is_predicted_from_a_pilot_where_it_could_be_too_much() {
    let mut tracer = tracer();
    let settings = TraceSettings::new(Resolution::new(70, 30), 4);
    let mut predicted =
        |limit| predict(&mut tracer, &settings, Channels::Luma, limit).expect("it can be traced");
    let most = predicted(u64::MAX);
    // There are 8400 paths, with at most two connections on each of six surfaces.
    assert_eq!(most.connections, 12.0 * 8400.0);
    assert_eq!(predicted(most.bytes.ceil() as u64), most);
    let likely = predicted(most.bytes as u64 - 1);
    assert!(likely.connections < most.connections && likely.bytes < most.bytes, "{likely:?}");
    let (_, mean) = connections(&mut tracer, &pilot(&settings)).expect("it can be traced");
    // The prediction is 5 % above the mean of 1920 paths.
    assert!(
        (likely.connections - 1.05 * mean * 8400.0).abs() < 1e-9 * likely.connections,
        "{likely:?}, {mean}"
    );
    let found = assemble(&mut tracer, &settings, Channels::Luma).expect("it can be traced");
    assert!((found.matrix.bytes() as f64) < likely.bytes, "{} of {likely:?}", found.matrix.bytes());
    assert!(photo_bytes(&settings, Channels::Luma) > 100 * 2100);
}

#[test]
fn a_probe_measures_a_small_matrix_of_the_scene() {
    for (mut tracer, projector, small) in [
        (tracer(), None, None),
        (
            tracer_of(&apart(builtin::cornell().to_scene(), 0.1)),
            Some(Resolution::new(100, 200)),
            Some(Resolution::new(64, 128)),
        ),
    ] {
        let settings = TraceSettings { projector, ..TraceSettings::new(Resolution::new(256, 60), 3) };
        let start = Instant::now();
        let probe = Probe::measure(&mut tracer, &settings).expect("the scene can be traced");
        let whole = start.elapsed().as_secs_f64();
        // The pilot has at most 128 pixels on a side. Camera sides are therefore halved, and projector sides are multiplied by 0.64.
        let pilot = TraceSettings { resolution: Resolution::new(128, 30), projector: small, ..settings };
        let one = TraceSettings { samples: 1, ..pilot };
        let (paths, per_path) = connections(&mut tracer, &one).expect("the scene can be traced");
        assert_eq!(probe.connections, per_path);
        let all = tracer.start_pixels(&pilot);
        let share = Share::<1>::trace(&mut tracer, &pilot, &all, false, None);
        let share = share.expect("the scene can be traced");
        let found: usize = share.found.chunks().map(|chunk| chunk.terms.len()).sum();
        // `hit` is the expected number of different pixels that are hit if a path hits each of its reachable pixels with equal probability.
        let ends = small.unwrap_or(pilot.resolution).pixels() as f64;
        let reached = probe.reached * ends;
        let hit = reached * (1.0 - (-3.0 * per_path / reached).exp());
        let of_start = found as f64 / paths as f64;
        assert!(probe.reached < 1.0 && (hit - of_start).abs() < 1e-6 * of_start, "{hit}, {of_start}");
        // By the constants of the probe, the traced paths, the merged entries, five products and five operations on vectors of 2²¹ entries
        // together take at most the time of the whole measurement.
        let entries =
            assemble(&mut tracer, &pilot, Channels::Luma).expect("it can be traced").matrix.nonzeros() as f64;
        let parts = [
            probe.path * share.summary.paths as f64,
            probe.merge * entries,
            5.0 * probe.multiply * entries,
            5.0 * probe.orthogonalize * f64::from(1 << 21),
        ];
        assert!(
            parts.iter().all(|&part| part > 0.0) && parts.iter().sum::<f64>() <= whole,
            "{parts:?} of {whole}"
        );
    }
}

#[test]
fn a_probe_of_few_pixels_is_the_scene_as_it_is_asked_for() {
    let mut tracer = tracer();
    let settings = TraceSettings::new(Resolution::new(20, 9), 2);
    let probe = Probe::measure(&mut tracer, &settings).expect("the scene can be traced");
    let one = TraceSettings { samples: 1, ..settings };
    let (paths, per_path) = connections(&mut tracer, &one).expect("the scene can be traced");
    assert_eq!((paths, per_path), (180, probe.connections));
}
