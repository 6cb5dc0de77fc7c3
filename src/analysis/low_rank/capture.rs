//! The photos of a low-rank model: a Krylov process that stores its photos.

use super::LowRank;
use crate::analysis::probe::{default_sigma, smooth_patterns};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::krylov::{Arnoldi, BlockLanczos, Factorization, Start, dot, norm};
use crate::observer::{Estimate, Step};
use crate::operator::{Operator, Product, Recorded, Symmetry};

/// The options of a low-rank capture.
#[derive(Clone, Debug)]
pub struct LowRankCapture {
    /// The number of photos of the process, which is also the rank `k` of `W Qᵀ`; at least 1.
    pub photos: usize,
    /// The first pattern. `None` stands for all ones, which makes the white photo part of the capture and begins with smooth patterns.
    pub start: Option<Start>,
    /// Further start vectors of the first block, for a symmetric operator; other operators ignore them. One start finds one vector per
    /// eigenspace. It hardly separates similar regions without exchange, such as the cups of a carton; [`smooth_starts`] do.
    pub beside: Vec<Vec<f64>>,
}

/// Returns `count` smooth random patterns (`n` each) for [`LowRankCapture::beside`]: random signs blurred by a sixteenth of the
/// width. Global light and natural images are smooth as well.
///
/// With 40 photos of a carton at 100×100 and eleven such starts besides white, checkerboards, stripes and a half-lit field are
/// relit within 3.2 to 4.7 %. With white alone, four natural images are relit within 2.2 to 5.9 %.
pub fn smooth_starts(resolution: Resolution, count: usize, seed: u64) -> Vec<Vec<f64>> {
    smooth_patterns(resolution, std::f64::consts::SQRT_2 * default_sigma(resolution), count, seed)
}

impl Default for LowRankCapture {
    fn default() -> Self {
        Self { photos: 40, start: None, beside: Vec::new() }
    }
}

/// Captures a model from `photos` photos with `operator` (`n × n`, without its direct light). `direct` is the direct image under
/// white (`n`), or empty if it stays in the operator. The operator's observer sees each photo ([`Estimate::Unpredicted`]). A
/// break ends the capture with the photos taken so far.
///
/// # Errors
/// [`Error::Option`] naming `--photos`; [`Error::Dimension`] if `operator` is not square or `direct` has another length; any
/// error of the operator.
pub fn capture(operator: &mut dyn Operator, direct: &[f64], options: &LowRankCapture) -> Result<LowRank> {
    let n = operator.cols();
    if options.photos == 0 {
        return Err(Error::option("--photos", "no photo makes no model").help("give at least 1; 40 is usual"));
    }
    let symmetric = operator.symmetry() == Symmetry::Symmetric;
    let start = options.start.as_ref().map_or_else(|| vec![1.0; n], |start| start.vector(n));
    let mut recorder = Recorded::new(operator);
    let basis = if symmetric {
        let mut block = vec![start];
        // With a block wider than the number of photos, some start vectors would never be photographed.
        block.extend(options.beside.iter().take(options.photos - 1).cloned());
        run(BlockLanczos::new(&block, &[])?, &mut recorder, (options.photos, symmetric))?
    } else {
        run(Arnoldi::new(&start, &[])?, &mut recorder, (options.photos, symmetric))?
    };
    let photos = recorder.products.into_iter().take(basis.len()).map(|product| product.to).collect();
    LowRank::new(basis, photos, direct.to_vec(), symmetric)
}

/// Runs the process for a number of photos, or until the space is exhausted, and returns its basis.
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

/// The part of the last photo that the model of the earlier photos did not predict: `‖w − Q Wᵀ q‖` for a pattern `q` of norm 1, relative to
/// the strongest photo. The model's error falls with it. Without symmetry, the model predicts nothing for a new orthogonal pattern.
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
