//! Tests that no surface reflects more light than it receives: the white furnace test, and smooth interfaces against Fresnel's equations.

use std::sync::LazyLock;

use super::material::{BSDF_SIZE, Bsdf, RANDOM_BSDF, READ_BSDF};
use super::statistics::{Sphere, outgoing};
use super::support::run;
use crate::gpu::Gpu;

/// The narrowest lobe here (α = 0.05) has a width of 0.03 in `t` (nine cells) and of 0.12 in `s` at a cosine of 0.05; see [`Sphere`].
const CELLS: Sphere = Sphere { rings: 320, sectors: 480 };
static POINTS: LazyLock<(Vec<[f32; 4]>, Vec<f64>)> = LazyLock::new(|| CELLS.midpoints(1));
const SAMPLES: usize = 1 << 18;

/// The directional albedo of a gray material, with regular and delta lobes. It is computed by quadrature over `K`
/// (guide/src/right/bsdf.md), and from samples, with their standard error.
struct Albedo {
    integral: f64,
    sampled: f64,
    error: f64,
}

fn quadrature(gpu: &Gpu, bsdf: &Bsdf, cos_o: f64) -> f64 {
    let source = format!(
        "#import bsdf\n{READ_BSDF}
        fn work(index: u32) -> vec4f {{
            let bsdf = bsdf_at(0u);
            let wo = input[5].xyz;
            if (index + 6u == arrayLength(&input)) {{
                let deltas = bsdf_deltas(bsdf, wo.z, bsdf_cosine_beyond(bsdf, wo.z));
                let bent = select(vec3f(0.0), deltas.transmitted, bsdf.eta_o != bsdf.eta_t);
                return vec4f(bsdf.opacity * (deltas.reflected + bent) + bsdf_pass(bsdf, wo).value, 0.0);
            }}
            let wi = input[6u + index].xyz;
            let n_i = select(bsdf.eta_o, bsdf.eta_t, wi.z < 0.0);
            return vec4f(bsdf_eval(bsdf, wo, wi) * (n_i * n_i * abs(wi.z)), 0.0);
        }}"
    );
    let mut input = bsdf.encode().to_vec();
    input.push(outgoing(cos_o));
    // An opaque surface has no lobe below the horizon.
    let through = bsdf.transmission + bsdf.diffuse_transmission > 0.0;
    let points = &POINTS.0[..CELLS.bins() / if through { 1 } else { 2 }];
    input.extend(points);
    let values = run(gpu, &source, &[], &input, points.len() + 1);
    let regular =
        values.iter().zip(&POINTS.1[..points.len()]).map(|(value, angle)| f64::from(value[0]) * angle);
    regular.sum::<f64>() + f64::from(values[points.len()][0])
}

fn albedo(gpu: &Gpu, bsdf: &Bsdf, cos_o: f64, seed: usize) -> Albedo {
    let source = format!(
        "#import rng\n#import bsdf\n{READ_BSDF}
        fn work(index: u32) -> vec4f {{
            let next = bsdf_sample(bsdf_at(0u), input[5].xyz, random4(index, 0u, 1u, u32(input[6].x)));
            return vec4f(next.weight, next.pdf);
        }}"
    );
    let mut input = bsdf.encode().to_vec();
    input.extend([outgoing(cos_o), [seed as f32, 0.0, 0.0, 0.0]]);
    let weights = run(gpu, &source, &[], &input, SAMPLES);
    let count = SAMPLES as f64;
    let mean = weights.iter().map(|weight| f64::from(weight[0])).sum::<f64>() / count;
    let squares = weights.iter().map(|weight| (f64::from(weight[0]) - mean).powi(2)).sum::<f64>();
    let error = (squares / (count - 1.0) / count).sqrt();
    Albedo { integral: quadrature(gpu, bsdf, cos_o), sampled: mean, error }
}

const COSINES: [f64; 6] = [1.0, 0.7, 0.5, 0.3, 0.1, 0.05];

#[test]
fn lambertian_albedo_is_its_colour() {
    let gpu = Gpu::for_tests();
    for (color, cos_o) in [(1.0, 1.0), (1.0, 0.05), (0.5, 0.3)] {
        let Albedo { integral, sampled, error } = albedo(&gpu, &Bsdf::lambertian(color), cos_o, 0);
        let color = f64::from(color);
        // The factor cosθ/π and the density cancel up to rounding, so there is no Monte Carlo error. With cells of dt × ds, the relative
        // error of the midpoint rule is dt²/2 − ds²/4.
        assert!(
            error < 1e-7 && (sampled - color).abs() < 4e-7 * color,
            "sampled {sampled}, expected {color}"
        );
        assert!((integral - color).abs() < 6e-6 * color, "integral {integral}, expected {color}");
    }
    // The same holds in water: K is 1/n² of its value in air, and n_i² compensates this.
    let immersed = Bsdf { eta_o: 1.33, eta_t: 1.33, ..Bsdf::lambertian(1.0) };
    let Albedo { integral, sampled, .. } = albedo(&gpu, &immersed, 0.5, 0);
    assert!((sampled - 1.0).abs() < 1e-6 && (integral - 1.0).abs() < 6e-6, "{sampled} and {integral}");
}

