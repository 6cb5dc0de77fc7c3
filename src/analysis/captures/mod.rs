//! Light transport from captured pairs of patterns and photos, whatever the patterns are.
//!
//! A few dozen photos do not determine the rows of `A`, so a prior fills the gap. Row `j` of `A` is a Gaussian vector with three parts:
//!
//! | part | covariance | meaning |
//! |---|---|---|
//! | global | a smooth kernel over the projector's pixels | light after two or more bounces varies slowly with the pattern's pixel |
//! | direct | one window of pixels at the home of camera pixel `j` | light of one bounce comes from the projector pixels that `j` sees |
//! | noise | independent in every photo | read noise and shot noise |
//!
//! The rows are then found by regularized least squares (Gaussian process regression), and every product with a pattern comes with its
//! standard error. [`choose`](choose::choose) finds the scales of the three parts by photos that are left out. The result is a low-rank model with direct
//! light apart ([`LowRank`]). For the regression, see Rasmussen and Williams, *Gaussian Processes for Machine Learning* (2006), chapter 2;
//! for the left-out photos, section 5.4.2.

mod basis;
mod choose;
mod homes;
mod known;
mod light;
mod posterior;
mod prior;

use rayon::prelude::*;

use super::LowRank;
use crate::error::{Error, Result};
use crate::image::Resolution;

pub use choose::{LeftOut, choose};
pub use homes::{FoundHomes, coaxial_homes, find_homes};
pub use known::captured_checkerboards;
pub use light::{CapturedLight, fit_captures};
pub use posterior::{Posterior, PosteriorState};
pub use prior::Prior;

/// For each camera pixel, the column and row of the projector pixel that lights it directly, in pixels from the centre of the first.
pub type Places = Vec<Option<[f64; 2]>>;

/// Patterns and photos of one channel. `N` photos of `m` pixels belong to `N` patterns of `n` pixels.
#[derive(Clone, Debug)]
pub struct Pairs {
    /// The patterns (`N × n`), linear.
    pub patterns: Vec<Vec<f64>>,
    /// The photos (`N × m`), linear, without ambient light. A value is NaN where the camera was saturated.
    pub photos: Vec<Vec<f64>>,
    /// The resolution of patterns.
    pub projector: Resolution,
    /// The home of each camera pixel (`m`), or nothing if no map is known.
    pub homes: Places,
    /// The standard deviation of each pixel of one photo (`m`), if repeated photos told it.
    pub noise: Option<Vec<f64>>,
}

impl Pairs {
    /// Checks the sizes. Fails with [`Error::Dimension`], or with [`Error::Numerical`] without light.
    pub fn check(&self) -> Result<()> {
        let (n, m) = (self.projector.pixels(), self.pixels());
        Error::check_size("photos of the patterns", self.patterns.len(), self.photos.len())?;
        self.patterns.iter().try_for_each(|x| Error::check_size("pixels of a pattern", n, x.len()))?;
        self.photos.iter().try_for_each(|y| Error::check_size("pixels of a photo", m, y.len()))?;
        if !self.homes.is_empty() {
            Error::check_size("places in the map", m, self.homes.len())?;
        }
        if self.patterns.iter().flatten().all(|value| *value == 0.0) {
            return Err(Error::Numerical("all patterns are dark".into()));
        }
        Ok(())
    }

    /// The number of camera pixels, `m`.
    pub fn pixels(&self) -> usize {
        self.photos.first().map_or(0, Vec::len)
    }

    /// The pairs at these places in the list.
    #[must_use]
    pub fn only(&self, kept: &[usize]) -> Self {
        let of = |all: &[Vec<f64>]| kept.iter().map(|&k| all[k].clone()).collect();
        Self { patterns: of(&self.patterns), photos: of(&self.photos), ..self.clone() }
    }

    /// The average entry of each row of `A` (`m`): the light of all photos over the light of all patterns. Dark rows have a small positive
    /// value.
    fn levels(&self) -> Vec<f64> {
        let sent: Vec<f64> = self.patterns.iter().map(|x| x.iter().sum()).collect();
        let level = |j: usize| {
            let seen = self.photos.iter().zip(&sent).filter(|(photo, _)| !photo[j].is_nan());
            let [light, sent] = seen.fold([0.0; 2], |[a, b], (photo, sent)| [a + photo[j], b + sent]);
            if sent > 0.0 { light / sent } else { 0.0 }
        };
        let levels: Vec<f64> = (0..self.pixels()).into_par_iter().map(level).collect();
        let mean = levels.iter().map(|level| level.max(0.0)).sum::<f64>() / levels.len().max(1) as f64;
        levels.into_iter().map(|level| level.max(DARK * mean).max(f64::MIN_POSITIVE)).collect()
    }
}

/// The level of a dark pixel, relative to the average pixel.
const DARK: f64 = 0.02;

/// The transport of one channel, fitted to captured pairs.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The model (`m × n`), with the errors of its products.
    pub model: LowRank,
    /// The prediction of photos that were left out.
    pub left_out: LeftOut,
}

/// Fits the transport of one channel. Fails as [`Pairs::check`], and with [`Error::Numerical`] for fewer than 3 photos.
pub fn fit(pairs: &Pairs) -> Result<Fitted> {
    pairs.check()?;
    let (prior, left_out) = choose(pairs)?;
    let model = Posterior::new(pairs, prior)?.model(pairs)?;
    Ok(Fitted { model, left_out })
}

#[cfg(test)]
mod tests;
