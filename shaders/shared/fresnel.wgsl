// Reflectance of an interface as a function of the angle of incidence. No function here uses `pow`, whose result differs between devices.

// A surface with a smaller microfacet width counts as smooth: it reflects and refracts into single directions.
const MIN_ALPHA = 1e-3;

// Schlick's weight (1 − cosθ)⁵.
fn schlick_weight(cosine: f32) -> f32 {
    let away = clamp(1.0 - cosine, 0.0, 1.0);
    return away * away * (away * away) * away;
}

// The cosine beyond an interface by Snell's law; 0 at total reflection. `ratio` is the index on this side over the index beyond.
fn refracted_cosine(cosine: f32, ratio: f32) -> f32 {
    return sqrt(max(0.0, 1.0 - ratio * ratio * (1.0 - cosine * cosine)));
}

// Shares of unpolarized light that a smooth interface between two dielectrics reflects (x) and transmits (y), from the cosines on both
// sides, by Fresnel's equations. Exchanging the sides gives the same bits, and neither share loses precision where it is small.
fn fresnel_shares(eta_o: f32, cos_o: f32, eta_t: f32, cos_t: f32) -> vec2f {
    let a = vec2f(eta_o * cos_o, eta_t * cos_o);
    let b = vec2f(eta_t * cos_t, eta_o * cos_t);
    let sum = a + b;
    let mirrored = (a - b) / sum;
    let crossing = 2.0 * (eta_o * eta_t) * (cos_o * cos_t) / (sum * sum);
    return vec2f(0.5 * dot(mirrored, mirrored), crossing.x + crossing.y);
}

// An upper bound of the directional albedo E(c) of a rough Schlick reflector at the cosine c, with width α and with reflectance f0 at
// normal and f90 at grazing incidence: E(c) ≤ f0 + (f90 − f0) s(c), with x = 1 − c and
//   s(c) = x⁵ / (1 + 13 α²) + c² (x² + 0.002) / 10.
// A smooth surface has s(c) = x⁵, and the bound is exact. A rough surface reflects less at grazing incidence, where facets hide each other,
// and a little more at steeper angles, because of facets that face away. The bound was fitted to the integral for widths from 0.001 to 1.
fn mirrored_bound(f0: f32, f90: f32, alpha: f32, cosine: f32) -> f32 {
    let away = 1.0 - cosine;
    let facing_away = cosine * cosine * (away * away + 0.002) * 0.1;
    return f0 + (f90 - f0) * select(
        schlick_weight(cosine) / (1.0 + 13.0 * alpha * alpha) + facing_away,
        schlick_weight(cosine),
        alpha < MIN_ALPHA,
    );
}

// The cosine-weighted mean of that bound over the hemisphere: ∫ x⁵ 2c dc = 1/21, ∫ x² c² 2c dc = 1/30, ∫ c² 2c dc = 1/2.
fn mirrored_bound_mean(f0: f32, f90: f32, alpha: f32) -> f32 {
    let rough = (1.0 / 21.0) / (1.0 + 13.0 * alpha * alpha) + (1.0 / 30.0 + 0.001) * 0.1;
    return f0 + (f90 - f0) * select(rough, 1.0 / 21.0, alpha < MIN_ALPHA);
}
