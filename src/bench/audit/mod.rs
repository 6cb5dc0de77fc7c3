//! An audit checks whether a source is the linear, symmetric operator that all other analyses assume.
//!
//! Each check compares photos of random patterns. The result is a figure, its standard error due to the photos' noise, and a bound:
//!
//! | check | compared photos | causes of failure |
//! |---|---|---|
//! | additivity | `A p + A (1 − p)` and `A 1` | black level, ambient light, saturation, a nonlinear camera response |
//! | homogeneity | `A (c p)` and `c A p` | the projector's response (gamma) |
//! | repeatability | the first and the last `A p` | drift |
//! | symmetry | `yᵀ A x` and `xᵀ A y` | misregistration, different centres of projection of camera and projector |
//! | crosstalk | each channel under red, green and blue alone | a camera channel that sees the projector's other colours |
//! | direct light | pixels with light, but without direct light | shadows, which have the same causes as asymmetry |
//!
//! Automatic behaviour of a rig's devices may cause a check to fail. [`crate::bench::rig_check::faults`] reports such behaviour.
//!
//! Source: O'Toole and Kutulakos. Additivity, homogeneity and symmetry are properties of light transport in section 3. Section 8.1 looks
//! for shadows to test the alignment of projector and camera. The other checks, and all bounds, are ours.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

pub(crate) use super::audit::checks::symmetry;
use crate::analysis::Crosstalk;
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade};
use crate::image::Resolution;
use crate::measure::{Measurement, Photo, Plane};
use crate::operator::{Operator, product};

mod checks;

/// The options of an audit.
#[derive(Clone, Debug, PartialEq)]
pub struct AuditOptions {
    /// Number of random patterns. Symmetry is judged from all pairs of patterns.
    pub patterns: usize,
    /// The largest relative deviation from additivity, homogeneity and repeatability that passes.
    pub tolerance: f64,
    /// The largest `‖A − Aᵀ‖/‖A‖` (Frobenius) that passes.
    pub asymmetry: f64,
    /// The largest fraction of pixels in shadow that passes.
    pub share: f64,
    /// Seed of the random patterns.
    pub seed: u64,
}

impl Default for AuditOptions {
    fn default() -> Self {
        Self { patterns: 6, tolerance: 0.01, asymmetry: 0.1, share: 0.01, seed: 0 }
    }
}

impl AuditOptions {
    /// Fails with [`Error::Option`] for fewer than two patterns, and for bounds that no deviation can keep.
    pub fn check(&self) -> Result<()> {
        if self.patterns < 2 {
            let fault = format!("{} make no pair", self.patterns);
            return Err(Error::option("--patterns", fault).help("give 2 or more"));
        }
        for (option, bound) in [("--tolerance", self.tolerance), ("--asymmetry", self.asymmetry)] {
            if bound.is_nan() || bound < 0.0 {
                let fault = format!("no deviation is at most {bound}");
                return Err(Error::option(option, fault).help("give 0 or more"));
            }
        }
        Ok(())
    }
}

/// The result of an audit.
#[derive(Clone, Debug)]
pub struct AuditReport {
    /// The checks, in the order of the report.
    pub checks: Vec<Finding>,
    /// The resolution of all images.
    pub resolution: Resolution,
    /// The white photo. Empty if it could not be taken.
    pub white: Vec<f64>,
    /// The fraction of direct light in each pixel's light under white. Empty if it is not known.
    pub direct_share: Vec<f64>,
    /// Pixels that see light, but no direct light.
    pub shadow: Vec<bool>,
    /// `A p + A (1 − p) − A 1`, relative to the mean of `A 1`.
    pub additivity: Vec<f64>,
    /// Number of patterns photographed.
    pub photos: usize,
    /// Findings about automatic behaviour of a rig's devices, such as an iris. They may explain a failed check, but do not fail the audit.
    pub devices: Vec<Finding>,
}

impl AuditReport {
    /// The faults that were found in the devices.
    pub fn faults(&self) -> impl Iterator<Item = &Finding> {
        self.devices.iter().filter(|finding| finding.grade >= Grade::Warning)
    }

    /// Whether no check fails.
    pub fn passed(&self) -> bool {
        self.checks.iter().all(|check| check.grade != Grade::Fails)
    }

    /// The result as a sentence.
    pub fn sentence(&self) -> String {
        let failed: Vec<&str> = self
            .checks
            .iter()
            .filter(|check| check.grade == Grade::Fails)
            .map(|check| &*check.name)
            .collect();
        let faults: Vec<&str> = self.faults().map(|finding| &*finding.name).collect();
        let faults = match faults.as_slice() {
            [] => String::new(),
            names => format!(" Faults of the devices: {}.", names.join(", ")),
        };
        if failed == [LIGHT] {
            return format!("There is nothing to measure: white gives no light beyond its noise.{faults}");
        }
        if failed.is_empty() {
            return format!("The source is a linear operator, as far as these photos tell.{faults}");
        }
        format!(
            "The source is not the linear operator that it should be: {} failed.{faults}",
            failed.join(", ")
        )
    }
}

