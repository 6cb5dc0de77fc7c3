//! The photos of a low-rank model: a Krylov process whose photos are kept.

use super::LowRank;
use crate::analysis::probe::smooth_patterns;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::krylov::{Arnoldi, BlockLanczos, Factorization, Start, dot, norm};
use crate::observer::{Estimate, Step};
use crate::operator::{Operator, Product, Recorded, Symmetry};

/// How a low-rank model is captured.
#[derive(Clone, Debug)]
pub struct LowRankCapture {
    /// Photos of the process, and so the rank `k` of `W Qᵀ`; at least 1.
    pub photos: usize,
    /// What is projected first; none: all ones, so that the white photo is among them, and the smooth patterns that global light
    /// answers to come first.
    pub start: Option<Start>,
    /// What is projected beside it before any photo comes back, for a symmetric operator: the rest of a block. One start alone
    /// sees one vector of each eigenspace, and hardly tells regions apart that exchange no light but are alike, as the cups of a
    /// carton; [`smooth_starts`] do. An operator that is not symmetric has no use for them.
    pub beside: Vec<Vec<f64>>,
}

/// `count` smooth random patterns (`n` each) for [`LowRankCapture::beside`]: random signs blurred by a sixteenth of the width, so
/// that they are made of what global light answers to and what natural pictures are made of.
///
/// With 40 photos of a carton at 100×100, eleven of them beside white, checkerboards, stripes and a lit half are relit within 3.2
/// to 4.7 %; with white alone, four natural pictures within 2.2 to 5.9 %.
pub fn smooth_starts(resolution: Resolution, count: usize, seed: u64) -> Vec<Vec<f64>> {
    let sigma = (resolution.width as f64 / 16.0).max(1.0);
    smooth_patterns(resolution, std::f64::consts::SQRT_2 * sigma, count, seed)
}

impl Default for LowRankCapture {
    fn default() -> Self {
        Self { photos: 40, start: None, beside: Vec::new() }
    }
}

/// Takes `photos` photos with `operator` (`n × n`, without its direct light) and keeps them as a model; `direct` is the direct
/// image under white (`n`), or empty where it stays in the operator. The operator's observer sees each photo
/// ([`Estimate::Unpredicted`]); a break ends the capture with the photos taken so far.
///
/// # Errors
/// [`Error::Option`] naming `--photos`; [`Error::Dimension`] when the operator is not square or `direct` has another length;
/// whatever the operator fails with.
pub fn capture(operator: &mut dyn Operator, direct: &[f64], options: &LowRankCapture) -> Result<LowRank> {
    let n = operator.cols();
    if options.photos == 0 {
        return Err(Error::Option {
            option: "--photos".into(),
            fault: "no photo makes no model".into(),
            help: "give at least 1; 40 is usual".into(),
        });
    }
    let symmetric = operator.symmetry() == Symmetry::Symmetric;
    let start = options.start.as_ref().map_or_else(|| vec![1.0; n], |start| start.vector(n));
    let mut recorder = Recorded::new(operator);
    let basis = if symmetric {
        let mut block = vec![start];
        // A block wider than the photos would leave those that it starts with unseen.
        block.extend(options.beside.iter().take(options.photos - 1).cloned());
        run(BlockLanczos::new(&block, &[])?, &mut recorder, (options.photos, symmetric))?
    } else {
        run(Arnoldi::new(&start, &[])?, &mut recorder, (options.photos, symmetric))?
    };
    let photos = recorder.products.into_iter().take(basis.len()).map(|product| product.to).collect();
    LowRank::new(basis, photos, direct.to_vec(), symmetric)
}

/// The basis after so many steps, or as many as the space has dimensions.
fn run(
    mut process: impl Factorization,
    recorder: &mut Recorded<'_, dyn Operator + '_>,
    (photos, symmetric): (usize, bool),
) -> Result<Vec<Vec<f64>>> {
    while process.steps() < photos && !process.is_exhausted() {
        process.multiply_block(recorder, photos - process.steps())?;
        process.expand(recorder)?;
        let taken = &recorder.products[..process.products()];
        let step = Step {
            stage: "photos",
            done: taken.len() as u64,
            total: photos as u64,
            estimate: Estimate::Unpredicted(unpredicted(taken, symmetric)),
        };
        if recorder.observer().step(&step).is_break() {
            break;
        }
    }
    Ok(process.basis().to_vec())
}

/// The part of the last photo that the model of the photos before it did not predict, `‖w − Q Wᵀ q‖`, as a share of the strongest
/// photo: the model's error falls with it. Patterns are of norm 1. Without symmetry, the model predicts nothing for a pattern
/// that is orthogonal to all before it.
fn unpredicted(products: &[Product], symmetric: bool) -> f64 {
    let Some((last, before)) = products.split_last() else { return 1.0 };
    let mut rest = last.to.clone();
    if symmetric {
        for known in before {
            let share = dot(&known.to, &last.from);
            rest.iter_mut().zip(&known.from).for_each(|(rest, known)| *rest -= share * known);
        }
    }
    let strongest = products.iter().map(|product| norm(&product.to)).fold(0.0, f64::max);
    if strongest > 0.0 { norm(&rest) / strongest } else { 0.0 }
}
