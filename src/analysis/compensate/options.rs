//! What is asked for.

use crate::error::{Error, Result};
use crate::krylov::{Constraint, Method};

/// What [`compensate`](super::compensate()) is asked for.
#[derive(Clone, Copy, Debug)]
pub struct CompensateOptions {
    /// The method. Default: [`Method::KrylovBox`].
    pub method: Method,
    /// Photos that it may take, beside those of [`Compensation::preparation`](super::Compensation::preparation). Default 20.
    pub photos: usize,
    /// Done when what is seen differs from what is wished by at most this share of it (2-norms). Default 1e-3.
    pub rtol: f64,
    /// The least that is projected, the paper's `α` in [α, 1]. From 0 to below 1; default 0.
    pub floor: f64,
    /// The radiance that 1 in the target stands for, in W/(m² sr). Default `None`: half the median of the white photo.
    pub peak: Option<f64>,
    /// How methods without constraint are preconditioned. Default `None`: [`Precondition::Diagonal`] for them on symmetric
    /// operators, and nothing for those inside a box, which scale their steps by the white photo anyway.
    pub precondition: Option<Precondition>,
    /// The width of the lens' blur, for [`Precondition::Defocus`], in pixels (the standard deviation of a Gaussian). Default
    /// `None`: told from one photo.
    pub defocus: Option<f64>,
    /// That some lens is out of focus: [`Method::KrylovBox`] then takes the light for a mixture of blurs, told from its photos,
    /// where it has not seen better, and no longer knows when it is at the optimum. So it does anyway where the operator is not
    /// symmetric. Default false.
    pub out_of_focus: bool,
    /// The target's values are moved from [0, 1] to [`lift`, 1] before they are wished for, as the paper does so that less light
    /// has to be taken away. From 0 to below 1; default 0.
    pub lift: f64,
    /// Whether projected Jacobi is given as many photos, to be compared with, and what clipping does is photographed step by
    /// step. On a rig these photos are dear. Default true.
    pub baseline: bool,
}

/// An approximate inverse from what is known of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Precondition {
    /// None.
    None,
    /// Division by the white photo, `D = A 1`.
    Diagonal,
    /// That, and a gain for each scale of an image pyramid, measured by one photo more:
    /// [`Multiscale::measured`](crate::krylov::Multiscale::measured).
    Multiscale,
    /// Division by the direct image: [`Prior::direct`](super::Prior::direct), or measured by 16 photos of shifted squares.
    Direct,
    /// Division by the direct image that the scene's shape alone predicts: [`Prior::geometry`](super::Prior::geometry).
    Geometry,
    /// Division by the white photo and by the frequencies of a lens out of focus: its width given, or measured by one photo more.
    Defocus,
}

impl Default for CompensateOptions {
    fn default() -> Self {
        Self {
            method: Method::KrylovBox,
            photos: 20,
            rtol: 1e-3,
            floor: 0.0,
            peak: None,
            precondition: None,
            defocus: None,
            out_of_focus: false,
            lift: 0.0,
            baseline: true,
        }
    }
}

impl CompensateOptions {
    /// The paper's recipe (section 6): unconstrained residuals are made small by MINRES, or by GMRES where the operator is not
    /// `symmetric`, preconditioned by the direct image; the target is moved to [α, 1] (`lift`), and what still leaves the
    /// projector's range is clamped. Five photos.
    pub fn paper(symmetric: bool, lift: f64) -> Self {
        Self {
            method: if symmetric { Method::Minres } else { Method::Gmres },
            photos: 5,
            rtol: 0.0,
            precondition: Some(Precondition::Direct),
            lift,
            ..Self::default()
        }
    }

    /// Refuses values that cannot be used, before any photo.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--photos`, `--rtol`, `--floor`, `--lift`, `--peak`, `--defocus` or `--precondition`.
    pub fn check(&self) -> Result<()> {
        let refuse = |option: &str, fault: String, help: &str| {
            Err(Error::Option { option: option.into(), fault, help: help.into() })
        };
        if self.photos == 0 {
            return refuse("--photos", "0 photos were asked for".into(), "ask for at least 1");
        }
        if !(self.rtol >= 0.0 && self.rtol.is_finite()) {
            return refuse("--rtol", format!("{} is no tolerance", self.rtol), "give 0 or a positive number");
        }
        if !(0.0..1.0).contains(&self.floor) {
            let fault = format!("[{}, 1] is no box to project in", self.floor);
            return refuse("--floor", fault, "give a number from 0 to below 1");
        }
        if !(0.0..1.0).contains(&self.lift) {
            let fault = format!("[{}, 1] leaves no contrast", self.lift);
            return refuse("--lift", fault, "give a number from 0 to below 1");
        }
        if let Some(width) = self.defocus
            && !(0.0..1000.0).contains(&width)
        {
            return refuse("--defocus", format!("{width} pixels"), "give a standard deviation from 0 on");
        }
        if let Some(peak) = self.peak
            && !(peak > 0.0 && peak.is_finite())
        {
            return refuse("--peak", format!("{peak} is no radiance"), "give a positive number in W/(m² sr)");
        }
        let wanted = self.precondition.is_some_and(|kind| kind != Precondition::None);
        if wanted && self.method.facts().constraint != Constraint::None {
            let fault = format!("{} takes no preconditioner", self.method.facts().name);
            let help = "leave it out: methods inside a box scale their steps by the white photo anyway";
            return refuse("--precondition", fault, help);
        }
        Ok(())
    }

    /// What a method without constraint is preconditioned by.
    pub(super) fn unconstrained_preconditioning(&self) -> Precondition {
        self.precondition.unwrap_or(Precondition::Diagonal)
    }
}