/// The name of the finding that says whether there is light to measure.
const LIGHT: &str = "light";

/// Audits `subject`. A camera that is saturated at every exposure causes a failed check, not an error.
///
/// # Errors
/// [`Error::Option`] for fewer than two patterns, and any error of taking photos.
pub fn audit(subject: &mut dyn Audited, options: &AuditOptions) -> Result<AuditReport> {
    options.check()?;
    let resolution = subject.resolution();
    let mut audit = AuditReport {
        checks: Vec::new(),
        resolution,
        white: Vec::new(),
        direct_share: Vec::new(),
        shadow: Vec::new(),
        additivity: Vec::new(),
        photos: 0,
        devices: Vec::new(),
    };
    let white = match subject.photograph(&vec![1.0; subject.patterns().pixels()]) {
        Ok(white) => white,
        Err(Error::Saturated { device, fault, .. }) => {
            audit.checks.push(checks::saturated(&format!("{device}: {fault}")));
            return Ok(audit);
        }
        Err(error) => return Err(error),
    };
    let light = subject.sight()?;
    let is_dark = light.grade == Grade::Fails;
    audit.checks.push(light);
    if is_dark {
        let names = ["additivity", "homogeneity", "repeatability", "symmetry", "direct light"];
        audit
            .checks
            .extend(names.map(|name| Finding::unmeasured(name, "white gives no light beyond its noise")));
        audit.photos = 1;
    } else {
        audit.by_patterns(subject, &white, options)?;
        audit.by_light(subject, &white, options)?;
    }
    audit.white = white.values;
    Ok(audit)
}

impl AuditReport {
    /// The checks that compare photos of random patterns.
    fn by_patterns(
        &mut self,
        subject: &mut dyn Audited,
        white: &Plane,
        options: &AuditOptions,
    ) -> Result<()> {
        let has_one_size = subject.patterns() == subject.resolution();
        let mask = if has_one_size { subject.seen() } else { vec![true; subject.patterns().pixels()] };
        let mut random = Pcg64::seed_from_u64(options.seed);
        let mut pattern = || -> Vec<f64> {
            mask.iter().map(|&seen| f64::from(u8::from(seen && random.random::<bool>()))).collect()
        };
        let patterns: Vec<Vec<f64>> = (0..options.patterns).map(|_| pattern()).collect();
        let photos =
            patterns.iter().map(|pattern| subject.photograph(pattern)).collect::<Result<Vec<_>>>()?;
        let complement: Vec<f64> =
            patterns[0].iter().zip(&mask).map(|(p, &seen)| if seen { 1.0 - p } else { 0.0 }).collect();
        let rest = subject.photograph(&complement)?;
        let mut scaled = Vec::new();
        for share in [0.25, 0.5, 0.75] {
            let pattern: Vec<f64> = patterns[0].iter().map(|p| share * p).collect();
            scaled.push((share, subject.photograph(&pattern)?));
        }
        let again = subject.photograph(&patterns[0])?;
        self.photos = 3 + photos.len() + scaled.len();
        let lit = &photos[0];
        self.checks.extend([
            checks::additivity(lit, &rest, white, options.tolerance),
            checks::homogeneity(lit, &scaled, options.tolerance),
            checks::repeatability(lit, again, options.tolerance),
            match has_one_size {
                true => symmetry(&patterns, &photos, white, &mask, options.asymmetry),
                false => Finding::unmeasured("symmetry", "photos and patterns have different sizes"),
            },
        ]);
        let mean = (white.values.iter().sum::<f64>() / white.values.len() as f64).max(f64::MIN_POSITIVE);
        self.additivity = (0..white.values.len())
            .map(|pixel| (lit.values[pixel] + rest.values[pixel] - white.values[pixel]) / mean)
            .collect();
        Ok(())
    }

    /// The checks of direct and ambient light, colours, saturation, noise and drift.
    fn by_light(&mut self, subject: &mut dyn Audited, white: &Plane, options: &AuditOptions) -> Result<()> {
        if let Some(direct) = subject.direct()? {
            let (check, shadow) = checks::shadows(&direct, white, &subject.seen(), options.share);
            self.checks.push(check);
            self.shadow = shadow;
            let light = direct.values.iter().zip(&white.values);
            self.direct_share =
                light.map(|(direct, white)| if *white > 0.0 { direct / white } else { 0.0 }).collect();
        }
        self.checks.extend(subject.ambient()?.map(|ambient| checks::ambient(&ambient, white)));
        if let Some(photos) = subject.primaries()? {
            self.photos += photos.len();
            self.checks.push(checks::crosstalk(&Crosstalk::measured(&photos)?));
        }
        self.checks.extend(subject.saturated()?.map(checks::saturation));
        self.checks.push(checks::noise_floor(white));
        self.checks.extend(subject.drift()?.map(checks::drift));
        Ok(())
    }
}

