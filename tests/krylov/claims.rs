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
        EigsOptions { confirm: share(0.005), ..options.clone() },
        EigsOptions { noise: 1e-9, ..options.clone() },
    ] {
        let (found, products) = ask(&simple, &other);
        assert_eq!(found.confirming, products, "{other:?}");
        assert!(products > 0, "{other:?}");
        assert_eq!(ask(&simple, &other).1, 0, "its own claim was kept");
    }
    // A claim with a smaller share says more, and the default is the share that was asked for.
    for weaker in [share(0.05), None] {
        let (found, products) = ask(&simple, &EigsOptions { confirm: weaker, ..options.clone() });
        assert_eq!((found.completeness, products), (first.completeness, 0));
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
fn given_vectors_and_multiples_of_an_operator_are_other_questions() {
    let diagonal = |largest: &[f64]| -> Dense {
        let values: Vec<f64> =
            (0..80).map(|k| largest.get(k).copied().unwrap_or(1.0 / f64::from(k as u32))).collect();
        Dense::diagonal(&values)
    };
    let unit = |at: usize| -> Vec<f64> { (0..80).map(|k| f64::from(u8::from(k == at))).collect() };
    let given = |zeros: &[usize]| -> Start {
        Start::Given((0..80).map(|k| if zeros.contains(&k) { 0.0 } else { 1.0 + k as f64 / 80.0 }).collect())
    };
    let options = |count: usize, start: Start, deflate: Vec<Vec<f64>>| EigsOptions {
        count,
        products: 70,
        start,
        deflate,
        ..EigsOptions::default()
    };
    let ask = |matrix: &Dense, options: &EigsOptions, claims: &mut BTreeMap<String, Vec<u8>>| -> Eigs {
        eigs(&mut Run::new(matrix, claims), options).unwrap()
    };
    // The start has no part along the two largest, of which one is deflated.
    let (matrix, mut claims) = (diagonal(&[7.0, 6.0, 5.0, 3.0]), BTreeMap::new());
    for (deflated, expected) in [(0, 6.0), (1, 7.0)] {
        let found = ask(&matrix, &options(1, given(&[0, 1]), vec![unit(deflated)]), &mut claims);
        assert!(
            (found.values[0] - expected).abs() < 1e-7 && found.vectors[0][deflated].abs() < 1e-7,
            "{found:?}"
        );
    }
    // The start has a part along one of two copies, and the confirmation finds the other one.
    let (matrix, mut claims) = (diagonal(&[5.0, 5.0, 3.0]), BTreeMap::new());
    for missing in [1, 0] {
        let found = ask(&matrix, &options(2, given(&[missing]), Vec::new()), &mut claims);
        assert!(found.values.iter().all(|value| (value - 5.0).abs() < 1e-7), "{:?}", found.values);
        assert!(krylux::krylov::dot(&found.vectors[0], &found.vectors[1]).abs() < 1e-7);
    }
    let mut claims = BTreeMap::new();
    for factor in [1.0, 2.0, 0.5] {
        let multiple = diagonal(&[5.0, 5.0, 3.0].map(|value| value * factor));
        let multiple = Dense {
            entries: (0..80 * 80)
                .map(|k| if k / 80 == k % 80 && k / 80 > 2 { factor } else { 1.0 } * multiple.entries[k])
                .collect(),
            ..multiple
        };
        let found = ask(&multiple, &options(2, Start::default(), Vec::new()), &mut claims);
        assert!(found.values.iter().all(|value| (value - 5.0 * factor).abs() < 1e-6), "{:?}", found.values);
    }
}

#[test]
fn a_claim_that_cannot_be_read_is_confirmed_again() {
    // Two copies, of which a confirmation finds the second.
    let values = (0..150).map(|k| 1.0 / (1.0 + f64::from(k / 2))).collect::<Vec<f64>>();
    let matrix = Dense::turned(&values);
    let options = EigsOptions { count: 3, products: 60, ..EigsOptions::default() };
    let singular_options = SingularOptions { count: 3, products: 120, ..SingularOptions::default() };
    let mut claims = BTreeMap::new();
    let first = eigs(&mut Run::new(&matrix, &mut claims), &options).unwrap();
    let triplets = singular(&mut Run::new(&matrix, &mut claims), &singular_options).unwrap();
    assert!(claims.len() == 2 && first.confirming > 0 && triplets.confirming > 0);
    let whole = claims.clone();
    let lengths = whole.values().map(Vec::len).max().unwrap();
    for length in (0..lengths).step_by(97) {
        let mut cut = whole.clone();
        cut.values_mut().for_each(|claim| claim.truncate(claim.len() * length / lengths));
        let mut run = Run::new(&matrix, &mut cut);
        let again = eigs(&mut run, &options).unwrap();
        assert_eq!((bits(&again), run.confirming), (bits(&first), first.confirming), "{length}");
        let mut run = Run::new(&matrix, &mut cut);
        let again = singular(&mut run, &singular_options).unwrap();
        assert_eq!((bits(&again), run.confirming), (bits(&triplets), triplets.confirming), "{length}");
    }
    // A stranger may write anything: vectors of 149 entries do not fit, and are confirmed again. The length 150 is written as [0x96, 1].
    for (question, claim) in &whole {
        for at in (0..claim.len() - 10).filter(|&at| claim[at..at + 2] == [0x96, 1]) {
            let mut forged = whole.clone();
            forged.insert(question.clone(), [&claim[..at], &[0x95, 1], &claim[at + 10..]].concat());
            let again = eigs(&mut Run::new(&matrix, &mut forged), &options).unwrap();
            assert_eq!(bits(&again), bits(&first));
            let again = singular(&mut Run::new(&matrix, &mut forged), &singular_options).unwrap();
            assert_eq!(bits(&again), bits(&triplets));
        }
    }
}

#[test]
fn an_exact_claim_answers_for_any_share() {
    let mut claims = BTreeMap::new();
    let mut ask = |matrix: &Dense, share: f64, products: usize| -> (Completeness, usize) {
        let confirm = Some(Confirm { share, products, ..Confirm::default() });
        let options = EigsOptions { count: 3, products: 120, confirm, ..EigsOptions::default() };
        let mut run = Run::new(matrix, &mut claims);
        (eigs(&mut run, &options).unwrap().completeness, run.confirming)
    };
    // A process in the complement of three pairs of a small matrix spans it.
    let small = Dense::turned(&(0..12).map(|k| 1.0 / (1.0 + f64::from(k))).collect::<Vec<f64>>());
    assert_eq!(ask(&small, 0.05, 400).0, Completeness::Exact);
    assert_eq!(ask(&small, 0.01, 400), (Completeness::Exact, 0));
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
