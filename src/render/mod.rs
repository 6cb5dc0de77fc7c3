//! The tracer: light paths of a scene, once, as connections between camera and projector pixels.
//!
//! # The estimator
//!
//! A light path `x̄ = x₁ … x_k` runs from the pinhole over `k` surface points and back to it. Camera pixel `j` sees `x₁`,
//! projector pixel `i` lights `x_k`. With `D(x) = cosθ_x / (r² cos³θ)`, the area that a surface element covers on the
//! image plane at distance 1, and `a` the image-plane area of a pixel,
//!
//! ```text
//! A_ji = ∫ F(x̄) dx̄,    F = D(x₁)/a · f(x₁) G f(x₂) G … f(x_k) · D(x_k)
//! ```
//!
//! over the paths with `x₁` in `j` and `x_k` in `i`; `f` is the BSDF and `G` the geometry term with visibility. `F` does
//! not change when the path is reversed, so `A = Aᵀ`.
//!
//! `N` paths are sampled from each camera pixel, the first point uniformly over the pixel's area (box filter), each next
//! one from the BSDF, so that a path from `j` has the density `p_f = D(x₁)/a · Π p(x_m → x_{m+1})`. Its reverse could have
//! been sampled from pixel `i`, with `p_r = D(x_k)/a · Π p(x_{m+1} → x_m)`. The balance heuristic (Veach and Guibas 1995)
//! weights the two strategies to `v = F / (p_f + p_r)`, and every sampled path of two bounces or more deposits `v/N` at
//! `(j, i)` **and** at `(i, j)`: unbiased, and symmetric to the last bit. One-bounce paths see and light the same point,
//! `i = j`: the direct part is exactly the diagonal, and its samples carry `f D` alone.
//!
//! The kernel (`shaders/trace_paths.wgsl`) writes each connection to a slot of its own, so no two invocations ever touch
//! the same memory and a run repeats to the bit.
//!
//! # Conventions and limits
//!
//! * A pattern value of 1 gives an irradiance of 1 W/m² on a fronto-parallel plane at 1 m, uniformly over the field;
//!   a photo is radiance in W/(m² sr). A white Lambertian plane at distance `d` photographs as `1/(π d²)`.
//! * Geometric normals carry every cosine. Interpolated vertex normals are not used.
//! * The back of a one-sided surface is black: to let light through from one side only would not be reciprocal.
//! * Values of the BSDF are for basic radiance `L/n²`, in which transport is symmetric in any media; in air that is `L`.
//! * No material returns more than it receives. To that end the diffuse base under a dielectric's coat is dimmed on the way
//!   in and out, by `(1 − R(θ_o)) (1 − R(θ_i)) / (1 − R̄)`, where `R` is at least what the coat mirrors; glTF's sample
//!   implementation, not normative, has `1 − F(V·H)`, with which smooth white dielectrics return up to 1.44 times what they
//!   receive. `docs/bsdf.md` has all formulas.
//! * Microfacets scatter once: what they send to each other is lost.
//! * Surfaces of microfacet width `α = roughness²` below 0.001 ([`MIN_ALPHA`]) are smooth.
//! * Emission is seen along the camera's paths only, and makes the ambient photo.

mod batch;
mod dispatch;
mod geometry;
mod materials;
mod parameters;
mod photons;
mod pipeline;
mod rig;
mod sampler;
#[cfg(test)]
mod tests;
mod textures;
mod tracer;

pub use batch::{Batch, Connection};
pub use materials::MIN_ALPHA;
pub use photons::Gather;
pub use sampler::Sampler;
pub use tracer::{MAX_BOUNCES, Progress, TraceSettings, TraceSummary, Tracer};

pub use crate::gpu::AdapterSummary;

/// All graphics adapters of this machine that could trace; an empty list is not an error.
pub fn adapters() -> Vec<AdapterSummary> {
    crate::gpu::device::adapters()
}

/// The error for a machine without any adapter: names what to install.
pub fn no_adapter() -> crate::Error {
    crate::gpu::device::no_adapter()
}
