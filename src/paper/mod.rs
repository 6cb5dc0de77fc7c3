//! Reproduction of the paper's figures. For each figure: the scene, the number of photos, measured numbers, and the paper's statement.
//!
//! The paper is O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*. Resolutions and numbers of photos are
//! the paper's; the scenes are our own ([`crate::scene::builtin`]). Each figure is a function of a [`Bench`], which provides the photos. It
//! returns a [`Reproduced`]: pictures, curves, and numbers with their bounds.
//!
//! | figure | shows | here |
//! |---|---|---|
//! | 2 | the principal eigenvector by power iteration | `fig2` |
//! | 4 | segmentation into two, six and ten groups | `fig4_5` |
//! | 5 | pixels as points in the space of eigenvectors | `fig4_5` |
//! | 6 | patches that are apart in the photo but exchange light share a group | `fig6_8_9` |
//! | 8 | an egg carton, empty and with eggs | `fig6_8_9` |
//! | 9, 10 | the photos of a run in order | `fig6_8_9`, `fig10_11_12` |
//! | 11 | compensation in focus with five photos | `fig10_11_12` |
//! | 12 | compensation with a defocused projector, twelve photos | `fig10_11_12` |
//! | 13 | bit planes of a one-bit projector | `fig13` |
//! | – | random patterns after equal numbers of photos | `random` |
//! | – | photos without orthogonalisation | `conditioning` |
//! | – | the polynomials of equations 1 to 3 | `polynomials` |
//! | – | camera and projector apart, and exchanged to photograph the transpose | `apart` |
//! | – | the effect of disparity on methods for symmetric matrices | `disparity` |
//!
//! [`Gallery`] writes the page that shows the figures beside the paper's statements.

mod apart;
mod bench;
mod conditioning;
mod contest;

mod disparity;
mod fig10_11_12;
mod fig13;
mod fig2;
mod fig4_5;
mod fig6_8_9;
mod figure;
mod gallery;
mod groups;
mod polynomials;
mod random;
mod vectors;

use crate::error::Result;
use crate::lab::SharedObserver;

pub use bench::{Bench, BenchOptions};
pub use figure::{Check, Content, Figure, Limit, Panel, Plot, Reproduced, Rig, Strip};
pub use gallery::Gallery;

/// Reproduces `figure` on `bench`. Fails if a trace, a photo or a method fails; [`crate::Error::Interrupted`] when the observer stops it.
pub fn reproduce(figure: Figure, bench: &mut Bench) -> Result<Reproduced> {
    let start = std::time::Instant::now();
    let mut made = match figure {
        Figure::Fig2 => fig2::reproduce(bench),
        Figure::Fig4 => fig4_5::fig4(bench),
        Figure::Fig5 => fig4_5::fig5(bench),
        Figure::Fig6 => fig6_8_9::fig6(bench),
        Figure::Fig8 => fig6_8_9::fig8(bench),
        Figure::Fig9 => fig6_8_9::fig9(bench),
        Figure::Fig10 => fig10_11_12::fig10(bench),
        Figure::Fig11 => fig10_11_12::fig11(bench),
        Figure::Fig12 => fig10_11_12::fig12(bench),
        Figure::Fig13 => fig13::reproduce(bench),
        Figure::Random => random::reproduce(bench),
        Figure::Conditioning => conditioning::reproduce(bench),
        Figure::Polynomials => polynomials::reproduce(bench),
        Figure::Apart => apart::reproduce(bench),
        Figure::Disparity => disparity::reproduce(bench),
    }?;
    made.frames += bench.frames();
    made.seconds = start.elapsed().as_secs_f64();
    Ok(made)
}

/// Reproduces `figures` one after the other on one bench. Calls `made` with each complete figure. Fails as [`reproduce`] and `made`.
pub fn reproduce_all(
    figures: &[Figure],
    benches: impl IntoIterator<Item = BenchOptions>,
    observer: &SharedObserver,
    made: &mut dyn FnMut(&Reproduced) -> Result<()>,
) -> Result<Vec<Reproduced>> {
    let mut all = Vec::new();
    for options in benches {
        let mut bench = Bench::new(options, std::sync::Arc::clone(&observer.0));
        for &figure in figures {
            let one = reproduce(figure, &mut bench)?;
            made(&one)?;
            all.push(one);
        }
    }
    Ok(all)
}
