//! Products that are written down before they are used, and that are never taken twice.

use std::cell::RefCell;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::journal::{Journal, Key, Kind};
use crate::operator::{Adjoint, Operator, Product, Symmetry};

/// An operator whose products are kept in a journal; those that are there already are handed out without it. Operators of one
/// source share a journal, each by its name: which part of the light, and which channel.
pub struct JournaledOperator<'a> {
    journal: &'a RefCell<Journal>,
    inner: Option<&'a mut dyn Adjoint>,
    name: String,
    shape: ([usize; 2], Symmetry),
}

/// What stands beside a product.
#[derive(Serialize, Deserialize)]
struct Note {
    operator: String,
    direction: Direction,
    /// The key of what was multiplied.
    pattern: String,
}

#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Direction {
    Forward,
    Adjoint,
}

impl<'a> JournaledOperator<'a> {
    /// Keeps the products of `inner`, whose journal's identity must say all that they depend on besides `name`.
    pub fn new(journal: &'a RefCell<Journal>, name: impl Into<String>, inner: &'a mut dyn Adjoint) -> Self {
        let shape = ([inner.rows(), inner.cols()], inner.symmetry());
        Self { journal, inner: Some(inner), name: name.into(), shape }
    }

    /// Hands out what was kept under this name of an operator of this shape, and nothing else.
    pub fn replay(
        journal: &'a RefCell<Journal>,
        name: impl Into<String>,
        [rows, cols]: [usize; 2],
        symmetry: Symmetry,
    ) -> Self {
        Self { journal, inner: None, name: name.into(), shape: ([rows, cols], symmetry) }
    }

    /// All products `y = A x` that were kept under this name, in the order in which they were taken; those that are damaged are
    /// passed over.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Journal`] for a record in a form that this version does not know.
    pub fn kept(journal: &mut Journal, name: &str) -> Result<Vec<Product>> {
        let misread = |journal: &Journal| Error::Journal {
            path: journal.path().into(),
            fault: "the record of a product is whole, but not in a form that this version knows".into(),
            help: "open it with the version of krylux that wrote it".into(),
        };
        let photos = journal.entries().iter().filter(|entry| entry.kind == Kind::Photo);
        let noted: Vec<(Key, Vec<u8>)> = photos.map(|entry| (entry.key, entry.metadata.clone())).collect();
        let mut products = Vec::new();
        for (key, metadata) in noted {
            let note: Note = serde_json::from_slice(&metadata).map_err(|_| misread(journal))?;
            if note.operator != name || note.direction != Direction::Forward {
                continue;
            }
            let pattern = Key::from_hex(&note.pattern).ok_or_else(|| misread(journal))?;
            if let (Some(x), Some(y)) = (journal.get(pattern)?, journal.get(key)?) {
                products.push(Product { from: numbers(&x.payload), to: numbers(&y.payload) });
            }
        }
        Ok(products)
    }

    fn product(&mut self, direction: Direction, from: &[f64], to: &mut [f64]) -> Result<()> {
        let pattern: Vec<u8> = from.iter().flat_map(|value| value.to_le_bytes()).collect();
        let side: &[u8] = match direction {
            Direction::Forward => b"forward",
            Direction::Adjoint => b"adjoint",
        };
        let mut journal = self.journal.borrow_mut();
        let pattern_key = Key::of(&[b"pattern", &pattern]);
        let key = journal.key(&[b"product", self.name.as_bytes(), side, pattern_key.bytes()]);
        if let Some(stored) = journal.get(key)? {
            let (values, rest) = stored.payload.as_chunks::<8>();
            if values.len() != to.len() || !rest.is_empty() {
                return Err(Error::Dimension {
                    what: "a product in the journal",
                    expected: format!("{} values", to.len()),
                    found: format!("{} bytes", stored.payload.len()),
                });
            }
            for (to, value) in to.iter_mut().zip(values) {
                *to = f64::from_le_bytes(*value);
            }
            return Ok(());
        }
        let Some(inner) = &mut self.inner else { return Err(missing(&journal, &self.name)) };
        match direction {
            Direction::Forward => inner.apply(from, to)?,
            Direction::Adjoint => inner.apply_adjoint(from, to)?,
        }
        let pattern = journal.pattern(&pattern)?.to_string();
        let note = Note { operator: self.name.clone(), direction, pattern };
        let photo: Vec<u8> = to.iter().flat_map(|value| value.to_le_bytes()).collect();
        // Texts always have a JSON form.
        journal.append_soon(Kind::Photo, key, &serde_json::to_vec(&note).unwrap_or_default(), &photo)
    }
}

fn numbers(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks::<8>().0.iter().map(|value| f64::from_le_bytes(*value)).collect()
}

fn missing(journal: &Journal, name: &str) -> Error {
    let folder = journal.path().parent().and_then(|journal| journal.parent()).unwrap_or(journal.path());
    Error::Journal {
        path: journal.path().into(),
        fault: format!("a photo ({name}) is not among its {}, and there is no scene", journal.photos()),
        help: format!("give the scene: krylux VERB SCENE --resume -o {}", folder.display()),
    }
}

impl Operator for JournaledOperator<'_> {
    fn rows(&self) -> usize {
        self.shape.0[0]
    }

    fn cols(&self) -> usize {
        self.shape.0[1]
    }

    fn symmetry(&self) -> Symmetry {
        self.shape.1
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.product(Direction::Forward, x, y)
    }

    fn announce(&mut self, xs: &[Vec<f64>]) {
        self.inner.iter_mut().for_each(|inner| inner.announce(xs));
    }
}

impl Adjoint for JournaledOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.product(Direction::Adjoint, y, x)
    }

    fn announce_adjoint(&mut self, ys: &[Vec<f64>]) {
        self.inner.iter_mut().for_each(|inner| inner.announce_adjoint(ys));
    }
}
