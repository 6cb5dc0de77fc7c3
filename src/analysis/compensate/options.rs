//! The options of a compensation.

use crate::error::{Error, Result};
use crate::krylov::{Constraint, Method};

/// The options of [`compensate`](super::compensate()).
#[derive(Clone, Copy, Debug)]
pub struct CompensateOptions {
    /// The method. Default: [`Method::KrylovBox`].
    pub method: Method,
    /// The largest number of photos of the method, without [`Compensation::preparation`](super::Compensation::preparation). Default 20.
    pub photos: usize,
    /// The relative residual (2-norms) at which the method stops. Default 1e-3.
    pub rtol: f64,
    /// True if a pattern that misses `rtol` is not good, because the user requested this tolerance. Otherwise a pattern is also good if it
    /// is better than no compensation and the method ended because its photos were spent or their noise was reached. Default false.
    pub must_reach: bool,
    /// The smallest projected value. From 0 to below 1; default 0.
    pub floor: f64,
    /// The radiance of a target value of 1, in W/(m² sr). Default `None`: half the median of the white photo.
    pub peak: Option<f64>,
    /// The preconditioner of unconstrained methods. Default `None`: [`Precondition::Diagonal`] if the operator is symmetric.
    /// Box-constrained methods use no preconditioner, because they scale their steps by the white photo anyway.
    pub precondition: Option<Precondition>,
    /// The standard deviation of the lens's blur in pixels, for [`Precondition::Defocus`]. Default `None`: it is measured by one photo.
    pub defocus: Option<f64>,
    /// True if the lens of the projector or of the camera is out of focus. [`Method::KrylovBox`] then models unmeasured light as a mixture
    /// of blurs, fitted to its photos, and cannot recognize the optimum. The same applies if the operator is not symmetric. Default false.
    pub out_of_focus: bool,
    /// Maps the target from [0, 1] to [`lift`, 1] (section 6.3 of the paper, where it is α). The solution then has fewer negative values,
    /// and the photo less contrast. From 0 to below 1; default 0.
    pub lift: f64,
    /// True if projected Jacobi runs as a baseline with the same number of photos, and if the effect of clipping is photographed after each
    /// step. On a rig these photos are expensive. Default true.
    pub baseline: bool,
}

/// An approximate inverse from prior knowledge of the scene: [`Prior`](super::Prior), or further photos.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Precondition {
    /// Nothing
    None,
    /// Division by the white photo
    Diagonal,
    /// That, and a gain for each scale, measured by one photo more
    Multiscale,
    /// Division by the direct image: the simulator's, or measured by 16 photos of shifted squares
    Direct,
    /// Division by the direct image that the scene's shape predicts, whatever its colours
    Geometry,
    /// Division by the white photo and by the frequencies that a lens out of focus leaves
    Defocus,
}

impl Default for CompensateOptions {
    fn default() -> Self {
        Self {
            method: Method::KrylovBox,
            photos: 20,
            rtol: 1e-3,
            must_reach: false,
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
    /// MINRES and clamping as in section 8.3 of the paper, with the five photos of figure 11; GMRES if the operator is not `symmetric`, which
    /// that section names beside CGS. The paper sets negative values to zero. Here values above 1 are clamped, too. The section names neither
    /// the preconditioners of section 6.4 nor the mapping of section 6.3 (`lift`), so they are left out.
    pub fn paper(symmetric: bool) -> Self {
        Self {
            method: if symmetric { Method::Minres } else { Method::Gmres },
            photos: 5,
            rtol: 0.0,
            precondition: Some(Precondition::None),
            ..Self::default()
        }
    }

    /// Checks all values before any photo is taken. Fails with [`Error::Option`] naming the invalid option.
    pub fn check(&self) -> Result<()> {
        let refuse = |option: &str, fault: String, help: &str| Err(Error::option(option, fault).help(help));
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

    pub(super) fn unconstrained_preconditioning(&self) -> Precondition {
        self.precondition.unwrap_or(Precondition::Diagonal)
    }
}
