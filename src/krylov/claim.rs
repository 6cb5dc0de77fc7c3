//! The claims of confirmations. An operator keeps them with the photos of a run, in place of the products that confirmed them.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::completeness::{Completeness, Confirm, Confirmed, Status};
use super::eigen::HistoryRow;
use super::start::Start;
use crate::error::{Error, Result};
use crate::operator::Operator;

/// The question whether a search missed anything.
pub(crate) struct ClaimQuestion {
    text: String,
    share: f64,
    numbers: Vec<f64>,
}

/// The answer of a confirmation.
pub(crate) struct Claimed<T> {
    /// The claim about values that the search may have missed.
    pub(crate) completeness: Completeness,
    /// The other findings of the confirmation.
    pub(crate) more: T,
    /// True if the operator had kept the answer, false if products confirmed it now.
    pub(crate) is_kept: bool,
}

/// The pairs that a confirmation found and the search had missed, and further findings.
#[derive(Serialize, Deserialize)]
pub(super) struct MissedPairs<M> {
    /// The missed pairs, in the order in which they were found.
    pub(super) missed: Vec<M>,
    /// The number of products.
    pub(super) products: usize,
    /// True if a missed pair was found but has not converged.
    pub(super) is_open: bool,
}

impl<M> Claimed<MissedPairs<M>> {
    /// Applies the answer to the result of a search. Returns the missed pairs that the result does not yet contain: a confirmation that
    /// takes products inserts them itself, and counts these products.
    pub(super) fn apply(
        self,
        completeness: &mut Completeness,
        status: &mut Status,
        confirming: &mut usize,
    ) -> Vec<M> {
        let MissedPairs { missed, products, is_open } = self.more;
        *completeness = self.completeness;
        if is_open {
            *status = Status::BudgetSpent;
        }
        if !self.is_kept {
            return Vec::new();
        }
        *confirming = confirming.saturating_add(products);
        missed
    }
}

/// The numbers of two searches are the same up to this share of the largest number. It is far above the differences between machines, whose
/// products agree to about 1e-12, and below the default tolerance of a search (1e-8).
const SAME: f64 = 1e-9;

/// The version of the format of [`Kept`] and of the findings in it. A claim in another format is confirmed again.
const FORM: u32 = 1;

/// A claim with the numbers of the search that it is about.
#[derive(Serialize, Deserialize)]
struct Kept<T> {
    /// [`Confirm::share`].
    share: f64,
    numbers: Vec<f64>,
    #[serde(with = "Plain")]
    completeness: Completeness,
    more: T,
}

/// The form of a kept [`Completeness`]. The binary format does not know the tags of its form in reports.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Completeness")]
enum Plain {
    NotExcluded,
    Confirmed(Confirmed),
    Exact,
}

impl ClaimQuestion {
    /// `method` names the method and all options on which its claim depends, except these: the confirmation asked for, the start, and known
    /// vectors. `numbers` are the results of the search and its `history`. With another operator, a process from the same start takes other
    /// values. A kept claim answers only a search with the same numbers, up to 1e-9 of the largest. It may be stronger than the one asked
    /// for.
    pub(crate) fn new(
        method: &str,
        confirm: Option<Confirm>,
        (start, known): (&Start, &[Vec<f64>]),
        (numbers, history): (&[&[f64]], &[HistoryRow]),
    ) -> Self {
        let Confirm { share, chance, products, .. } = confirm.unwrap_or_default();
        let start = match start {
            Start::Given(vector) => format!("given {}", digest(std::slice::from_ref(vector))),
            drawn => format!("{drawn:?}"),
        };
        let known = digest(known);
        let text = format!("{method}, {start}, known {known}, chance {chance:e}, {products} products");
        let first = history.iter().filter_map(|row| row.values.first());
        Self { text, share, numbers: numbers.iter().copied().flatten().chain(first).copied().collect() }
    }

    fn is_answered_by<T>(&self, kept: &Kept<T>) -> bool {
        let largest = self.numbers.iter().fold(0.0, |largest: f64, number| number.abs().max(largest));
        // False for NaN.
        let is_same = |(own, kept): (&f64, &f64)| (own - kept).abs() <= SAME * largest;
        let is_alike = kept.numbers.len() == self.numbers.len();
        let says_enough = match kept.completeness {
            Completeness::Exact => true,
            Completeness::Confirmed(_) => kept.share <= self.share,
            Completeness::NotExcluded => kept.share == self.share,
        };
        says_enough && is_alike && self.numbers.iter().zip(&kept.numbers).all(is_same)
    }

