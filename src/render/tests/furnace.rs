//! The white furnace: `∫ f cosθ dω`, the light that comes back under light from everywhere.

use super::directions::{Hemisphere, outgoing};
use super::kernel::{gpu, run};
use super::material::{Bsdf, READ_BSDF};
use crate::gpu::Gpu;

/// The narrowest lobe here (α = 0.05) is 0.03 wide in `t`, nine cells; at a cosine of 0.05 it is 0.12 wide in `s`.
const CELLS: Hemisphere = Hemisphere { rings: 320, sectors: 480 };
const SAMPLES: usize = 1 << 18;

/// The albedo of a gray material towards `cos_o`: by quadrature over `f`, and by the sampler's weights, with standard
/// error.
struct Albedo {
    integral: f64,
    sampled: f64,
    error: f64,
}

fn albedo(gpu: &Gpu, bsdf: &Bsdf, cos_o: f64) -> Albedo {
    let mut input = bsdf.encode().to_vec();
    input.push(outgoing(cos_o));
    // Other random numbers for each case.
    let seed = (1000.0 * (cos_o + 10.0 * f64::from(bsdf.alpha + 3.0 * bsdf.metallic))) as u32;
    let sampled = format!(
        "#import rng\n#import bsdf\n{READ_BSDF}
        fn work(index: u32) -> vec4f {{
            let next = bsdf_sample(bsdf_at(0u), input[3].xyz, random4(index, 0u, 1u, {seed}u));
            return vec4f(next.weight, next.pdf);
        }}"
    );
    let weights = run(gpu, &sampled, &[], &input, SAMPLES);
    let count = SAMPLES as f64;
    let mean = weights.iter().map(|weight| f64::from(weight[0])).sum::<f64>() / count;
    let variance =
        weights.iter().map(|weight| (f64::from(weight[0]) - mean).powi(2)).sum::<f64>() / (count - 1.0);

    let reflected = format!(
        "#import bsdf\n{READ_BSDF}
        fn work(index: u32) -> vec4f {{
            let wi = input[4u + index].xyz;
            return vec4f(bsdf_eval(bsdf_at(0u), input[3].xyz, wi) * wi.z, 0.0);
        }}"
    );
    let (points, solid_angles) = CELLS.midpoints(1);
    input.extend(&points);
    let values = run(gpu, &reflected, &[], &input, points.len());
    let integral = values.iter().zip(&solid_angles).map(|(value, angle)| f64::from(value[0]) * angle).sum();
    Albedo { integral, sampled: mean, error: (variance / count).sqrt() }
}

const COSINES: [f64; 6] = [1.0, 0.7, 0.5, 0.3, 0.1, 0.05];

#[test]
fn lambertian_albedo_is_its_colour() {
    let gpu = gpu();
    for (color, cos_o) in [(1.0, 1.0), (1.0, 0.05), (0.5, 0.3)] {
        let Albedo { integral, sampled, error } = albedo(&gpu, &Bsdf::lambertian(color), cos_o);
        let color = f64::from(color);
        // cosθ/π cancels against the density but for rounding: there is no Monte Carlo error. The midpoint rule's error
        // is dt²/2 − ds²/4 relative.
        assert!(
            error < 1e-7 && (sampled - color).abs() < 4e-7 * color,
            "sampled {sampled}, expected {color}"
        );
        assert!((integral - color).abs() < 6e-6 * color, "integral {integral}, expected {color}");
    }
}

#[test]
fn sampling_and_quadrature_find_one_albedo() {
    let gpu = gpu();
    let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
    for bsdf in [
        Bsdf::metal(1.0, 0.05),
        Bsdf::metal(1.0, 0.25),
        Bsdf::metal(0.6, 1.0),
        Bsdf::dielectric(1.0, 0.05),
        Bsdf::dielectric(0.5, 0.25),
        Bsdf::dielectric(1.0, 1.0),
        Bsdf { metallic: 0.5, ..Bsdf::dielectric(0.7, 0.4) },
    ] {
        for cos_o in COSINES {
            let Albedo { integral, sampled, error } = albedo(&gpu, &bsdf, cos_o);
            // The quadrature's own error is of the order of 1e-5; see the Lambertian.
            let z = (sampled - integral) / error.hypot(1e-5);
            (worst, squares, count) = (worst.max(z.abs()), squares + z * z, count + 1.0);
            println!("{bsdf:?} at {cos_o}: {integral:.5}, sampled {sampled:.5} ± {error:.5}, z {z:+.2}");
        }
    }
    let z_rms = f64::sqrt(squares / count);
    println!("z rms {z_rms:.3}, worst {worst:.2}");
    // 42 comparisons: 4.2 standard errors are exceeded once in a thousand times, an rms of 1.4 as well.
    assert!(worst < 4.2 && z_rms < 1.4, "worst z {worst}, rms {z_rms}");
}

#[test]
fn white_metals_reflect_no_more_than_they_receive() {
    let gpu = gpu();
    for alpha in [0.05, 0.25, 0.5, 1.0] {
        for cos_o in COSINES {
            let Albedo { integral, sampled, error } = albedo(&gpu, &Bsdf::metal(1.0, alpha), cos_o);
            assert!(integral <= 1.0 + 1e-5, "α {alpha}, cosine {cos_o}: {integral}");
            assert!(sampled <= 1.0 + 4.0 * error, "α {alpha}, cosine {cos_o}: {sampled} ± {error}");
            // Single scattering loses some, and a smooth surface next to nothing.
            assert!(integral > if alpha < 0.1 { 0.88 } else { 0.3 }, "α {alpha}, cosine {cos_o}: {integral}");
        }
    }
}

#[test]
fn white_dielectrics_reflect_no_more_than_they_receive_but_at_grazing_incidence() {
    let gpu = gpu();
    for (alpha, from) in [(0.05, 0.8), (0.25, 0.7), (0.5, 0.5), (1.0, 0.1)] {
        for cos_o in COSINES.into_iter().chain([0.8]).filter(|&cos| cos >= from) {
            let Albedo { integral, .. } = albedo(&gpu, &Bsdf::dielectric(1.0, alpha), cos_o);
            assert!(integral <= 1.0 + 1e-5, "α {alpha}, cosine {cos_o}: {integral}");
            assert!(integral > 0.95, "α {alpha}, cosine {cos_o}: {integral}");
        }
    }
}

/// A known fault, of glTF's model and not of this code: its Fresnel term takes `V·H`, and for the diffuse half of the
/// mix, light from far off the mirror direction, that stays small at grazing incidence, where the mirror lobe already
/// reflects half of the light. A smooth white dielectric gives back up to one and a half times what it receives. Once the
/// model conserves energy, this test fails, and goes.
#[test]
fn known_gain_of_smooth_white_dielectrics_at_grazing_incidence() {
    let gpu = gpu();
    // Expected: the formula of glTF 2.0, appendix B, integrated in double precision by another program.
    for (alpha, cos_o, expected) in [(0.05, 0.1, 1.3914), (0.05, 0.05, 1.4424), (0.25, 0.1, 1.1096)] {
        let Albedo { integral, .. } = albedo(&gpu, &Bsdf::dielectric(1.0, alpha), cos_o);
        assert!((integral - expected).abs() < 2e-3, "α {alpha}, cosine {cos_o}: {integral}");
    }
}
