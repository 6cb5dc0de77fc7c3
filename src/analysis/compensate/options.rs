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
    /// How methods without constraint are preconditioned. Default `None`: [`Precondition::Diagonal`] for them on
    /// symmetric operators, and
    /// nothing for those inside a box, which scale their steps by the white photo anyway.
    pub precondition: Option<Precondition>,
    /// Whether projected Jacobi is given as many photos, to be compared with. On a rig these are dear. Default true.
    pub baseline: bool,
}

/// An approximate inverse from the photos that are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precondition {
    /// None.
    None,
    /// Division by the white photo, `D = A 1`.
    Diagonal,
    /// That, and a gain for each scale of an image pyramid, measured by one photo more: [`Multiscale::measured`](crate::krylov::Multiscale::measured).
    Multiscale,
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
            baseline: true,
        }
    }
}

impl CompensateOptions {
    /// Refuses values that cannot be used, before any photo.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--photos`, `--rtol`, `--floor`, `--peak` or `--precondition`.
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
        if let Some(peak) = self.peak
            && !(peak > 0.0 && peak.is_finite())
        {
            return refuse("--peak", format!("{peak} is no radiance"), "give a positive number in W/(m² sr)");
        }
        if self.preconditioning() != Precondition::None && !self.is_preconditioned() {
            let fault = format!("{} takes no preconditioner", self.method.facts().name);
            let help = "leave it out: methods inside a box scale their steps by the white photo anyway";
            return refuse("--precondition", fault, help);
        }
        Ok(())
    }

    fn is_preconditioned(&self) -> bool {
        self.method.facts().constraint == Constraint::None
    }

    pub(super) fn preconditioning(&self) -> Precondition {
        let default = if self.is_preconditioned() { Precondition::Diagonal } else { Precondition::None };
        self.precondition.unwrap_or(default)
    }
}