/// A source that can be audited. It has one channel.
pub trait Audited {
    /// The resolution of photos.
    fn resolution(&self) -> Resolution;

    /// The resolution of patterns; by default that of photos.
    fn patterns(&self) -> Resolution {
        self.resolution()
    }

    /// The photo of a pattern of values in \[0, 1\].
    fn photograph(&mut self, pattern: &[f64]) -> Result<Plane>;

    /// A finding named `light` that says whether white gives enough light for the audit. It is called after the white photo was taken.
    fn sight(&mut self) -> Result<Finding>;

    /// Marks the pixels that the camera sees. No other pixel is ever lit.
    fn seen(&self) -> Vec<bool>;

    /// The direct light under white, if it is known.
    fn direct(&mut self) -> Result<Option<Plane>>;

    /// The light without a pattern, if it is known.
    fn ambient(&mut self) -> Result<Option<Plane>> {
        Ok(None)
    }

    /// The fraction of the camera's samples of white that are saturated at some exposure. `None` without a camera.
    fn saturated(&mut self) -> Result<Option<f64>> {
        Ok(None)
    }

    /// Photos of the projector's red, green and blue, each shown alone, in each camera channel. `None` if either device is monochrome.
    fn primaries(&mut self) -> Result<Option<[[Vec<f64>; 3]; 3]>> {
        Ok(None)
    }

    /// The largest relative change of the lamp's light that was measured and corrected. `None` if the lamp was not monitored.
    fn drift(&mut self) -> Result<Option<f64>> {
        Ok(None)
    }
}

/// Operators without noise, for example of a simulated scene.
pub struct Exact<'a> {
    /// The operator of all light.
    pub full: &'a mut dyn Operator,
    /// Direct light under white, if it is known.
    pub direct: Option<Vec<f64>>,
    /// The resolution of photos.
    pub resolution: Resolution,
    /// The resolution of patterns.
    pub patterns: Resolution,
}

impl Audited for Exact<'_> {
    fn resolution(&self) -> Resolution {
        self.resolution
    }

    fn patterns(&self) -> Resolution {
        self.patterns
    }

    fn photograph(&mut self, pattern: &[f64]) -> Result<Plane> {
        product(self.full, pattern).map(exact)
    }

    fn sight(&mut self) -> Result<Finding> {
        let pattern = vec![1.0; self.full.cols()];
        let white = product(self.full, &pattern)?;
        let lit = white.iter().filter(|light| **light > 0.0).count();
        let grade = if lit == 0 { Grade::Fails } else { Grade::Ok };
        let found = format!("{lit} of {} pixels have light under white", white.len());
        let help = "light the scene, or turn the camera to it";
        Ok(Finding::graded("light", grade, found, "one or more", help))
    }

    fn seen(&self) -> Vec<bool> {
        vec![true; self.resolution.pixels()]
    }

    fn direct(&mut self) -> Result<Option<Plane>> {
        Ok(self.direct.clone().map(exact))
    }
}

fn exact(values: Vec<f64>) -> Plane {
    Plane { variance: vec![0.0; values.len()], values }
}

impl Audited for Measurement {
    fn resolution(&self) -> Resolution {
        Self::resolution(self)
    }

    fn photograph(&mut self, pattern: &[f64]) -> Result<Plane> {
        let samples = pattern.iter().map(|&value| value as f32).collect();
        let image = crate::image::Image::new(Self::resolution(self), 1, samples)?;
        first(Self::photograph(self, &image)?)
    }

    fn sight(&mut self) -> Result<Finding> {
        Self::sight(self)
    }

    fn seen(&self) -> Vec<bool> {
        Self::seen(self).to_vec()
    }

    fn direct(&mut self) -> Result<Option<Plane>> {
        match self.options().direct {
            crate::measure::DirectBy::None => Ok(None),
            crate::measure::DirectBy::Patterns => Ok(Some(first(Self::direct(self)?)?)),
        }
    }

    fn ambient(&mut self) -> Result<Option<Plane>> {
        if !self.options().ambient {
            return Ok(None);
        }
        Ok(Some(first(Self::ambient(self)?)?))
    }

    fn saturated(&mut self) -> Result<Option<f64>> {
        Self::saturated(self).map(Some)
    }

    fn primaries(&mut self) -> Result<Option<[[Vec<f64>; 3]; 3]>> {
        Self::primaries(self)
    }

    fn drift(&mut self) -> Result<Option<f64>> {
        let report = Self::drift(self)?;
        Ok((report.sentinels.len() > 1).then_some(report.largest))
    }
}

fn first(photo: Photo) -> Result<Plane> {
    photo.planes.into_iter().next().ok_or_else(|| Error::Numerical("a photo without channels".into()))
}
