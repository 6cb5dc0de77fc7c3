//! Matrices that a device assembles are compared with those of the host: software Vulkan, or any other adapter.

use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use proptest::prelude::*;

use super::self_test::{Known, difference};
use super::*;
use crate::image::Resolution;
use crate::observer::{Observer, Step};
use crate::scene::{Scene, builtin};
use crate::transport::tests::apart;
use crate::transport::{Part, assemble_layers};

fn limits(channels: Channels) -> Limits {
    Limits::of(&Gpu::for_tests(), channels.count())
}

/// The difference between the device's matrix of known records and the host's.
fn compared(known: &Known, limits: Limits) -> Option<String> {
    let [device, host] = known.assembled(&Gpu::for_tests(), limits).expect("the device has memory");
    difference(&device, &host).expect("the device works")
}

#[test]
fn the_self_test_passes() {
    for channels in [Channels::Luma, Channels::Rgb] {
        assert_eq!(compared(&Known::new(channels), limits(channels)), None);
        assert_eq!(compared(&Known::with_long_rows(channels), limits(channels)), None);
        let apart = Known::new(channels).with_projector(Resolution::new(5, 11));
        assert_eq!(compared(&apart, limits(channels)), None);
        assert!(self_test::require_working(&Gpu::for_tests(), channels).is_ok());
    }
}

