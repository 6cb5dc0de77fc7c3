//! Compares the terms that the device and the host compute, for synthetic records and for whole scenes.

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::*;
use crate::image::{LUMINANCE, Resolution};
use crate::render::TraceSettings;
use crate::render::batch::Batch;
use crate::render::materials::NONE;
use crate::render::tests::support::{gpu, tracer};
use crate::scene::{Scene, builtin};

fn weights(from_each_pixel: u32) -> [f64; 3] {
    let mean = 1.0 / f64::from(from_each_pixel);
    let second = if from_each_pixel > 1 { mean } else { 0.0 };
    [mean, second, -second]
}

fn request(channels: usize, split: bool) -> MergeRequest<'static> {
    MergeRequest { channels, luminance: LUMINANCE.map(|share| share as f32), split, weights: &weights }
}

fn layout(samples: u32, direct: bool, gathers: bool) -> RecordLayout {
    RecordLayout {
        samples,
        max_bounces: 3,
        direct,
        gathers,
        ambient: false,
        symmetric: true,
        from_camera: true,
    }
}

/// Random records of paths. On average, one in `every` slots holds a connection, which ends at a pixel of `others`.
fn records(
    random: &mut Pcg64,
    layout: &RecordLayout,
    paths: usize,
    (others, every): (&[u32], u32),
) -> Vec<[u32; 4]> {
    let mut records = vec![[0; 4]; paths * layout.stride()];
    for path in 0..paths {
        let surfaces = random.random_range(0..=layout.max_bounces);
        records[path] = [surfaces, 0, 0, 0];
        for slot in 1..layout.stride() {
            let pixel = match random.random_range(0..every) {
                0 => others[random.random_range(0..others.len())],
                _ => NONE,
            };
            // The upper bits hold the number of surfaces of the far specular chain.
            let chain = if pixel == NONE { 0 } else { random.random_range(0..2_u32) << 28 };
            let light = |random: &mut Pcg64| random.random_range(0.0..2.0_f32).to_bits();
            records[slot * paths + path] = [pixel | chain, light(random), light(random), 0];
        }
    }
    records
}

/// Whether the device's terms of these records equal the host's terms, and the number of terms.
fn compared(
    gpu: &Gpu,
    layout: &RecordLayout,
    other_pixels: u64,
    records: &[[u32; 4]],
    request: &MergeRequest<'_>,
) -> (bool, usize) {
    let paths = records.len() / layout.stride();
    let buffer = gpu.storage("records", records).expect("the records fit");
    let kernels = Kernels::new(gpu).expect("the kernels compile");
    let of = (layout, other_pixels);
    let merge = DeviceMerge::new(gpu, &kernels, request.channels, of, paths as u32, &buffer);
    let merge = merge.expect("the buffers fit").expect("a dispatch has whole pixels");
    let mut encoder = gpu.encoder();
    merge.record(gpu, &mut encoder, request, layout, paths as u32);
    let submission = gpu.queue.submit([encoder.finish()]);
    let view = merge.wait(gpu, merge.request(submission, 0)).expect("the device works");
    let expected = host_terms(&Batch::new(0, *layout, records), request);
    let outcome = (agree(&view.merged(), &expected), expected.len());
    drop(view);
    merge.release();
    outcome
}

