//! Compares matrices whose contributions the device sorted and summed with matrices whose contributions the host summed.

use crate::render::{TraceSettings, Tracer};
use crate::scene::{Scene, builtin};
use crate::transport::*;

/// The maximum number of single-precision roundings of an entry: up to 64 contributions in a run, weights, luminance, and the mirror image.
const ROUNDINGS: f64 = 80.0;

fn traced(scene: &Scene, on_device: bool, channels: Channels, split: bool) -> Assembled {
    let mut tracer = Tracer::new(scene, None).expect("the README's test command installs a Vulkan driver");
    tracer.merge_on_device(on_device);
    let settings = TraceSettings::new(Resolution::new(20, 16), 24);
    assemble_layers(&mut tracer, &settings, channels, split).expect("the scene can be traced")
}

#[test]
fn a_matrix_merged_on_the_device_is_that_of_the_host_but_for_rounding() {
    let mirror_ball = builtin::mirror_ball().to_scene();
    let apart = Scene { projector: Some(Scene::clone(&mirror_ball).camera), ..builtin::carton().to_scene() };
    let cases = [
        ("cornell", builtin::cornell().to_scene(), Channels::Rgb, true),
        ("zigzag", builtin::zigzag().to_scene(), Channels::Luma, false),
        ("mirror", builtin::mirror().to_scene(), Channels::Luma, true),
        ("a rig whose projector stands apart", apart, Channels::Rgb, false),
    ];
    for (name, scene, channels, split) in cases {
        let [host, device] = [false, true].map(|on_device| traced(&scene, on_device, channels, split));
        assert!(host.summary.merged == 0 && device.summary.merged > 0, "{name}");
        let [of_host, of_device] = [&host, &device].map(|of| of.matrix.layers().expect("it is whole"));
        assert_eq!(of_host.len(), of_device.len(), "{name}");
        // Sorting and summing on the device does not change direct and ambient light.
        assert_eq!(host.ambient, device.ambient, "{name}");
        // An entry has a column, and a weight of four bytes for each channel.
        let weights = |layer: &Layer| layer.nonzeros() * 4 * channels.count();
        assert!(of_device.iter().all(|layer| layer.bytes() > weights(layer)), "{name}");
        for (host, device) in of_host.iter().zip(of_device.iter()) {
            assert_eq!(host.bounces(), device.bounces(), "{name}");
            let [host, device] = [host, device].map(Layer::to_rows);
            assert_eq!((&host.row_start, &host.columns), (&device.row_start, &device.columns), "{name}");
            let weights = host.weights.iter().flatten().zip(device.weights.iter().flatten());
            for (&a, &b) in weights {
                let off = f64::from(a - b).abs();
                assert!(off <= ROUNDINGS * 2.0_f64.powi(-24) * f64::from(a.abs()), "{name}: {a}, {b}");
            }
        }
        let [host, device] =
            [&host.noise, &device.noise].map(|noise| noise.as_ref().map_or(0.0, |n| n.operator));
        assert!(host > 0.0 && (host - device).abs() < 1e-5 * host, "{name}: noise {host}, {device}");
    }
}