    fn answer<O: Operator + ?Sized, T: Serialize + DeserializeOwned>(
        self,
        operator: &mut O,
        is_free: bool,
        fits: impl Fn(&T) -> bool,
        work: impl FnOnce(&mut O, bool) -> Result<Option<(Completeness, T)>>,
    ) -> Result<Option<Claimed<T>>> {
        // The number of claims about other searches with this text.
        let mut others = 0;
        let place = |others: usize| format!("form {FORM}, {}; {others}", self.text);
        while is_free && let Some(bytes) = operator.claim(&place(others))? {
            match postcard::take_from_bytes::<Kept<T>>(&bytes) {
                Ok((kept, [])) if self.is_answered_by(&kept) && fits(&kept.more) => {
                    let Kept { completeness, more, .. } = kept;
                    return Ok(Some(Claimed { completeness, more, is_kept: true }));
                }
                _ => others += 1,
            }
        }
        let place = place(others);
        let Some((completeness, more)) = work(operator, is_free)? else { return Ok(None) };
        let kept = Kept { share: self.share, numbers: self.numbers, completeness, more };
        if is_free && let Ok(bytes) = postcard::to_allocvec(&kept) {
            operator.keep_claim(&place, &bytes)?;
        }
        Ok(Some(Claimed { completeness, more: kept.more, is_kept: false }))
    }
}

/// The BLAKE3 hash of vectors and their lengths.
fn digest(vectors: &[Vec<f64>]) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    for vector in vectors {
        hasher.update(&(vector.len() as u64).to_le_bytes());
        for value in vector {
            hasher.update(&value.to_le_bytes());
        }
    }
    hasher.finalize()
}

/// Answers the question by the claim that the operator kept, or else by `work`, whose products only confirm a result. `work` is told
/// whether products cost nothing; if they do, the operator may keep the claim that it returns. A kept claim whose findings do not fit the
/// operator is not used.
///
/// Returns whether products cost nothing, and the answer. There is no answer if `work` returns none, or if the products come from the
/// recorded photos of a run that does not keep the claim. Fails with the errors of `work`, [`Operator::claim`] and
/// [`Operator::keep_claim`].
pub(crate) fn confirming<O: Operator + ?Sized, T: Serialize + DeserializeOwned>(
    operator: &mut O,
    question: ClaimQuestion,
    fits: impl Fn(&T) -> bool,
    work: impl FnOnce(&mut O, bool) -> Result<Option<(Completeness, T)>>,
) -> Result<(bool, Option<Claimed<T>>)> {
    let is_free = operator.confirming(true);
    let claimed = question.answer(operator, is_free, fits, work);
    operator.confirming(false);
    match claimed {
        Err(Error::NotTaken { .. }) if is_free => Ok((is_free, None)),
        claimed => Ok((is_free, claimed?)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_claim_answers_the_same_numbers_and_no_stronger_question() {
        let limits = [None, Some(1.0)];
        let confirmed = Completeness::Confirmed(Confirmed { limits, share: 0.02, chance: 1e-3 });
        let answers = |share: f64, numbers: &[f64], completeness: Completeness| {
            let question = ClaimQuestion { text: String::new(), share, numbers: numbers.to_vec() };
            question.is_answered_by(&Kept { share: 0.02, numbers: vec![4.0, 1e-9], completeness, more: () })
        };
        let shares = [0.01, 0.02, 0.05];
        for (completeness, expected) in [
            (confirmed, [false, true, true]),
            (Completeness::Exact, [true; 3]),
            // A confirmation with a larger share may still succeed.
            (Completeness::NotExcluded, [false, true, false]),
        ] {
            assert_eq!(shares.map(|share| answers(share, &[4.0, 2e-9], completeness)), expected);
        }
        for others in [&[4.0 + 1e-8, 1e-9][..], &[4.0, 1e-8], &[4.0], &[4.0, 1e-9, 0.0], &[f64::NAN, 1e-9]] {
            assert!(!answers(0.02, others, Completeness::Exact), "{others:?}");
        }
    }
}