#[test]
fn terms_of_hard_cases_are_those_of_the_host() {
    let gpu = gpu();
    let last = (1 << 28) - 1;
    let spread: Vec<u32> = (0..5000).map(|index| index * 53_687).collect();
    let cases: [(&str, u32, usize, &[u32], u32); 8] = [
        ("no contributions", 4, 256, &[1], u32::MAX),
        ("all of one key", 64, 640, &[7], 1),
        ("one pixel with many paths", 3000, 3000, &[0, 5], 1),
        ("borders of the range", 4, 1020, &[0, last, last - 1, 1, 256, 65_535, 65_536], 1),
        ("many blocks", 4, 6000, &spread, 1),
        ("an odd number of samples", 5, 1005, &[3, 9, 1000], 2),
        ("one sample", 1, 777, &spread, 1),
        ("few contributions", 8, 4096, &spread, 50),
    ];
    let mut random = Pcg64::seed_from_u64(1);
    for (name, samples, paths, others, every) in cases {
        for (direct, gathers) in [(true, false), (false, true)] {
            let layout = layout(samples, direct, gathers);
            let records = records(&mut random, &layout, paths, (others, every));
            for (channels, split) in [(1, false), (3, true)] {
                let (agree, terms) = compared(&gpu, &layout, 1 << 28, &records, &request(channels, split));
                assert!(agree, "{name}: direct {direct}, {channels} channels, {terms} terms");
                assert_eq!(terms == 0, name == "no contributions");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]
    #[test]
    fn terms_of_any_records_are_those_of_the_host(
        seed in any::<u64>(), samples in 1_u32..40, pixels in 1_usize..60, other_bits in 0_u32..28,
    ) {
        let mut random = Pcg64::seed_from_u64(seed);
        let layout = layout(samples, true, seed % 2 == 0);
        let others: Vec<u32> = (0..300).map(|_| random.random_range(0..1_u32 << other_bits)).collect();
        let records = records(&mut random, &layout, samples as usize * pixels, (&others, 2));
        let (agree, _) = compared(&gpu(), &layout, 1 << other_bits, &records, &request(1, false));
        prop_assert!(agree);
    }
}

#[test]
fn a_wrong_term_is_noticed() {
    let mut random = Pcg64::seed_from_u64(2);
    let layout = layout(4, true, false);
    let records = records(&mut random, &layout, 400, (&[1, 2, 3], 1));
    let (request, batch) = (request(1, false), Batch::new(0, layout, &records));
    let expected = host_terms(&batch, &request);
    let words: Vec<u32> = expected.iter().flat_map(HostTerm::words).collect();
    let agrees = |words: &[u32]| agree(&Merged { words, channels: 1, first_pixel: 0 }, &expected);
    assert!(agrees(&words));
    assert!(!agrees(&words[..words.len() - 4]), "a term is missing");
    for at in [0, 1, 2, 3] {
        let mut wrong = words.clone();
        // Changes a start or a key by one, or a value by a thousandth.
        wrong[at] = if at < 2 { words[at] + 1 } else { (f32::from_bits(words[at]) * 1.001).to_bits() };
        assert!(!agrees(&wrong), "word {at}");
    }
}

fn traced(scene: &Scene, on_device: bool, channels: usize) -> (Vec<(u32, u32, f32)>, u32) {
    let mut tracer = tracer(scene);
    tracer.merge_on_device(on_device);
    let settings = TraceSettings::new(Resolution::new(24, 20), 12);
    let pixels = tracer.start_pixels(&settings);
    let request = request(channels, true);
    let mut found = Vec::new();
    let summary = tracer.trace_merged(&settings, &pixels, Some(&request), &mut |batch| {
        match batch.terms() {
            Some(merged) => {
                found.extend(merged.terms().map(|term| (term.start, term.key, term.mean::<1>()[0])));
            }
            None => {
                let [mean, ..] = weights(batch.samples());
                let ends = |run: crate::render::Run| {
                    let ends = run.paths.flat_map(|path| batch.ends(path).collect::<Vec<_>>());
                    ends.filter(|end| end.is_seen).map(move |end| {
                        let [red, ..] = end.value;
                        (run.pixel, (end.pixel << 2) | (end.bounces.clamp(1, 3) - 1), red * mean as f32)
                    })
                };
                found.extend(batch.runs().flat_map(ends));
            }
        }
        Ok(())
    });
    (found, summary.expect("the scene can be traced").merged)
}

#[test]
fn a_scene_has_the_same_light_by_device_and_host() {
    // Scenes with smooth surfaces have gathered connections.
    for scene in [builtin::cornell().to_scene(), builtin::mirror().to_scene()] {
        let (mut by_host, none) = traced(&scene, false, 3);
        let (by_device, merged) = traced(&scene, true, 3);
        assert!(none == 0 && merged > 1, "{none}, {merged}");
        // During the trace, `agree` has compared the terms. Here, their total is compared, and the order of the device's terms is checked.
        by_host.sort_by_key(|&(start, key, _)| (start, key));
        let sum = |all: &[(u32, u32, f32)]| all.iter().map(|&(.., value)| f64::from(value)).sum::<f64>();
        let (host, device) = (sum(&by_host), sum(&by_device));
        assert!((host - device).abs() < 1e-6 * host, "{host}, {device}");
        let ascending = by_device.is_sorted_by(|a, b| (a.0, a.1) < (b.0, b.1));
        assert!(ascending, "each position is there once");
    }
}

/// The weights change from call to call, so the host's sums differ from the device's.
#[test]
fn a_device_that_does_not_agree_leaves_the_sums_to_the_host() {
    let calls = std::sync::atomic::AtomicU32::new(1);
    let changing = |_: u32| {
        let call = calls.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        [f64::from(call), 0.0, 0.0]
    };
    let request = MergeRequest { weights: &changing, ..request(1, false) };
    let mut tracer = tracer(&builtin::zigzag().to_scene());
    tracer.merge_on_device(true);
    let settings = TraceSettings::new(Resolution::new(40, 40), 16);
    let pixels = tracer.start_pixels(&settings);
    let (mut paths, mut ends) = (0, 0);
    let summary = tracer.trace_merged(&settings, &pixels, Some(&request), &mut |batch| {
        assert!(batch.terms().is_none());
        paths += batch.len();
        ends += (0..batch.len()).map(|path| batch.connections(path).count()).sum::<usize>();
        Ok(())
    });
    assert_eq!((summary.expect("the scene can be traced").merged, paths), (0, 40 * 40 * 16));
    assert!(ends > 0);
}
