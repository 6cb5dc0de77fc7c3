//! A claim that was kept answers as the products that confirmed it, and answers nothing else.

#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use std::collections::BTreeMap;

use krylux::krylov::{
    Completeness, Confirm, Eigs, EigsOptions, Singular, SingularOptions, Start, Which, eigs, singular,
};
use krylux::operator::{Adjoint, Operator, Symmetry};
use krylux::{Error, Result};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::completeness::structured;
use crate::krylov_support::Dense;

/// The operator of a run: it keeps claims, and counts the products that only confirm.
struct Run<'a> {
    matrix: Dense,
    claims: &'a mut BTreeMap<String, Vec<u8>>,
    is_confirming: bool,
    confirming: usize,
    /// Products that only confirm can be computed.
    has_scene: bool,
}

impl<'a> Run<'a> {
    fn new(matrix: &Dense, claims: &'a mut BTreeMap<String, Vec<u8>>) -> Self {
        Self { matrix: matrix.clone(), claims, is_confirming: false, confirming: 0, has_scene: true }
    }

    fn count(&mut self) -> Result<()> {
        if self.is_confirming && !self.has_scene {
            return Err(Error::not_taken("run", "a product to confirm"));
        }
        self.confirming += usize::from(self.is_confirming);
        Ok(())
    }
}

impl Operator for Run<'_> {
    fn rows(&self) -> usize {
        self.matrix.n
    }

    fn cols(&self) -> usize {
        self.matrix.n
    }

    fn symmetry(&self) -> Symmetry {
        self.matrix.symmetry
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.count()?;
        self.matrix.apply(x, y)
    }

    fn confirming(&mut self, on: bool) -> bool {
        self.is_confirming = on;
        true
    }

    fn claim(&mut self, question: &str) -> Result<Option<Vec<u8>>> {
        Ok(self.claims.get(question).cloned())
    }

    fn keep_claim(&mut self, question: &str, claim: &[u8]) -> Result<()> {
        assert!(
            self.claims.insert(question.to_owned(), claim.to_vec()).is_none(),
            "one claim for a question"
        );
        Ok(())
    }
}

impl Adjoint for Run<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.count()?;
        self.matrix.apply_adjoint(y, x)
    }
}

/// All of a result, to the bit: Rust prints the shortest number that is read as the same bits.
fn bits(found: &impl std::fmt::Debug) -> String {
    format!("{found:?}")
}

fn options(random: &mut Pcg64, seed: u64) -> EigsOptions {
    let which = [Which::LargestAlgebraic, Which::SmallestAlgebraic, Which::LargestMagnitude, Which::BothEnds];
    EigsOptions {
        count: random.random_range(1..=6),
        which: which[random.random_range(0..4)],
        products: 400,
        start: Start::Random { seed },
        ..EigsOptions::default()
    }
}

#[test]
fn a_kept_claim_answers_as_the_products_that_confirmed_it() {
    let mut random = Pcg64::seed_from_u64(71);
    let (mut confirmed, mut inserted) = (0, 0);
    for trial in 0..400 {
        let matrix = structured(&mut random);
        let mut claims = BTreeMap::new();
        let options = options(&mut random, trial);
        let mut pairs = |has_scene: bool| -> (Eigs, usize) {
            let mut run = Run { has_scene, ..Run::new(&matrix, &mut claims) };
            (eigs(&mut run, &options).unwrap(), run.confirming)
        };
        let (first, products) = pairs(true);
        assert_eq!(first.confirming, products);
        // Pairs were inserted if the search before the confirmation had found others.
        confirmed += usize::from(products > 0);
        let last = first.history.last().map_or(&[][..], |row| &row.values);
        inserted += usize::from(products > 0 && last != first.values);
        for has_scene in [true, false] {
            let (again, products) = pairs(has_scene);
            assert_eq!((bits(&again), products), (bits(&first), 0), "{trial}");
        }
        let singular_options =
            SingularOptions { count: options.count, products: 400, ..SingularOptions::default() };
        let mut triplets = |has_scene: bool| -> (Singular, usize) {
            let mut run = Run { has_scene, ..Run::new(&matrix, &mut claims) };
            (singular(&mut run, &singular_options).unwrap(), run.confirming)
        };
        let (first, products) = triplets(true);
        assert_eq!(first.confirming, products);
        for has_scene in [true, false] {
            let (again, products) = triplets(has_scene);
            assert_eq!((bits(&again), products), (bits(&first), 0), "{trial}");
        }
    }
    assert!(confirmed > 100 && inserted > 20, "{inserted} of {confirmed} confirmations inserted a pair");
}

