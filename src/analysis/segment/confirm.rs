//! Confirms that no further region was missed.

use super::embedding::Embedding;
use super::graph::Graph;
use super::options::Cut;
use super::regions::KEPT;
use super::{CutMatrix, SegmentOptions};
use crate::error::Result;
use crate::krylov::{
    ClaimQuestion, Claimed, Completeness, Confirm, Factorization, RitzPair, Start, Which, confirming,
    largest_beside,
};
use crate::operator::Operator;

/// Knowledge about regions that a capture may have missed.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Unseen {
    /// The completeness of the eigenvalues of the normalized cut: above its limit, no eigenvalue is missing.
    pub completeness: Completeness,
    /// The eigenvalue of a region that the confirmation found and the capture missed.
    pub missed: Option<f64>,
    /// The number of photos of the confirmation; 0 if products are free.
    pub photos: usize,
}

/// Searches for a further eigenvalue of the normalized cut that may belong to a region, on the complement of the eigenvectors found
/// ([`largest_beside`]). The search runs only if products are free, or if the options request it.
pub(super) fn unseen(
    global: &mut dyn Operator,
    graph: &Graph,
    lanczos: &Factorization,
    options: &SegmentOptions,
) -> Result<Unseen> {
    let SegmentOptions { cut, seed, confirm, .. } = *options;
    if cut != Cut::Normalized {
        return Ok(Unseen::default());
    }
    let pairs = lanczos.ritz(Which::LargestAlgebraic, lanczos.steps())?;
    let values: Vec<f64> = pairs.iter().map(|pair| pair.value).collect();
    let start = Start::Random { seed };
    let question = ClaimQuestion::new("regions", confirm, (&start, &[]), (&[&values], &[]));
    let (is_free, claimed) = confirming(
        global,
        question,
        |_| true,
        |global, is_free| {
            let how = if is_free { Some(confirm.unwrap_or_default()) } else { confirm };
            how.map(|how| beside(global, graph, (lanczos, &pairs), (seed, how))).transpose()
        },
    )?;
    let Some(Claimed { completeness, more: (missed, photos), .. }) = claimed else {
        return Ok(Unseen::default());
    };
    Ok(Unseen { completeness, missed, photos: if is_free { 0 } else { photos } })
}

/// The largest number of localized eigenvectors that are set aside.
const MOST_LOCAL: u64 = 12;

/// The claim, the eigenvalue of a region that was missed, and the number of products.
fn beside(
    global: &mut dyn Operator,
    graph: &Graph,
    (lanczos, pairs): (&Factorization, &[RitzPair]),
    (seed, how): (u64, Confirm),
) -> Result<(Completeness, (Option<f64>, usize))> {
    let regions = pairs.iter().take_while(|pair| pair.value >= KEPT).count();
    let mut known = lanczos.known().to_vec();
    known.extend(pairs[..regions].iter().map(|pair| lanczos.ritz_vector(pair)));
    let mut operator = CutMatrix::new(global, graph, Cut::Normalized);
    let mut products = 0;
    for round in 0..MOST_LOCAL {
        let seed = seed.wrapping_add(round);
        let Some(found) = largest_beside(&mut operator, &known, seed, &how)? else { break };
        products += found.products;
        let is_region = found.value >= KEPT;
        let scaled = found.vector.iter().zip(graph.degree()).map(|(entry, degree)| entry / degree.sqrt());
        if is_region && Embedding::would_be_local(&scaled.collect::<Vec<f64>>(), graph.degree()) {
            // A few pixels that exchange light among themselves are not a region. The search continues on the complement of this
            // eigenvector.
            known.push(found.vector);
            continue;
        }
        return Ok((found.completeness.after(round), (is_region.then_some(found.value), products)));
    }
    Ok((Completeness::NotExcluded, (None, products)))
}
