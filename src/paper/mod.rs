//! The paper's figures, made again: which scene, how many photos, what is measured, and what the paper says of it.
//!
//! O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*, at its resolutions and numbers of
//! photos, on scenes of our own ([`crate::scene::builtin`]). Each figure is a file here and a function of a [`Bench`], which
//! gives the photos; it returns a [`Reproduced`]: pictures, curves, and numbers with the bounds they are held to.
//!
//! | figure | shows | here |
//! |---|---|---|
//! | 2 | the principal eigenvector by power iteration | `fig2` |
//! | 4 | segmentation into two, six and ten groups | `fig4` |
//! | 5 | pixels by their entries in the eigenvectors | `fig5` |
//! | 6 | patches apart in the photo that exchange light share a group | `fig6` |
//! | 8 | an egg carton, empty and with eggs | `fig8` |
//! | 9, 10 | the photos of a run, in order | `fig9`, `fig10` |
//! | 11 | compensation in focus, at five photos | `fig11` |
//! | 12 | compensation of a projector out of focus, at twelve | `fig12` |
//! | 13 | bit planes of a projector of one bit | `fig13` |

mod bench;
mod check;
mod compensated;
mod components;
mod contest;
mod dense;
mod devices;
mod fig10;
mod fig11;
mod fig12;
mod fig13;
mod fig2;
mod fig4;
mod fig5;
mod fig6;
mod fig8;
mod fig9;
mod figure;
mod groups;
mod purity;
mod stage;
mod target;

pub use bench::{Bench, BenchOptions, Rig};
pub use check::{Check, Limit};
pub use figure::{Content, Curve, Curves, Figure, Panel, Reproduced, Shot, Strip};

use crate::error::Result;

/// Makes `figure` again on `bench`.
///
/// # Errors
/// What tracing, photos and methods fail with; [`crate::Error::Interrupted`] when the bench's watch says so.
pub fn reproduce(figure: Figure, bench: &mut Bench) -> Result<Reproduced> {
    let start = std::time::Instant::now();
    let mut made = match figure {
        Figure::Fig2 => fig2::reproduce(bench),
        Figure::Fig4 => fig4::reproduce(bench),
        Figure::Fig5 => fig5::reproduce(bench),
        Figure::Fig6 => fig6::reproduce(bench),
        Figure::Fig8 => fig8::reproduce(bench),
        Figure::Fig9 => fig9::reproduce(bench),
        Figure::Fig10 => fig10::reproduce(bench),
        Figure::Fig11 => fig11::reproduce(bench),
        Figure::Fig12 => fig12::reproduce(bench),
        Figure::Fig13 => fig13::reproduce(bench),
    }?;
    made.seconds = start.elapsed().as_secs_f64();
    Ok(made)
}
