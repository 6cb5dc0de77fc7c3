//! The target of a compensation: the desired photo of the scene.

use crate::analysis::planes::{Planes, difference, sum, times};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::krylov::{dot, norm};
use crate::operator::Adjoint;

/// A target in [0, 1], and the light without the projector. Both have one plane per channel.
#[derive(Clone, Debug)]
pub struct Target {
    resolution: Resolution,
    projector: Resolution,
    target: Planes,
    ambient: Planes,
}

impl Target {
    /// Makes a target under `ambient` light in W/(m² sr). The ambient light has one channel per system; a gray target applies to all
    /// channels. Fails with [`Error::Dimension`] if target and ambient light differ in size, or if the target is coloured and the ambient
    /// light is gray.
    pub fn new(target: &Image, ambient: &Image) -> Result<Self> {
        let resolution = ambient.resolution();
        Error::check_size("pixels of the target", resolution, target.resolution())?;
        let count = ambient.channels();
        if target.channels() > count {
            return Err(Error::dimension("channels of the target", count, target.channels()));
        }
        Ok(Self {
            resolution,
            projector: resolution,
            target: (0..count).map(|channel| target.plane(channel.min(target.channels() - 1))).collect(),
            ambient: (0..count).map(|channel| ambient.plane(channel)).collect(),
        })
    }

    /// The target for patterns of another size than that of photos.
    #[must_use]
    pub fn for_projector(self, projector: Resolution) -> Self {
        Self { projector, ..self }
    }

    /// The resolution of patterns.
    pub fn projector(&self) -> Resolution {
        self.projector
    }

    pub(super) fn has_one_size(&self) -> bool {
        self.resolution == self.projector
    }

    /// The target with values mapped from [0, 1] to [`lift`, 1]: `t ← α + (1 − α) t`, where `α` is `lift`.
    pub(super) fn lifted(&self, lift: f64) -> Self {
        let plane = |plane: &Vec<f64>| plane.iter().map(|value| lift + (1.0 - lift) * value).collect();
        Self { target: self.target.iter().map(plane).collect(), ..self.clone() }
    }

    /// The resolution of photos.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    pub(super) fn pixels(&self) -> usize {
        self.resolution.pixels()
    }

    pub(super) fn fits<O: Adjoint>(&self, channels: &[O]) -> Result<()> {
        Error::check_size("operators of a compensation", self.target.len(), channels.len())?;
        channels.iter().try_for_each(|operator| {
            Error::check_size("rows of a compensation's operator", self.pixels(), operator.rows())?;
            Error::check_size(
                "columns of a compensation's operator",
                self.projector.pixels(),
                operator.cols(),
            )
        })
    }

    /// The default peak: half the median of the white photo with ambient light. An even scene can then be twice as bright as the peak.
    pub(super) fn default_peak(&self, white: &[Vec<f64>]) -> Result<f64> {
        let seen = white.iter().zip(&self.ambient).flat_map(|(w, a)| w.iter().zip(a).map(|(w, a)| w + a));
        match 0.5 * median(seen.collect()) {
            peak if peak > 0.0 && peak.is_finite() => Ok(peak),
            peak => Err(Error::option(
                "--peak",
                format!("half the median of the white photo is {peak}, which is no radiance for a target"),
            )
            .help("give the radiance that 1 in the target stands for")),
        }
    }

    /// The light that the projector must add: the target times `peak`, minus ambient light. It is negative where ambient light is too
    /// bright, and is not clipped.
    pub(super) fn light(&self, peak: f64) -> Result<Planes> {
        let light = difference(&times(peak, &self.target), &self.ambient);
        if norm_of(&light) == 0.0 {
            return Err(Error::Numerical(
                "the target is what is seen without projector: nothing to do".into(),
            ));
        }
        Ok(light)
    }

    /// The target as a pattern. It is dimmed by the ratio of the peak to the median of the white photo (without ambient light).
    pub(super) fn dimmed(&self, white: &[Vec<f64>], peak: f64) -> Planes {
        let bright = median(white.concat());
        let scale = if bright > 0.0 { peak / bright } else { 1.0 };
        if self.has_one_size() {
            return times(scale, &self.target);
        }
        self.target.iter().map(|plane| self.resampled(plane).map(|value| scale * value).collect()).collect()
    }

    /// A picture of the camera's size at the centres of the projector's pixels, by bilinear interpolation.
    fn resampled(&self, plane: &[f64]) -> impl Iterator<Item = f64> {
        let (from, to) = (self.resolution, self.projector);
        let place = |pixel: usize, from: usize, to: usize| {
            let at = ((pixel as f64 + 0.5) * from as f64 / to as f64 - 0.5).clamp(0.0, from as f64 - 1.0);
            (at as usize, (at as usize + 1).min(from - 1), at.fract())
        };
        (0..to.pixels()).map(move |pixel| {
            let (left, right, share) = place(pixel % to.width, from.width, to.width);
            let (top, bottom, down) = place(pixel / to.width, from.height, to.height);
            let row = |y: usize| {
                (1.0 - share) * plane[y * from.width + left] + share * plane[y * from.width + right]
            };
            (1.0 - down) * row(top) + down * row(bottom)
        })
    }

    pub(super) fn radiance(&self, peak: f64) -> Result<Image> {
        self.image(&times(peak, &self.target))
    }

    pub(super) fn photo(&self, light: &[Vec<f64>]) -> Result<Image> {
        self.image(&sum(light, &self.ambient))
    }

    fn image(&self, planes: &[Vec<f64>]) -> Result<Image> {
        Image::from_planes(self.resolution, planes)
    }

    pub(super) fn pattern(&self, planes: &[Vec<f64>]) -> Result<Image> {
        Image::from_planes(self.projector, planes)
    }
}

pub(super) fn norm_of(planes: &[Vec<f64>]) -> f64 {
    match planes {
        [plane] => norm(plane),
        planes => planes.iter().map(|plane| dot(plane, plane)).sum::<f64>().sqrt(),
    }
}

/// `‖b − y‖₂` over all channels.
pub(super) fn residual_norm(b: &[Vec<f64>], y: &[Vec<f64>]) -> f64 {
    norm_of(&difference(b, y))
}

/// The median, or the larger of the two middle values. It is 0 if there are no values.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
