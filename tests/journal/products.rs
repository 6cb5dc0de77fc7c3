//! Products through a journal: none is taken twice, and what comes out is the same to the bit.

use std::cell::Cell;
use std::fs;

use krylux::Result;
use krylux::journal::Journal;
use krylux::operator::{Adjoint, Direction, Operator, Symmetry};
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

/// Two parts of one matrix.
const NAMES: [&str; 2] = ["full, channel 0", "global, channel 0"];

/// Two products forwards and one back.
fn products(mut operator: JournaledOperator<'_>) -> Result<Vec<Vec<f64>>> {
    let mut all = Vec::new();
    for x in [[1.0, 2.0], [0.3, -0.0]] {
        let mut y = vec![f64::NAN; 3];
        operator.apply(&x, &mut y)?;
        all.push(y);
    }
    let mut x = vec![f64::NAN; 2];
    operator.apply_adjoint(&[1.0, 2.0, 3.0], &mut x)?;
    all.push(x);
    Ok(all)
}

#[test]
fn products_are_taken_once_and_replayed_without_the_operator() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let taken = Cell::new(0);
    let run = || {
        let mut journal = Journal::resume(folder.path(), &identity()).expect("nobody else has it");
        NAMES.map(|name| {
            let mut inner = Counted(&taken);
            products(JournaledOperator::new(&mut journal, name, &mut inner)).expect("they can be taken")
        })
    };
    let first = run();
    // A part's products are its own, though this operator does not tell them apart.
    assert_eq!(taken.replace(0), 6);
    assert_eq!(run(), first);
    assert_eq!(taken.get(), 0);

    let mut journal = Journal::read_only(folder.path()).expect("it is whole");
    let replayed = NAMES.map(|name| {
        let operator = JournaledOperator::replay(&mut journal, name, [3, 2], Symmetry::General);
        products(operator).expect("all are there")
    });
    assert_eq!(replayed, first);
    let mut operator = JournaledOperator::replay(&mut journal, NAMES[0], [3, 2], Symmetry::General);
    assert_eq!((operator.rows(), operator.cols(), operator.symmetry()), (3, 2, Symmetry::General));
    let error = operator.apply(&[5.0, 5.0], &mut [0.0; 3]).expect_err("it was never taken").to_string();
    assert!(error.contains("full, channel 0") && error.contains("--resume -o"), "{error}");

    // A damaged product is taken again, and no other.
    let mut bytes = fs::read(file(folder.path())).expect("it is there");
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(file(folder.path()), bytes).expect("there is room");
    assert_eq!(run(), first);
    assert_eq!(taken.get(), 1);
}

/// Like [`Counted`], with four products at a time; fails from some product on.
struct Blocks {
    /// The sizes of the blocks that were asked for.
    taken: Vec<usize>,
    /// The vector whose product fails.
    fails_at: f64,
}

impl Operator for Blocks {
    fn rows(&self) -> usize {
        1
    }

    fn cols(&self) -> usize {
        1
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.apply_block(&[x], &mut [y])
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.taken.push(xs.len());
        if xs.iter().any(|x| x[0] == self.fails_at) {
            return Err(krylux::Error::Numerical("unplugged".into()));
        }
        xs.iter().zip(ys).for_each(|(x, y)| y[0] = 3.0 * x[0]);
        Ok(())
    }

    fn block_size(&self) -> usize {
        4
    }
}

impl Adjoint for Blocks {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.apply(y, x)
    }
}

#[test]
fn of_a_block_only_the_products_that_the_journal_lacks_are_taken() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut journal = Journal::resume(folder.path(), &identity()).expect("nobody else has it");
    let mut inner = Blocks { taken: Vec::new(), fails_at: 9.0 };
    let block = |journal: &mut Journal, inner: &mut Blocks, xs: &[f64]| -> Result<Vec<f64>> {
        let mut ys = vec![f64::NAN; xs.len()];
        let xs: Vec<&[f64]> = xs.iter().map(std::slice::from_ref).collect();
        let mut to: Vec<&mut [f64]> = ys.iter_mut().map(std::slice::from_mut).collect();
        JournaledOperator::new(journal, "full", inner).apply_block(&xs, &mut to)?;
        Ok(ys)
    };
    assert_eq!(block(&mut journal, &mut inner, &[2.0]).expect("it can be taken"), [6.0]);
    let found = block(&mut journal, &mut inner, &[1.0, 2.0, 3.0, 1.0]).expect("they can be taken");
    assert_eq!(found, [3.0, 6.0, 9.0, 3.0]);
    assert_eq!(inner.taken, [1, 2], "2 is there, and 1 is taken once");
    // A block of four of the six is taken and kept; the next fails as a whole.
    assert!(block(&mut journal, &mut inner, &[4.0, 5.0, 6.0, 7.0, 8.0, 9.0]).is_err());
    let kept = JournaledOperator::kept(&mut journal, "full", Direction::Forward).expect("it can be read");
    let order: Vec<f64> = kept.iter().map(|product| product.from[0]).collect();
    assert_eq!(order, [2.0, 1.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    assert_eq!(inner.taken, [1, 2, 4, 2]);
}
