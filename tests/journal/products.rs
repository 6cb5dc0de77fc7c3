//! Products through a journal: none is taken twice, and what comes out is the same to the bit.

use std::cell::{Cell, RefCell};
use std::fs;

use krylux::Result;
use krylux::journal::Journal;
use krylux::operator::{Adjoint, Operator, Symmetry};
use krylux::transport::JournaledOperator;

use super::{file, identity};

/// A matrix of 3 × 2, and how many products were taken of it.
struct Counted<'a>(&'a Cell<usize>);

const MATRIX: [[f64; 2]; 3] = [[1.0, 0.1], [1.0 / 3.0, -2.0], [0.0, 1e-300]];

impl Operator for Counted<'_> {
    fn rows(&self) -> usize {
        3
    }

    fn cols(&self) -> usize {
        2
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.0.set(self.0.get() + 1);
        y.iter_mut().zip(MATRIX).for_each(|(y, row)| *y = row[0] * x[0] + row[1] * x[1]);
        Ok(())
    }
}

impl Adjoint for Counted<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.0.set(self.0.get() + 1);
        for (column, x) in x.iter_mut().enumerate() {
            *x = MATRIX.iter().zip(y).map(|(row, y)| row[column] * y).sum();
        }
        Ok(())
    }
}

/// Two products forwards and one back, of two parts.
fn products(operators: &mut [JournaledOperator<'_>]) -> Result<Vec<Vec<f64>>> {
    let mut all = Vec::new();
    for operator in operators {
        for x in [[1.0, 2.0], [0.3, -0.0]] {
            let mut y = vec![f64::NAN; 3];
            operator.apply(&x, &mut y)?;
            all.push(y);
        }
        let mut x = vec![f64::NAN; 2];
        operator.apply_adjoint(&[1.0, 2.0, 3.0], &mut x)?;
        all.push(x);
    }
    Ok(all)
}

#[test]
fn products_are_taken_once_and_replayed_without_the_operator() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let taken = Cell::new(0);
    let run = |journal: &RefCell<Journal>| {
        let (mut full, mut global) = (Counted(&taken), Counted(&taken));
        let full = JournaledOperator::new(journal, "full, channel 0", &mut full);
        let global = JournaledOperator::new(journal, "global, channel 0", &mut global);
        products(&mut [full, global]).expect("they can be taken")
    };
    let open = || RefCell::new(Journal::resume(folder.path(), &identity()).expect("nobody else has it"));
    let first = run(&open());
    // A part's products are its own, though this operator does not tell them apart.
    assert_eq!(taken.replace(0), 6);
    assert_eq!(run(&open()), first);
    assert_eq!(taken.get(), 0);

    let replay = RefCell::new(Journal::read_only(folder.path()).expect("it is whole"));
    let operator = |name| JournaledOperator::replay(&replay, name, [3, 2], Symmetry::General);
    let mut operators = [operator("full, channel 0"), operator("global, channel 0")];
    assert_eq!(
        (operators[0].rows(), operators[0].cols(), operators[0].symmetry()),
        (3, 2, Symmetry::General)
    );
    assert_eq!(products(&mut operators).expect("all are there"), first);
    let error = operators[0].apply(&[5.0, 5.0], &mut [0.0; 3]).expect_err("it was never taken").to_string();
    assert!(error.contains("full, channel 0") && error.contains("--resume -o"), "{error}");

    // A damaged product is taken again, and no other.
    let mut bytes = fs::read(file(folder.path())).expect("it is there");
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(file(folder.path()), bytes).expect("there is room");
    assert_eq!(run(&open()), first);
    assert_eq!(taken.get(), 1);
}
