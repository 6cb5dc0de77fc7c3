//! Audit: is a source the linear, symmetric operator that every other answer takes it for?
//!
//! From a few photos of random patterns, each check gives a figure with its standard error, which the photos' predicted noise
//! says, and a bound:
//!
//! | check | what is compared | what breaks it |
//! |---|---|---|
//! | additivity | `A p + A (1 − p)` and `A 1` | black level, ambient light, saturation, a bent camera response |
//! | homogeneity | `A (c p)` and `c A p` | the projector's response (gamma) |
//! | repeatability | `A p`, first and last | drift |
//! | symmetry | `yᵀ A x` and `xᵀ A y` | misregistration, a camera that looks from elsewhere |
//! | crosstalk | red, green and blue alone, in each channel | a camera channel that sees the projector's other colours |
//! | direct light | pixels that see light, but none of their own | the same: shadows |
//!
//! O'Toole and Kutulakos, section 8.

mod check;
mod checks;
mod subject;

pub use check::{Check, Verdict};
pub(in crate::analysis) use checks::symmetry;
pub use subject::{Audited, Exact, Seen};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::analysis::Crosstalk;
use crate::error::{Error, Result};
use crate::image::Resolution;

/// How an audit is made.
#[derive(Clone, Debug, PartialEq)]
pub struct AuditOptions {
    /// Random patterns; symmetry is judged by all pairs of them.
    pub patterns: usize,
    /// Relative deviation from additivity, homogeneity and repeatability that passes.
    pub tolerance: f64,
    /// `‖A − Aᵀ‖/‖A‖` (Frobenius) that passes.
    pub asymmetry: f64,
    /// Share of pixels in shadow, or saturated, that passes.
    pub share: f64,
    /// Selects the patterns.
    pub seed: u64,
}

impl Default for AuditOptions {
    fn default() -> Self {
        Self { patterns: 6, tolerance: 0.01, asymmetry: 0.1, share: 0.01, seed: 0 }
    }
}

/// What an audit found.
#[derive(Clone, Debug)]
pub struct Audit {
    /// Line by line.
    pub checks: Vec<Check>,
    /// Pixels of the pictures.
    pub resolution: Resolution,
    /// The white photo; empty where it could not be taken.
    pub white: Vec<f64>,
    /// Share of each pixel's white light that is its own, direct light; empty where it is not known.
    pub direct_share: Vec<f64>,
    /// Pixels that see light, but none of their own.
    pub shadow: Vec<bool>,
    /// `A p + A (1 − p) − A 1`, relative to the mean of `A 1`.
    pub additivity: Vec<f64>,
    /// Patterns photographed.
    pub photos: usize,
}

impl Audit {
    /// Whether every check passes.
    pub fn passed(&self) -> bool {
        self.checks.iter().all(|check| check.verdict != Verdict::Fails)
    }

    /// The verdict as a sentence.
    pub fn sentence(&self) -> String {
        let failed: Vec<&str> = self
            .checks
            .iter()
            .filter(|check| check.verdict == Verdict::Fails)
            .map(|check| check.name)
            .collect();
        if failed.is_empty() {
            return "The source is a linear operator, as far as these photos tell.".into();
        }
        format!("The source is not the linear operator that it should be: {} failed.", failed.join(", "))
    }
}

/// Audits `subject`. A camera that is saturated where nothing can be done is a failed check, not an error.
///
/// # Errors
/// [`Error::Option`] for fewer than two patterns; whatever keeps photos from being taken.
pub fn audit(subject: &mut dyn Audited, options: &AuditOptions) -> Result<Audit> {
    if options.patterns < 2 {
        return Err(Error::Option {
            option: "--patterns".into(),
            fault: format!("{} make no pair", options.patterns),
            help: "give 2 or more".into(),
        });
    }
    let resolution = subject.resolution();
    let mut audit = Audit {
        checks: Vec::new(),
        resolution,
        white: Vec::new(),
        direct_share: Vec::new(),
        shadow: Vec::new(),
        additivity: Vec::new(),
        photos: 0,
    };
    let white = match subject.photograph(&vec![1.0; resolution.pixels()]) {
        Ok(white) => white,
        Err(Error::Saturated { device, fault, .. }) => {
            audit.checks.push(checks::saturated(&format!("{device}: {fault}")));
            return Ok(audit);
        }
        Err(error) => return Err(error),
    };
    let mask = subject.seen();
    let mut random = Pcg64::seed_from_u64(options.seed);
    let mut patterns: Vec<Vec<f64>> = Vec::new();
    for _ in 0..options.patterns {
        patterns
            .push(mask.iter().map(|&seen| f64::from(u8::from(seen && random.random::<bool>()))).collect());
    }
    let photos = patterns.iter().map(|pattern| subject.photograph(pattern)).collect::<Result<Vec<_>>>()?;
    let complement: Vec<f64> =
        patterns[0].iter().zip(&mask).map(|(p, &seen)| if seen { 1.0 - p } else { 0.0 }).collect();
    let rest = subject.photograph(&complement)?;
    let mut scaled = Vec::new();
    for share in [0.25, 0.5, 0.75] {
        let pattern: Vec<f64> = patterns[0].iter().map(|p| share * p).collect();
        scaled.push((share, subject.photograph(&pattern)?));
    }
    let again = subject.photograph(&patterns[0])?;
    audit.photos = 3 + photos.len() + scaled.len();
    audit.checks.push(checks::additivity(&photos[0], &rest, &white, options.tolerance));
    audit.checks.push(checks::homogeneity(&photos[0], &scaled, options.tolerance));
    audit.checks.push(checks::repeatability(&photos[0], &again, options.tolerance));
    audit.checks.push(symmetry(&patterns, &photos, &white, &mask, options.asymmetry));
    let mean = (white.values.iter().sum::<f64>() / white.values.len() as f64).max(f64::MIN_POSITIVE);
    audit.additivity = (0..white.values.len())
        .map(|pixel| (photos[0].values[pixel] + rest.values[pixel] - white.values[pixel]) / mean)
        .collect();
    if let Some(direct) = subject.direct()? {
        let (check, shadow) = checks::shadows(&direct, &white, &mask, options.share);
        audit.checks.push(check);
        audit.shadow = shadow;
        audit.direct_share = direct
            .values
            .iter()
            .zip(&white.values)
            .map(|(direct, white)| if *white > 0.0 { direct / white } else { 0.0 })
            .collect();
    }
    if let Some(ambient) = subject.ambient()? {
        audit.checks.push(checks::ambient(&ambient, &white));
    }
    if let Some(photos) = subject.primaries()? {
        audit.photos += photos.len();
        audit.checks.push(checks::crosstalk(&Crosstalk::measured(&photos)?));
    }
    if let Some(share) = subject.saturated()? {
        audit.checks.push(checks::saturation(share));
    }
    audit.checks.push(checks::noise_floor(&white));
    if let Some(drift) = subject.drift()? {
        audit.checks.push(checks::drift(drift));
    }
    audit.white = white.values;
    Ok(audit)
}
