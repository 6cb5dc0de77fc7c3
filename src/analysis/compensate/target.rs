//! The target of a compensation: the desired photo of the scene.

use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::krylov::{dot, norm};
use crate::operator::Adjoint;

/// A target in [0, 1] and the light without projector. Each has one plane per channel.
#[derive(Clone, Debug)]
pub struct Target {
    resolution: Resolution,
    target: Vec<Vec<f64>>,
    ambient: Vec<Vec<f64>>,
}

impl Target {
    /// A target under `ambient` light in W/(m² sr). The ambient light has one channel per system; a gray target applies to all channels.
    /// Fails with [`Error::Dimension`] if the two differ in size, or the target is coloured and the ambient light gray.
    pub fn new(target: &Image, ambient: &Image) -> Result<Self> {
        let resolution = ambient.resolution();
        if target.resolution() != resolution {
            return Err(Error::dimension("pixels of the target", resolution, target.resolution()));
        }
        let count = ambient.channels();
        if target.channels() > count {
            return Err(Error::dimension("channels of the target", count, target.channels()));
        }
        Ok(Self {
            resolution,
            target: (0..count).map(|channel| target.plane(channel.min(target.channels() - 1))).collect(),
            ambient: (0..count).map(|channel| ambient.plane(channel)).collect(),
        })
    }

    /// The same target with values mapped from [0, 1] to [`lift`, 1]: `t ← α + (1 − α) t`.
    pub(super) fn lifted(&self, lift: f64) -> Self {
        let plane = |plane: &Vec<f64>| plane.iter().map(|value| lift + (1.0 - lift) * value).collect();
        Self { target: self.target.iter().map(plane).collect(), ..self.clone() }
    }

    /// The resolution of patterns and photos.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    pub(super) fn pixels(&self) -> usize {
        self.resolution.pixels()
    }

    pub(super) fn fits<O: Adjoint>(&self, channels: &[O]) -> Result<()> {
        let mismatch = |what, expected: usize, found: usize| Err(Error::dimension(what, expected, found));
        if channels.len() != self.target.len() {
            return mismatch("operators of a compensation", self.target.len(), channels.len());
        }
        let n = self.pixels();
        match channels.iter().flat_map(|operator| [operator.rows(), operator.cols()]).find(|&side| side != n)
        {
            Some(side) => mismatch("rows and columns of a compensation's operator", n, side),
            None => Ok(()),
        }
    }

    /// The default peak, half the median of the white photo with ambient light: an even scene could then be twice as bright.
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

    /// The target light from the projector: the target times `peak`, minus ambient light. It is negative where ambient light
    /// is too bright; nothing is clipped.
    pub(super) fn light(&self, peak: f64) -> Result<Vec<Vec<f64>>> {
        let light: Vec<Vec<f64>> = self
            .target
            .iter()
            .zip(&self.ambient)
            .map(|(target, ambient)| target.iter().zip(ambient).map(|(t, a)| t * peak - a).collect())
            .collect();
        if norm_of(&light) == 0.0 {
            return Err(Error::Numerical(
                "the target is what is seen without projector: nothing to do".into(),
            ));
        }
        Ok(light)
    }

    /// The target as a pattern, dimmed by the peak over the median of the white photo (without ambient light).
    pub(super) fn dimmed(&self, white: &[Vec<f64>], peak: f64) -> Result<Vec<Vec<f64>>> {
        let bright = median(white.concat());
        let factor = if bright > 0.0 { peak / bright } else { 1.0 };
        Ok(self.target.iter().map(|plane| plane.iter().map(|value| factor * value).collect()).collect())
    }

    pub(super) fn radiance(&self, peak: f64) -> Result<Image> {
        let planes: Vec<Vec<f64>> =
            self.target.iter().map(|plane| plane.iter().map(|value| peak * value).collect()).collect();
        self.image(&planes)
    }

    pub(super) fn photo(&self, light: &[Vec<f64>]) -> Result<Image> {
        let planes: Vec<Vec<f64>> = light
            .iter()
            .zip(&self.ambient)
            .map(|(light, ambient)| light.iter().zip(ambient).map(|(l, a)| l + a).collect())
            .collect();
        self.image(&planes)
    }

    pub(super) fn image(&self, planes: &[Vec<f64>]) -> Result<Image> {
        let samples =
            (0..self.pixels()).flat_map(|pixel| planes.iter().map(move |plane| plane[pixel] as f32));
        Image::new(self.resolution, planes.len(), samples.collect())
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
    let difference =
        |(b, y): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> { b.iter().zip(y).map(|(b, y)| b - y).collect() };
    norm_of(&b.iter().zip(y).map(difference).collect::<Vec<_>>())
}

/// The median (the upper of two middle values); 0 without values.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
