//! Separation by any of the methods, selected by a value.

use super::high_frequency::{check_checkerboards, check_sinusoids};
use super::{Separation, checkerboards, codes, from_capture, hadamard, random_patterns, sinusoids};
use crate::analysis::low_rank::{LowRankCapture, capture};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::krylov::Start;
use crate::operator::{Operator, Symmetry};

/// A method, with its photos, to separate direct from global light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SeparateBy {
    /// [`checkerboards`] with squares of `square` pixels at `shifts²` places.
    Checkerboards {
        /// Side of a square in pixels.
        square: usize,
        /// Number of places in each direction.
        shifts: usize,
    },
    /// [`sinusoids`] along rows and along columns.
    Sinusoids {
        /// Period in pixels.
        period: f64,
        /// Photos in each direction.
        phases: usize,
    },
    /// [`codes`].
    Codes {
        /// Photos: a power of two.
        photos: usize,
    },
    /// [`random_patterns`].
    Random {
        /// Photos besides the white one.
        photos: usize,
    },
    /// [`from_capture`], of a capture that starts from random signs.
    Capture {
        /// Photos besides the white one.
        photos: usize,
    },
}

impl SeparateBy {
    /// The method's name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Checkerboards { .. } => "checkerboards",
            Self::Sinusoids { .. } => "sinusoids",
            Self::Codes { .. } => "codes",
            Self::Random { .. } => "random",
            Self::Capture { .. } => "capture",
        }
    }

    /// The method with its settings in words.
    pub fn in_words(self) -> String {
        match self {
            Self::Checkerboards { square, shifts } => {
                format!("checkerboards of {square} px at {shifts}×{shifts} places")
            }
            Self::Sinusoids { period, phases } => {
                format!("sinusoids of {period} px at 2×{phases} phases")
            }
            Self::Codes { photos } => format!("{photos} patterns of codes"),
            Self::Random { photos } => format!("{photos} random patterns"),
            Self::Capture { photos } => format!("a capture of {photos} photos"),
        }
    }

    /// The number of photos, the white one included.
    pub fn photos(self) -> usize {
        match self {
            Self::Checkerboards { shifts, .. } => shifts * shifts,
            Self::Sinusoids { phases, .. } => 2 * phases,
            Self::Codes { photos } => photos,
            Self::Random { photos } | Self::Capture { photos } => photos + 1,
        }
    }
}

impl SeparateBy {
    /// Refuses settings that the method cannot use, before any photo is taken.
    ///
    /// # Errors
    /// [`Error::Option`] naming the option.
    pub fn check(self) -> Result<()> {
        match self {
            Self::Checkerboards { square, shifts } => check_checkerboards(square, shifts),
            Self::Sinusoids { period, phases } => check_sinusoids(period, phases),
            Self::Codes { photos } => hadamard::check(photos),
            Self::Random { .. } | Self::Capture { .. } => Ok(()),
        }
    }
}

/// Separates with `operator`, all of the light of a coaxial rig (`n × n`).
///
/// # Errors
/// [`Error::Option`] naming `--by` if the operator is not symmetric (another pixel then lights what a pixel sees); as the method.
pub fn separate(
    operator: &mut dyn Operator,
    resolution: Resolution,
    by: SeparateBy,
    seed: u64,
) -> Result<Separation> {
    if operator.symmetry() != Symmetry::Symmetric {
        return Err(Error::Option {
            option: "--by".into(),
            fault: format!(
                "{} needs a coaxial rig, where the light that a pixel sees directly comes from that very pixel of the projector",
                by.name()
            ),
            help: "use --by exact on a scene, or put the projector where the camera is".into(),
        });
    }
    match by {
        SeparateBy::Checkerboards { square, shifts } => checkerboards(operator, resolution, square, shifts),
        SeparateBy::Sinusoids { period, phases } => sinusoids(operator, resolution, period, phases),
        SeparateBy::Codes { photos } => codes(operator, resolution, photos),
        SeparateBy::Random { photos } => random_patterns(operator, photos, seed),
        SeparateBy::Capture { photos } => {
            let options = LowRankCapture {
                photos,
                start: Some(Start::Rademacher { seed }),
                ..LowRankCapture::default()
            };
            let model = capture(operator, &[], &options)?;
            let mut white = vec![0.0; resolution.pixels()];
            operator.apply(&vec![1.0; resolution.pixels()], &mut white)?;
            from_capture(&model, &white)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_that_a_method_cannot_use_are_refused_by_name() {
        for (by, name) in [
            (SeparateBy::Checkerboards { square: 0, shifts: 4 }, "--square"),
            (SeparateBy::Sinusoids { period: 1.0, phases: 3 }, "--period"),
            (SeparateBy::Sinusoids { period: 4.0, phases: 2 }, "--phases"),
            (SeparateBy::Codes { photos: 12 }, "--photos"),
        ] {
            assert!(matches!(by.check(), Err(Error::Option { option, .. }) if option == name), "{name}");
        }
        assert!(SeparateBy::Codes { photos: 16 }.check().is_ok());
        assert!(SeparateBy::Checkerboards { square: 2, shifts: 4 }.check().is_ok());
    }
}