#[test]
fn sampling_and_quadrature_find_one_albedo() {
    let gpu = Gpu::for_tests();
    let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
    let paper = Bsdf { diffuse_transmission: 0.4, ..Bsdf::dielectric(0.7, 0.4) };
    let mixed = Bsdf { metallic: 0.2, transmission: 0.5, opacity: 0.7, eta_t: 1.4, ..paper };
    for bsdf in [
        Bsdf::metal(1.0, 0.05),
        Bsdf::metal(1.0, 0.25),
        Bsdf::dielectric(1.0, 0.05),
        Bsdf::dielectric(0.5, 0.25),
        Bsdf::dielectric(1.0, 1.0),
        Bsdf { metallic: 0.5, ..Bsdf::dielectric(0.7, 0.4) },
        paper,
        Bsdf::pane(0.3),
        Bsdf::glass(0.3),
        Bsdf::glass(0.3).beyond(),
        mixed,
        Bsdf { alpha: 0.0, ..mixed },
    ] {
        for cos_o in COSINES {
            let Albedo { integral, sampled, error } = albedo(&gpu, &bsdf, cos_o, count as usize);
            // This bound is the error of the quadrature alone, as for the Lambertian surface. If light is refracted, a lobe ends with a
            // jump at facets that are seen edge-on, and the cells blur the jump.
            let quadrature = if bsdf.eta_o == bsdf.eta_t { 1e-5 } else { 3e-4 };
            let z = (sampled - integral) / error.hypot(quadrature);
            (worst, squares, count) = (worst.max(z.abs()), squares + z * z, count + 1.0);
            println!(
                "{} at {cos_o}: {integral:.5}, sampled {sampled:.5} ± {error:.5}, z {z:+.2}",
                bsdf.describe()
            );
        }
    }
    let z_rms = f64::sqrt(squares / count);
    println!("{count} comparisons, z rms {z_rms:.3}, worst {worst:.2}");
    // The probability that one of 72 comparisons exceeds 4.3 standard errors, or that their rms exceeds 1.3, is one in a thousand.
    assert!(worst < 4.3 && z_rms < 1.3, "worst z {worst}, rms {z_rms}");
}

/// The least and the greatest albedo over all cosines that are at least `from`. The quadrature has an error of the order of 1e-5.
fn range(gpu: &Gpu, bsdf: &Bsdf, from: f64) -> (f64, f64) {
    let found = COSINES.iter().filter(|&&cos| cos >= from).map(|&cos_o| quadrature(gpu, bsdf, cos_o));
    let range = found.fold((f64::MAX, 0.0_f64), |(low, high), albedo| (low.min(albedo), high.max(albedo)));
    println!("{}: {:.5} to {:.5}", bsdf.describe(), range.0, range.1);
    range
}

#[test]
fn white_metals_reflect_no_more_than_they_receive() {
    let gpu = Gpu::for_tests();
    for alpha in [0.05, 0.25, 0.5, 1.0] {
        let (low, high) = range(&gpu, &Bsdf::metal(1.0, alpha), 0.0);
        assert!(high <= 1.0 + 1e-5, "α {alpha}: {high}");
        // The model without multiple scattering loses some light, but hardly any on a smooth surface.
        assert!(low > if alpha < 0.1 { 0.88 } else { 0.3 }, "α {alpha}: {low}");
    }
}

/// glTF's sample implementation returns up to 1.44 times the received light here; see `render`'s documentation.
#[test]
fn white_dielectrics_reflect_no_more_than_they_receive() {
    let gpu = Gpu::for_tests();
    for alpha in [0.05, 0.1, 0.2, 0.4, 0.7, 1.0] {
        let white = Bsdf::dielectric(1.0, alpha);
        let (low, high) = range(&gpu, &white, 0.0);
        assert!(high <= 1.0 + 1e-5, "α {alpha}: {high}");
        // White dielectrics lose little light, only what facets hide from each other at grazing incidence.
        assert!(low > 0.5, "α {alpha}: {low}");
        assert!(range(&gpu, &white, 0.5).0 > 0.95, "α {alpha}");
        // Without reflectance at normal incidence, the coat's reflectance comes closest to its upper bound (guide/src/right/bsdf.md).
        let (_, high) = range(&gpu, &Bsdf { f0: glam::Vec3::ZERO, ..white }, 0.0);
        assert!(high <= 1.0 + 1e-5, "α {alpha}, index 1: {high}");
    }
    // A smooth surface reflects the fraction of Schlick's formula, and its base receives the remaining light.
    let (low, high) = range(&gpu, &Bsdf::dielectric(1.0, 0.0), 0.0);
    assert!(low > 1.0 - 1e-5 && high < 1.0 + 1e-5, "{low} to {high}");
}