/// One thing differs that a faulty device might return: one weight, one place, the diagonal, the ambient light, or the noise.
#[test]
fn the_self_test_finds_faults() {
    let known = Known::new(Channels::Luma);
    type Fault = fn(&mut Assembled);
    let faults: [(&str, Fault); 5] = [
        ("weights", |made| {
            let mut rows = made.matrix.layers[0].to_rows();
            rows.weights[0][7] *= 1.00001;
            made.matrix.layers[0] = Layer::new(Bounces::Two, 133, vec![rows]);
        }),
        ("places", |made| {
            let mut rows = made.matrix.layers[1].to_rows();
            rows.columns[0] += 1;
            made.matrix.layers[1] = Layer::new(Bounces::Rest, 133, vec![rows]);
        }),
        ("direct", |made| made.matrix.direct[0][3] *= 1.00001),
        ("ambient", |made| made.ambient.samples_mut()[3] *= 1.00001),
        ("noise", |made| {
            if let Some(noise) = &mut made.noise {
                noise.operator *= 1.001;
            }
        }),
    ];
    for (name, fault) in faults {
        let [mut device, host] =
            known.assembled(&Gpu::for_tests(), limits(Channels::Luma)).expect("the device has memory");
        fault(&mut device);
        let found = difference(&device, &host).expect("the device works");
        assert!(found.as_ref().is_some_and(|found| found.contains(name)), "{name}: {found:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]
    /// Any records, with rows that are empty, short, or longer than workgroup memory; in small arenas and bands, and with keys apart from
    /// their places.
    #[test]
    fn a_matrix_of_any_records_is_that_of_the_host(
        seed in any::<u64>(), samples in 1_u32..90, side in 1_usize..14, max_bounces in 1_u32..9,
        [direct, gathers, ambient, split, colour, packs, apart] in any::<[bool; 7]>(),
        seen in 0_u32..4, arena in 1_u64..5000, entries in 1_usize..20_000,
    ) {
        let channels = if colour { Channels::Rgb } else { Channels::Luma };
        let mut known = Known::new(channels);
        let layout = RecordLayout { samples, max_bounces, direct, gathers, ambient, ..known.layout };
        let camera = Resolution::new(side, side + 2);
        let rig = RigShape { camera, projector: camera, symmetric: true };
        known = Known { layout, split, rig, seen, seed, ..known };
        if apart {
            known = known.with_projector(Resolution::new(side + 1, 3));
        }
        let limits = Limits { arena, entries, packs };
        prop_assert_eq!(compared(&known, limits), None);
    }
}

fn tracer(scene: &Scene, on_device: bool) -> Tracer {
    let mut tracer = Tracer::new(scene, None).expect("the README's test command installs a Vulkan driver");
    tracer.assemble_on_device(on_device);
    tracer
}

fn traced(scene: &Scene, on_device: bool, settings: &TraceSettings, of: (Channels, bool)) -> Assembled {
    assemble_layers(&mut tracer(scene, on_device), settings, of.0, of.1).expect("the scene can be traced")
}

/// All kinds of rigs and of light: each matrix equals the host's up to rounding, repeats to the bit, and is symmetric to the last bit.
#[test]
fn a_scene_has_the_matrix_of_the_host() {
    let mut lens = builtin::corner().to_scene();
    lens.camera.lens.radius = 0.05;
    lens.camera.lens.focus = 1.0;
    let mut glowing = builtin::cornell().to_scene();
    glowing.materials[0].emission = glam::Vec3::new(0.3, 0.2, 0.1);
    let settings = TraceSettings::new(Resolution::new(20, 16), 24);
    let wide = TraceSettings { projector: Some(Resolution::new(9, 31)), ..settings };
    let many = TraceSettings { samples: 501, resolution: Resolution::new(9, 8), ..settings };
    let one = TraceSettings { samples: 1, ..settings };
    let direct = TraceSettings { max_bounces: 1, ..settings };
    let (luma, rgb) = (Channels::Luma, Channels::Rgb);
    let cases = [
        ("colours, layers", builtin::cornell().to_scene(), settings, (rgb, true)),
        ("luminance", builtin::zigzag().to_scene(), settings, (luma, false)),
        ("a mirror", builtin::mirror().to_scene(), settings, (luma, true)),
        ("a mirrored ball", builtin::mirror_ball().to_scene(), settings, (rgb, false)),
        ("a lens", lens, settings, (luma, true)),
        ("ambient light", glowing, settings, (rgb, false)),
        ("a projector apart", apart(builtin::carton().to_scene(), 0.2), settings, (rgb, true)),
        ("other pixels", apart(builtin::mirror().to_scene(), 0.2), wide, (luma, false)),
        ("many samples", builtin::cornell().to_scene(), many, (luma, false)),
        ("one sample", builtin::cornell().to_scene(), one, (luma, false)),
        ("direct light", builtin::corner().to_scene(), direct, (luma, false)),
    ];
    for (name, scene, settings, of) in cases {
        let host = traced(&scene, false, &settings, of);
        let [device, again] = [(); 2].map(|()| traced(&scene, true, &settings, of));
        assert!(!host.is_on_gpu() && device.is_on_gpu(), "{name}");
        assert_eq!(difference(&device, &host).expect("the device works"), None, "{name}");
        assert!(device.matrix == again.matrix && device.noise == again.noise, "{name}: the same bits again");
        assert_eq!(device.ambient, again.ambient, "{name}");
        let costs = |of: &Assembled| (of.summary.paths, of.summary.rays);
        assert_eq!(costs(&device), costs(&host), "{name}");
        products(name, &device, &host);
    }
}

/// Devices that share the paths make the matrix of one device, to the bit: a coaxial rig, mirrors, a projector apart with fewer pixels than
/// there are devices, and ambient light.
#[test]
fn several_devices_make_the_matrix_of_one() {
    let mut glowing = builtin::cornell().to_scene();
    glowing.materials[0].emission = glam::Vec3::new(0.3, 0.2, 0.1);
    let settings = TraceSettings::new(Resolution::new(15, 9), 40);
    let narrow = TraceSettings { projector: Some(Resolution::new(2, 1)), ..settings };
    let cases = [
        ("ambient light", glowing, settings, (Channels::Rgb, true)),
        ("a mirrored ball", builtin::mirror_ball().to_scene(), settings, (Channels::Luma, false)),
        ("a projector apart", apart(builtin::carton().to_scene(), 0.2), settings, (Channels::Luma, true)),
        ("a narrow projector", apart(builtin::mirror().to_scene(), 0.2), narrow, (Channels::Luma, false)),
    ];
    let others: Vec<Gpu> = (0..2).map(|_| Gpu::another_for_tests()).collect();
    for (name, scene, settings, of) in cases {
        let one = traced(&scene, true, &settings, of);
        let mut several = tracer(&scene, true);
        several.help_by(others.clone(), &scene).expect("the scene fits");
        // Small arenas: each device has several.
        let small = Limits { arena: 1 << 10, ..limits(of.0) };
        let made =
            assemble_within(&mut several, &settings, of, Some(small)).expect("the scene can be traced");
        let traced = several.others.iter().filter(|other| other.resident.is_some()).count();
        assert_eq!(
            (traced, several.devices()),
            (if name == "a narrow projector" { 1 } else { 2 }, 3),
            "{name}"
        );
        assert!(made.matrix == one.matrix && made.noise == one.noise, "{name}: the same bits");
        assert_eq!(made.ambient, one.ambient, "{name}");
        let costs = |of: &Assembled| (of.summary.paths, of.summary.rays);
        assert_eq!(costs(&made), costs(&one), "{name}");
        products(name, &made, &one);
    }
}

/// Notes what it is told, and stops at a step.
#[derive(Default)]
struct Listening {
    stops_at: Option<usize>,
    steps: AtomicUsize,
    notes: Mutex<Vec<String>>,
}

impl Observer for Listening {
    fn step(&self, _: &Step<'_>) -> ControlFlow<()> {
        let step = self.steps.fetch_add(1, Ordering::Relaxed);
        if self.stops_at.is_some_and(|at| step >= at) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    fn log(&self, _: Level, message: &str) {
        self.notes.lock().expect("no test has failed").push(message.to_owned());
    }
}

/// If a device cannot help, a note says why, and the first one assembles the matrix alone. If the user stops one device, all stop.
#[test]
fn several_devices_stop_together() {
    let (scene, settings) = (builtin::cornell().to_scene(), TraceSettings::new(Resolution::new(16, 16), 8));
    let of = (Channels::Luma, false);
    let mut lame = Gpu::another_for_tests();
    lame.summary.double_precision = false;
    for others in [vec![lame.clone()], vec![Gpu::another_for_tests(), lame]] {
        let (mut several, listening) = (tracer(&scene, true), Arc::new(Listening::default()));
        several.observe(Arc::clone(&listening) as Arc<dyn Observer + Send + Sync>);
        several.help_by(others, &scene).expect("the scene fits");
        let made = assemble_layers(&mut several, &settings, of.0, of.1).expect("one device works");
        assert!(made.is_on_gpu() && made.matrix == traced(&scene, true, &settings, of).matrix);
        let notes = listening.notes.lock().expect("no test has failed");
        assert!(
            notes.len() == 1 && notes[0].contains("f64") && notes[0].contains("without the others"),
            "{notes:?}"
        );
        assert_eq!(several.devices(), 1);
    }
    for stops_at in [0, 1] {
        let mut several = tracer(&scene, true);
        several.help_by(vec![Gpu::another_for_tests()], &scene).expect("the scene fits");
        several.observe(Arc::new(Listening { stops_at: Some(stops_at), ..Listening::default() }));
        let stopped = assemble(&mut several, &settings, of.0, of.1).map(drop);
        assert!(matches!(stopped, Err(Error::Interrupted)), "{stopped:?}");
    }
}

/// Products on the device, before and after the host has read the matrix, equal those of the host's matrix up to rounding.
fn products(name: &str, device: &Assembled, host: &Assembled) {
    let [camera, projector] = [host.matrix.rig.camera.pixels(), host.matrix.rig.projector.pixels()];
    for channel in 0..host.matrix.channels().count() {
        for (length, is_transposed) in [(projector, false), (camera, true)] {
            let x: Vec<f64> = (0..length).map(|pixel| (pixel * 7919 % 1013) as f64 / 1013.0).collect();
            let result = |of: &Assembled| {
                use crate::operator::{Adjoint, Operator};
                let mut y = vec![0.0; camera + projector - length];
                let mut operator = of.operator(Part::Full, channel);
                let taken = match is_transposed {
                    false => operator.apply(&x, &mut y),
                    true => operator.apply_adjoint(&x, &mut y),
                };
                taken.expect("the device works");
                y
            };
            for (found, expected) in result(device).iter().zip(result(host)) {
                // All terms are positive, so that the sum is rounded like its terms.
                assert!((found - expected).abs() <= 1e-6 * expected + 1e-30, "{name}: {found}, {expected}");
            }
        }
    }
}

#[test]
fn the_matrix_of_a_coaxial_rig_is_symmetric_to_the_last_bit() {
    let settings = TraceSettings::new(Resolution::new(13, 17), 300);
    let made = traced(&builtin::mirror_ball().to_scene(), true, &settings, (Channels::Luma, false));
    let csr = made.matrix.to_csr(Part::Full, 0).expect("the device works");
    let mut entries: Vec<(usize, usize, u64)> =
        csr.entries().map(|(row, column, weight)| (row, column, weight.to_bits())).collect();
    let mut mirrored: Vec<_> = entries.iter().map(|&(row, column, weight)| (column, row, weight)).collect();
    entries.sort_unstable();
    mirrored.sort_unstable();
    assert!(!entries.is_empty() && entries == mirrored);
}

/// The host assembles the matrix if the device cannot, and says why.
#[test]
fn the_host_assembles_what_the_device_cannot() {
    let mut gpu = Gpu::for_tests();
    gpu.summary.double_precision = false;
    let error = gpu.require_double_precision("sums").expect_err("it cannot calculate in f64").to_string();
    assert!(error.contains("f64"), "{error}");
    // So many samples take more parts than a buffer holds.
    gpu.summary.max_storage_binding = 1000;
    let known = Known::new(Channels::Luma);
    let refused = known.assembled(&gpu, Limits::of(&gpu, 1)).map(drop);
    assert!(matches!(refused, Err(Error::Device { .. })), "{refused:?}");
}
