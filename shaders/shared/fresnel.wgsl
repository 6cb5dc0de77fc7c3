// How much light an interface mirrors, by the angle of incidence. `pow` differs from device to device: none here.

// A surface of smaller microfacet width is smooth: it mirrors and refracts in single directions.
const MIN_ALPHA = 1e-3;

// Schlick's (1 − cosθ)⁵.
fn schlick_weight(cosine: f32) -> f32 {
    let away = clamp(1.0 - cosine, 0.0, 1.0);
    return away * away * (away * away) * away;
}

// Snell's law: the cosine beyond the interface, with the ratio of the index on this side to that beyond; 0 where light is
// totally reflected.
fn refracted_cosine(cosine: f32, ratio: f32) -> f32 {
    return sqrt(max(0.0, 1.0 - ratio * ratio * (1.0 - cosine * cosine)));
}

// Shares of unpolarized light that a smooth interface between two dielectrics mirrors and lets through, from the cosines on
// both sides, by Fresnel's equations. Symmetric to the bit, and neither cancels where it is small.
fn fresnel_shares(eta_o: f32, cos_o: f32, eta_t: f32, cos_t: f32) -> vec2f {
    let a = vec2f(eta_o * cos_o, eta_t * cos_o);
    let b = vec2f(eta_t * cos_t, eta_o * cos_t);
    let sum = a + b;
    let mirrored = (a - b) / sum;
    let crossing = 2.0 * (eta_o * eta_t) * (cos_o * cos_t) / (sum * sum);
    return vec2f(0.5 * dot(mirrored, mirrored), crossing.x + crossing.y);
}

// At least what a Schlick surface of width α, with reflectance f0 at normal incidence and f90 at grazing incidence, mirrors
// towards a cosine c in all: E(c) ≤ f0 + (f90 − f0) s(c), with x = 1 − c and
//   s(c) = x⁵ / (1 + 13 α²) + c² (x² + 0.002) / 10    (where it is smooth: x⁵, and equal).
// A rough surface mirrors less at grazing incidence, where facets hide each other, and a little more at steeper angles, for
// its facets that face away. Fitted as a bound to the integral for widths from 0.001 to 1.
fn mirrored_bound(f0: f32, f90: f32, alpha: f32, cosine: f32) -> f32 {
    let away = 1.0 - cosine;
    let facing_away = cosine * cosine * (away * away + 0.002) * 0.1;
    return f0 + (f90 - f0) * select(
        schlick_weight(cosine) / (1.0 + 13.0 * alpha * alpha) + facing_away,
        schlick_weight(cosine),
        alpha < MIN_ALPHA,
    );
}

// That bound's mean over the hemisphere, weighted by the cosine: ∫ x⁵ 2c dc = 1/21, ∫ x² c² 2c dc = 1/30, ∫ c² 2c dc = 1/2.
fn mirrored_bound_mean(f0: f32, f90: f32, alpha: f32) -> f32 {
    let rough = (1.0 / 21.0) / (1.0 + 13.0 * alpha * alpha) + (1.0 / 30.0 + 0.001) * 0.1;
    return f0 + (f90 - f0) * select(rough, 1.0 / 21.0, alpha < MIN_ALPHA);
}
