//! What a compensation is asked for, of whatever source.

use std::path::PathBuf;

use clap::ValueEnum;

use crate::analysis::{CompensateOptions, Precondition};
use crate::cli::options::{count, method, number};
use crate::cli::pattern;
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::krylov::{Constraint, Method};
use crate::transport::Channels;

/// What is asked, of whatever source.
#[derive(clap::Args)]
pub(in crate::cli) struct Question {
    /// What is to be seen: a .npy, .exr or .png file of values in [0, 1], as large as --size
    #[arg(long, value_name = "FILE")]
    target: PathBuf,
    /// The paper's recipe: MINRES (GMRES where the rig is not coaxial) preconditioned by the direct image, five photos, the
    /// target moved to [0.1, 1], and the answer clamped. Options given beside it replace those of the recipe
    #[arg(long)]
    paper: bool,
    /// How: inside the projector's range: krylov-box, fista, jacobi; not negative: mrnsd, multiplicative; clipped
    /// afterwards: minres, gmres, fgmres, cg, cgs, bicgstab, lsqr, lsmr [default: krylov-box]
    #[arg(long, value_name = "NAME", value_parser = method)]
    method: Option<Method>,
    /// Photos that the method may take, beside the white one [default: 20, or the budget of the run that is SOURCE]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    photos: Option<usize>,
    /// Done when what is seen differs from the target by at most this share of it; exit status 1 if that is not reached
    /// [default: 0.001, and no such status]
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    rtol: Option<f64>,
    /// Move the target's values from [0, 1] to [α, 1], so that less light has to be taken away [default: 0]
    #[arg(long, value_name = "α", value_parser = number::<f64>)]
    lift: Option<f64>,
    /// The least that is projected: the box is [α, 1]
    #[arg(long, value_name = "α", default_value_t = 0.0, value_parser = number::<f64>)]
    pub(super) floor: f64,
    /// What speeds up methods without a box [default: diagonal]
    #[arg(long, value_enum)]
    precondition: Option<PreconditionArg>,
    /// Some lens is out of focus: krylov-box takes the light for a mixture of blurs, as it does anyway where the rig is not coaxial
    #[arg(long)]
    out_of_focus: bool,
    /// The width of the lens' blur in pixels, for --precondition defocus [default: measured by one photo more]
    #[arg(long, value_name = "PIXELS", value_parser = number::<f64>)]
    defocus: Option<f64>,
}

#[derive(Clone, Copy, ValueEnum)]
enum PreconditionArg {
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

impl From<PreconditionArg> for Precondition {
    fn from(argument: PreconditionArg) -> Self {
        match argument {
            PreconditionArg::None => Self::None,
            PreconditionArg::Diagonal => Self::Diagonal,
            PreconditionArg::Multiscale => Self::Multiscale,
            PreconditionArg::Direct => Self::Direct,
            PreconditionArg::Geometry => Self::Geometry,
            PreconditionArg::Defocus => Self::Defocus,
        }
    }
}

impl Question {
    /// The library's options for a rig whose light transport is symmetric or not; `photos_of_run` is the default budget of a run that is asked again.
    pub(in crate::cli) fn options_on(
        &self,
        symmetric: bool,
        photos_of_run: Option<usize>,
    ) -> CompensateOptions {
        let base =
            if self.paper { CompensateOptions::paper(symmetric, 0.1) } else { CompensateOptions::default() };
        let method = self.method.unwrap_or(base.method);
        let free = method.facts().constraint == Constraint::None;
        CompensateOptions {
            method,
            photos: self.photos.or(photos_of_run).unwrap_or(base.photos),
            rtol: self.rtol.unwrap_or(base.rtol),
            must_reach: self.rtol.is_some(),
            floor: self.floor,
            lift: self.lift.unwrap_or(base.lift),
            precondition: self.precondition.map(Into::into).or(base.precondition.filter(|_| free)),
            defocus: self.defocus,
            out_of_focus: self.out_of_focus,
            ..base
        }
    }

    /// Photos that correct a model's answer at most.
    pub(super) fn corrections(&self) -> usize {
        self.photos.unwrap_or(CompensateOptions::default().photos)
    }

    /// The target, of the right size and with values that make sense.
    pub(in crate::cli) fn target(&self, resolution: Resolution, channels: Channels) -> Result<Image> {
        let image = pattern::read_sized(&self.target, resolution)?;
        let unusable =
            |fault: String, help: &str| Error::Data { path: self.target.clone(), fault, help: help.into() };
        let image = match image.channels() > channels.count() {
            true => image.gray().ok_or_else(|| {
                unusable(
                    "it has colours, but --channels luma has none".into(),
                    "give a gray image, or --channels rgb",
                )
            })?,
            false => image,
        };
        let range = |(low, high): (f32, f32), &value: &f32| (low.min(value), high.max(value));
        let (low, high) = image.samples().iter().fold((f32::INFINITY, f32::NEG_INFINITY), range);
        if low < 0.0 || high > 1.0 {
            let fault = format!("its values are from {low} to {high}, but a target's are from 0 to 1");
            return Err(unusable(fault, "scale it, and say by --peak what 1 stands for"));
        }
        if high == 0.0 {
            return Err(unusable("it is black".into(), "give an image with light in it"));
        }
        Ok(image)
    }
}
