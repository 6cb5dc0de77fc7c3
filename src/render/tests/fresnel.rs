//! Smooth interfaces against Fresnel's equations.

use super::kernel::{gpu, run};
use super::material::{BSDF_SIZE, Bsdf, READ_BSDF};

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

/// Reflected and transmitted shares, and a sample's weight and probability, at each cosine.
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
    run(&gpu(), &source, &[], &input, cosines.len())
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
            // Near the critical angle 1 − F goes as k cosθ_t, k < 9 here, and cos²θ_t, a difference from 1,
            // has an error of 1.5e-7: k²/2 times that, divided by 1 − F.
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
        // glTF's pane: Schlick's reflectance, once.
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
    assert_eq!(run(&gpu(), source, &[], &[[0.0; 4]], 1)[0][0], crate::render::MIN_ALPHA);
}