#[test]
fn a_claim_answers_no_other_question_and_no_other_operator() {
    let spectrum = |second: f64| -> Dense {
        let values: Vec<f64> =
            (0..120).map(|k| [5.0, second, 3.0].get(k).copied().unwrap_or(1.0 / k as f64)).collect();
        Dense::turned(&values)
    };
    let simple = spectrum(2.0);
    let options =
        EigsOptions { count: 1, products: 100, confirm: Some(Confirm::default()), ..EigsOptions::default() };
    let mut claims = BTreeMap::new();
    let mut ask = |matrix: &Dense, options: &EigsOptions| -> (Eigs, usize) {
        let mut run = Run::new(matrix, &mut claims);
        (eigs(&mut run, options).unwrap(), run.confirming)
    };
    let (first, products) = ask(&simple, &options);
    assert!(products > 0 && matches!(first.completeness, Completeness::Confirmed(_)));
    let share = |share: f64| Some(Confirm { share, ..Confirm::default() });
    for other in [
        EigsOptions { count: 2, ..options.clone() },
        EigsOptions { which: Which::LargestMagnitude, ..options.clone() },
        EigsOptions { tolerance: 1e-7, ..options.clone() },
        EigsOptions { start: Start::Random { seed: 1 }, ..options.clone() },
        EigsOptions { confirm: share(0.02), ..options.clone() },
        EigsOptions { noise: 1e-9, ..options.clone() },
    ] {
        let (found, products) = ask(&simple, &other);
        assert_eq!(found.confirming, products, "{other:?}");
        assert!(products > 0, "{other:?}");
        assert_eq!(ask(&simple, &other).1, 0, "its own claim was kept");
    }
    // The largest value of these operators is that of the first, but the claim does not hold for the others.
    for second in [5.0, 5.0 - 1e-6, 4.5] {
        let other = spectrum(second);
        let (found, products) = ask(&other, &options);
        assert!(products > 0 && (found.values[0] - 5.0).abs() < 1e-7, "{second}: {:?}", found.values);
        let (again, products) = ask(&other, &options);
        assert_eq!((bits(&again), products), (bits(&found), 0), "both claims are kept");
    }
    let (again, products) = ask(&simple, &options);
    assert_eq!((bits(&again), products), (bits(&first), 0), "the first claim is still there");
}

#[test]
fn a_claim_that_cannot_be_read_is_confirmed_again() {
    let matrix = Dense::turned(&(0..150).map(|k| 1.0 / (1.0 + f64::from(k))).collect::<Vec<f64>>());
    let options = EigsOptions { count: 3, products: 60, ..EigsOptions::default() };
    let mut claims = BTreeMap::new();
    let first = eigs(&mut Run::new(&matrix, &mut claims), &options).unwrap();
    let whole = claims.values().next().unwrap().clone();
    for length in (0..whole.len()).step_by(7) {
        claims.values_mut().for_each(|claim| *claim = whole[..length].to_vec());
        claims.retain(|question, _| question.ends_with("; 0"));
        let mut run = Run::new(&matrix, &mut claims);
        let again = eigs(&mut run, &options).unwrap();
        assert_eq!((bits(&again), run.confirming), (bits(&first), first.confirming), "{length}");
    }
}

#[test]
fn a_run_without_its_claim_claims_nothing() {
    let matrix = Dense::turned(&(0..150).map(|k| 1.0 / (1.0 + f64::from(k))).collect::<Vec<f64>>());
    let options = EigsOptions { count: 3, products: 60, ..EigsOptions::default() };
    let mut claims = BTreeMap::new();
    let mut run = Run { has_scene: false, ..Run::new(&matrix, &mut claims) };
    let found = eigs(&mut run, &options).unwrap();
    assert_eq!((found.completeness, found.confirming), (Completeness::NotExcluded, 0));
    assert!(claims.is_empty());
}