#[test]
fn rough_glass_lets_through_no_more_than_it_receives() {
    let gpu = Gpu::for_tests();
    // Lobes are three times narrower in the denser medium. The quadrature resolves lobes with a width of 0.2 and more.
    for alpha in [0.2, 0.5, 1.0] {
        for bsdf in [Bsdf::pane(alpha), Bsdf::glass(alpha), Bsdf::glass(alpha).beyond()] {
            let (low, high) = range(&gpu, &bsdf, 0.0);
            assert!(high <= 1.0 + 1e-5, "{}: {high}", bsdf.describe());
            assert!(low > 0.2, "{}: {low}", bsdf.describe());
        }
        let paper = Bsdf { diffuse_transmission: 0.6, opacity: 0.5, ..Bsdf::dielectric(1.0, alpha) };
        let (_, high) = range(&gpu, &paper, 0.0);
        assert!(high <= 1.0 + 1e-5, "{}: {high}", paper.describe());
    }
    // Little light is lost at directions in which facets hardly hide each other.
    assert!(range(&gpu, &Bsdf::glass(0.2), 0.5).0 > 0.95);
    assert!(range(&gpu, &Bsdf::glass(0.2).beyond(), 0.8).0 > 0.9);
}

/// White materials of all kinds, with tilted shading normals, in all media, seen from random directions.
#[test]
fn no_material_returns_more_than_it_receives() {
    const LOOP: usize = 4096;
    let source = format!(
        "#import rng\n#import bsdf\n{READ_BSDF}{RANDOM_BSDF}
        fn work(index: u32) -> vec4f {{
            let bsdf = random_bsdf(index, true, index % 4u == 3u, index % 2u == 1u);
            var wo = uniform_direction(random4(index, 0u, 0u, 3u).xy);
            wo.z = abs(wo.z);
            var sum = 0.0;
            var squares = 0.0;
            for (var k = 0u; k < {LOOP}u; k += 1u) {{
                let weight = max_component(bsdf_sample(bsdf, wo, random4(index, k, 9u, 4u)).weight);
                // Relative to 1, since most weights are close to it: the squares keep their precision.
                sum += weight - 1.0;
                squares += (weight - 1.0) * (weight - 1.0);
            }}
            return vec4f(sum, squares, f32(index % 2u), bsdf.alpha);
        }}"
    );
    let found = run(&Gpu::for_tests(), &source, &[], &[[0.0; 4]], 2048);
    let count = LOOP as f64;
    let (mut worst, mut conserving) = (f64::MIN, 0);
    for &[sum, squares, ..] in &found {
        let gain = f64::from(sum) / count;
        let variance = (f64::from(squares) / count - gain * gain).max(0.0);
        // The tolerance covers sums of up to 4096 rounded terms.
        worst = worst.max(gain / ((variance / count).sqrt() + 1e-4));
        conserving += usize::from(gain > -0.01);
    }
    println!("greatest gain {worst:.2} standard errors; {conserving} of {} lose less than 1 %", found.len());
    // If all 2048 materials conserved energy exactly, the worst would exceed 4.5 standard errors with a probability of 1 %.
    assert!(worst < 4.5, "a material gains {worst} standard errors");
    assert!(conserving > found.len() / 10, "only {conserving} of {} keep the light", found.len());
}

/// `1 − F` of unpolarized light by the textbook formulas, in double precision.
fn transmittance(eta_o: f64, eta_t: f64, cos_o: f64) -> f64 {
    let sin_t = eta_o / eta_t * (1.0 - cos_o * cos_o).sqrt();
    if sin_t >= 1.0 {
        return 0.0;
    }
    let cos_t = (1.0 - sin_t * sin_t).sqrt();
    let s = (eta_o * cos_o - eta_t * cos_t) / (eta_o * cos_o + eta_t * cos_t);
    let p = (eta_t * cos_o - eta_o * cos_t) / (eta_t * cos_o + eta_o * cos_t);
    1.0 - (s * s + p * p) / 2.0
}

