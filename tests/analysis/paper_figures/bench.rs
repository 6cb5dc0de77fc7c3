//! The corner, in focus and out of it, and a target for it.

use krylux::Result;
use krylux::analysis::{CompensateOptions, CompensationRow, Target};
use krylux::image::{Blur, Image, Resolution};
use krylux::krylov::{Method, SolveOptions, dot, norm, solve_adjoint};
use krylux::operator::{Adjoint, Operator, Symmetry};
use krylux::transport::{Assembled, Channels, MatrixOperator, Part};

use crate::common::{reference, settings, traced};

pub const SIDE: usize = 64;
pub const SIZE: Resolution = Resolution { width: SIDE, height: SIDE };

pub fn corner() -> &'static Assembled {
    traced("corner", settings(SIDE, 256, 6, 0), Channels::Luma)
}

pub fn part(part: Part) -> MatrixOperator<'static> {
    MatrixOperator::new(&corner().matrix, part, 0)
}

pub fn gray(values: &[f64]) -> Image {
    Image::new(SIZE, 1, values.iter().map(|&value| value as f32).collect()).unwrap()
}

pub fn wish_for(target: &[f64]) -> Target {
    Target::new(&gray(target), &Image::filled(SIZE, 1, 0.0)).unwrap()
}

pub fn options(method: Method, photos: usize) -> CompensateOptions {
    let peak = Some(0.5 / std::f64::consts::PI);
    CompensateOptions { method, photos, peak, rtol: 0.0, ..CompensateOptions::default() }
}

pub fn at(rows: &[CompensationRow], photo: usize) -> f64 {
    rows[photo.min(rows.len()) - 1].residual
}

/// The corner through lenses out of focus by `projector` and `camera` pixels.
pub struct Defocused {
    blurs: [Option<Blur>; 2],
}

impl Defocused {
    pub fn new(projector: f64, camera: f64) -> Self {
        Self { blurs: [projector, camera].map(|width| Blur::new(SIZE, width)) }
    }

    fn product(&self, first: usize, x: &[f64], y: &mut [f64]) {
        let through = |blur: &Option<Blur>, x: &[f64]| blur.as_ref().map_or(x.to_vec(), |blur| blur.apply(x));
        let mut sharp = vec![0.0; x.len()];
        corner().matrix.apply(Part::Full, 0, &through(&self.blurs[first], x), &mut sharp);
        y.copy_from_slice(&through(&self.blurs[1 - first], &sharp));
    }
}

impl Operator for Defocused {
    fn rows(&self) -> usize {
        SIDE * SIDE
    }
    fn cols(&self) -> usize {
        SIDE * SIDE
    }
    fn symmetry(&self) -> Symmetry {
        if self.blurs[0].is_some() && self.blurs[1].is_some() {
            Symmetry::Symmetric
        } else {
            Symmetry::General
        }
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.product(0, x, y);
        Ok(())
    }
}

impl Adjoint for Defocused {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.product(1, y, x);
        Ok(())
    }
}

/// No pattern in [0, 1] has a smaller relative residual: by the gap of Frank and Wolfe at a point from accelerated gradients,
/// `‖b − A z‖² ≥ ‖r‖² + 2 (Aᵀr)ᵀ(x − z)`, of which the least over the box is a sum over pixels.
pub fn lower_bound(operator: &mut dyn Adjoint, b: &[f64]) -> f64 {
    let sharp = SolveOptions { products: 1000, rtol: 0.0, ..SolveOptions::default() };
    let x = solve_adjoint(Method::Fista, operator, b, &sharp).unwrap().x;
    let (mut y, mut gradient) = (vec![0.0; b.len()], vec![0.0; b.len()]);
    operator.apply(&x, &mut y).unwrap();
    let r: Vec<f64> = b.iter().zip(&y).map(|(b, y)| b - y).collect();
    operator.apply_adjoint(&r, &mut gradient).unwrap();
    let gap: f64 = x.iter().zip(&gradient).map(|(x, g)| if *g > 0.0 { g * (1.0 - x) } else { -g * x }).sum();
    let square = dot(&r, &r) - 2.0 * gap;
    assert!(square > 0.98 * dot(&r, &r), "the bound is too weak to test anything: {gap:e}");
    square.sqrt() / norm(b)
}

pub fn target() -> Vec<f64> {
    reference("target_64.npy")
}

pub fn light() -> Vec<f64> {
    target().iter().map(|value| 0.5 / std::f64::consts::PI * value).collect()
}

/// The mean of gradients' magnitudes at the pixels where the target's is largest.
pub fn edges(image: &[f64], target: &[f64]) -> f64 {
    let gradient = |of: &[f64], pixel: usize| {
        let (x, y) = (pixel % SIDE, pixel / SIDE);
        let along = |a: usize, b: usize| of[b] - of[a];
        let dx = along(y * SIDE + x.saturating_sub(1), y * SIDE + (x + 1).min(SIDE - 1));
        let dy = along(y.saturating_sub(1) * SIDE + x, (y + 1).min(SIDE - 1) * SIDE + x);
        0.5 * dx.hypot(dy)
    };
    let mut pixels: Vec<usize> = (0..SIDE * SIDE).collect();
    pixels.sort_by(|&a, &b| gradient(target, b).total_cmp(&gradient(target, a)));
    let strongest = &pixels[..SIDE * SIDE / 20];
    strongest.iter().map(|&pixel| gradient(image, pixel)).sum::<f64>() / strongest.len() as f64
}

/// The corner's direct image under white.
pub fn direct() -> Vec<f64> {
    let mut direct = vec![0.0; SIDE * SIDE];
    part(Part::Direct).apply(&vec![1.0; SIDE * SIDE], &mut direct).unwrap();
    direct
}
