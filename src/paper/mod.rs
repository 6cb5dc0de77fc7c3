//! Reproduction of the paper's figures. For each figure: the scene, the number of photos, measured numbers, and the paper's statement.
//!
//! The paper is O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*. Resolutions and numbers of photos are the
//! paper's for figures 4 and 6 (section 8.2), and numbers of photos also for figures 8 (section 8.2; the caption has twice as many), 11
//! and 12 (section 8.3). Our 50 photos of a segmentation include the white one, and figure 12 goes on from 8 to 12. All others, the scenes ([`crate::scene::builtin`]) and the bounds are our own. Each figure is a function of a
//! [`Bench`], which provides the photos. It returns a [`Reproduced`]: pictures, curves, and numbers with their bounds. Beside a bound stands
//! the score of a wrong answer ([`Check::wrong`]), which must miss it.
//!
//! | figure | shows | here |
//! |---|---|---|
//! | 2 | the principal eigenvector by power iteration | `fig2` |
//! | 4 | segmentation into two, six and ten groups | `fig4_5` |
//! | 5 | pixels as points in the space of eigenvectors | `fig4_5` |
//! | 6 | two regions of which one hides parts of the other | `fig6_8_9` |
//! | 8 | an egg carton, empty and with eggs | `fig6_8_9` |
//! | 9, 10 | the first patterns and photos of a run | `fig6_8_9`, `fig10_11_12` |
//! | 11 | compensation of a fold at a right angle with five photos | `fig10_11_12` |
//! | 12 | compensation of a back wall that is out of focus | `fig10_11_12` |
//! | 13 | bit planes of a binary projector | `fig13` |
//! | section 6.1 | random patterns after equal numbers of photos | `random` |
//! | section 7.1 | photos without orthogonalisation | `conditioning` |
//! | section 4 | the polynomials behind the methods | `polynomials` |
//! | sections 3, 4, 9 | camera and projector apart, and exchanged to photograph the transpose | `apart` |
//! | section 8.1 | the effect of disparity on methods for symmetric matrices | `disparity` |
//! | appendix B | power iteration where the largest eigenvalue is not distinct | `mixture` |
//!
//! [`Gallery`] writes the page that shows the figures beside the paper's statements.

mod apart;
mod bench;
mod check;
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
mod mixture;
mod polynomials;
mod random;
mod vectors;

use crate::error::Result;
use crate::lab::SharedObserver;

pub use bench::{Bench, BenchOptions};
pub use check::{Check, Limit};
pub use figure::{Content, Figure, Panel, Plot, Reproduced, Rig, Strip};
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
        Figure::Mixture => mixture::reproduce(bench),
    }?;
    let (direct, frames) = bench.costs();
    made.photos += direct;
    made.frames += frames;
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