/// The fractions of reflected and of transmitted light, and the weight and probability of a sample, for each cosine.
fn shares(bsdf: &Bsdf, cosines: &[f32]) -> Vec<[f32; 4]> {
    let source = format!(
        "#import rng\n#import bsdf\n{READ_BSDF}
        fn work(index: u32) -> vec4f {{
            let bsdf = bsdf_at(0u);
            let cosine = input[5u + index].x;
            let wo = vec3f(sqrt(1.0 - cosine * cosine), 0.0, cosine);
            let deltas = bsdf_deltas(bsdf, cosine, bsdf_cosine_beyond(bsdf, cosine));
            let next = bsdf_sample(bsdf, wo, random4(index, 0u, 0u, 0u));
            return vec4f(deltas.reflected.x, deltas.transmitted.x, next.weight.x, next.pdf);
        }}"
    );
    let mut input = bsdf.encode().to_vec();
    assert_eq!(input.len(), BSDF_SIZE);
    input.extend(cosines.iter().map(|&cosine| [cosine, 0.0, 0.0, 0.0]));
    run(&Gpu::for_tests(), &source, &[], &input, cosines.len())
}

#[test]
fn smooth_glass_follows_fresnels_equations_and_loses_nothing() {
    let cosines: Vec<f32> = (1..=1000_u16).map(|k| f32::from(k) / 1000.0).collect();
    for bsdf in
        [Bsdf::glass(0.0), Bsdf::glass(0.0).beyond(), Bsdf { eta_t: 1.33, ..Bsdf::glass(0.0).beyond() }]
    {
        let found = shares(&bsdf, &cosines);
        let mut totally_reflected = 0;
        for ([reflected, transmitted, weight, pdf], &cosine) in found.iter().zip(&cosines) {
            let expected = transmittance(bsdf.eta_o.into(), bsdf.eta_t.into(), cosine.into());
            // Near the critical angle, 1 − F is about k cosθ_t, with k < 9 here. cos²θ_t is computed as a difference from 1 with an error
            // of 1.5e-7. The error of 1 − F is this error times k²/2, divided by 1 − F.
            let error = (f64::from(*transmitted) - expected).abs();
            assert!(error < 6e-6 / expected.max(1e-3), "{bsdf:?} at {cosine}: {transmitted}, not {expected}");
            assert!((reflected + transmitted - 1.0).abs() <= 2.0 * f32::EPSILON, "{bsdf:?} at {cosine}");
            assert!((weight - 1.0).abs() <= 2.0 * f32::EPSILON, "{bsdf:?} at {cosine}: weight {weight}");
            assert!(*pdf > 0.0, "{bsdf:?} at {cosine}");
            totally_reflected += usize::from(*transmitted == 0.0 && *reflected == 1.0 && *pdf == 1.0);
        }
        // Beyond the critical angle, cosθ < √(1 − (n_t/n_o)²).
        let ratio = bsdf.eta_t / bsdf.eta_o;
        let critical = (1000.0 * (1.0 - ratio * ratio).max(0.0).sqrt()).floor() as usize;
        assert_eq!(totally_reflected, critical, "{bsdf:?}");
    }
}

#[test]
fn smooth_panes_and_mirrors_lose_nothing() {
    let cosines: Vec<f32> = (1..=1000_u16).map(|k| f32::from(k) / 1000.0).collect();
    for ([reflected, transmitted, weight, pdf], &cosine) in
        shares(&Bsdf::pane(0.0), &cosines).iter().zip(&cosines)
    {
        // glTF's pane has a single factor of Schlick's reflectance.
        let expected = 0.04 + 0.96 * (1.0 - cosine).powi(5);
        assert!((reflected - expected).abs() < 4.0 * f32::EPSILON, "{cosine}: {reflected}, not {expected}");
        assert!((reflected + transmitted - 1.0).abs() <= f32::EPSILON, "{cosine}");
        assert!((weight - 1.0).abs() <= 2.0 * f32::EPSILON && *pdf > 0.0, "{cosine}: weight {weight}");
    }
    for [reflected, transmitted, weight, pdf] in shares(&Bsdf::metal(1.0, 0.0), &cosines) {
        assert_eq!([reflected, transmitted, weight, pdf], [1.0, 0.0, 1.0, 1.0]);
    }
}

#[test]
fn shader_and_host_agree_on_what_is_smooth() {
    let source = "#import fresnel\nfn work(index: u32) -> vec4f { return vec4f(MIN_ALPHA); }";
    assert_eq!(run(&Gpu::for_tests(), source, &[], &[[0.0; 4]], 1)[0][0], crate::render::MIN_ALPHA);
}
