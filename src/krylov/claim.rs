//! The claims of confirmations. An operator keeps them with the photos of a run, in place of the products that confirmed them.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::completeness::{Completeness, Confirmed};
use super::eigen::HistoryRow;
use crate::error::{Error, Result};
use crate::operator::Operator;

/// A question that a confirmation answers: whether a search missed anything.
#[derive(Clone, Debug)]
pub struct Question {
    text: String,
    numbers: Vec<f64>,
}

/// The answer of a confirmation.
#[derive(Clone, Debug)]
pub struct Claimed<T> {
    /// The claim about values that the search may have missed.
    pub completeness: Completeness,
    /// What else the confirmation found.
    pub more: T,
    /// True if the operator had kept the answer, false if products confirmed it now.
    pub is_kept: bool,
}

/// The numbers of two searches are the same up to this difference, relative to the largest number. It is far above the differences between machines, whose products agree
/// to about 1e-12, and below the tolerance of a search (1e-8 by default).
const SAME: f64 = 1e-9;

/// A claim with the numbers of the search that it is about.
#[derive(Serialize, Deserialize)]
struct Kept<T> {
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

impl Question {
    /// Asks about the `values` that a search found. `text` names the method and all options on which its claim depends. A kept claim answers
    /// only a search with the same values, the same residuals and the same largest value after each product, up to 1e-9 of the largest
    /// number. With another operator, a process from the same random vector takes other values.
    pub fn new(text: String, values: &[f64], residuals: &[f64], history: &[HistoryRow]) -> Self {
        let first = history.iter().filter_map(|row| row.values.first());
        let mut numbers: Vec<f64> = values.iter().chain(residuals).chain(first).copied().collect();
        let scale = numbers.iter().fold(f64::MIN_POSITIVE, |scale, number| number.abs().max(scale));
        numbers.iter_mut().for_each(|number| *number /= scale);
        Self { text, numbers }
    }

    fn is_answered_by<T>(&self, kept: &Kept<T>) -> bool {
        // False for NaN.
        let is_same = |(own, kept): (&f64, &f64)| (own - kept).abs() <= SAME;
        kept.numbers.len() == self.numbers.len() && self.numbers.iter().zip(&kept.numbers).all(is_same)
    }

    fn answer<O: Operator + ?Sized, T: Serialize + DeserializeOwned>(
        self,
        operator: &mut O,
        is_free: bool,
        work: impl FnOnce(&mut O, bool) -> Result<Option<(Completeness, T)>>,
    ) -> Result<Option<Claimed<T>>> {
        // Searches with other numbers have asked this question before.
        let mut before = 0;
        let place = |before: usize| format!("{}; {before}", self.text);
        while is_free && let Some(bytes) = operator.claim(&place(before))? {
            match postcard::from_bytes::<Kept<T>>(&bytes) {
                Ok(kept) if self.is_answered_by(&kept) => {
                    let Kept { completeness, more, .. } = kept;
                    return Ok(Some(Claimed { completeness, more, is_kept: true }));
                }
                _ => before += 1,
            }
        }
        let place = place(before);
        let Some((completeness, more)) = work(operator, is_free)? else { return Ok(None) };
        let kept = Kept { numbers: self.numbers, completeness, more };
        if is_free && let Ok(bytes) = postcard::to_allocvec(&kept) {
            operator.keep_claim(&place, &bytes)?;
        }
        Ok(Some(Claimed { completeness, more: kept.more, is_kept: false }))
    }
}

/// Answers the question by the claim that the operator kept, or else by `work`, whose products only confirm a result. `work` is told
/// whether products cost nothing; if they do, the operator may keep the claim that it returns. Returns this flag and the answer. There is
/// no answer if `work` returns none, or if the products come from the recorded photos of a run without the claim, because these include no
/// photos for a confirmation. Fails with the errors of `work`, and of [`Operator::claim`] and [`Operator::keep_claim`].
pub fn confirming<O: Operator + ?Sized, T: Serialize + DeserializeOwned>(
    operator: &mut O,
    question: Question,
    work: impl FnOnce(&mut O, bool) -> Result<Option<(Completeness, T)>>,
) -> Result<(bool, Option<Claimed<T>>)> {
    let is_free = operator.confirming(true);
    let claimed = question.answer(operator, is_free, work);
    operator.confirming(false);
    match claimed {
        Err(Error::NotTaken { .. }) if is_free => Ok((is_free, None)),
        claimed => Ok((is_free, claimed?)),
    }
}
