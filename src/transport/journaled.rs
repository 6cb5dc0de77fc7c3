//! Products that are on disk before they are used, and that are never taken twice.

use std::cell::RefCell;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::journal::{Journal, Key, Kind};
use crate::operator::{Adjoint, Operator, Symmetry};

/// An operator whose products are kept in a journal; those that are there already are handed out without it. Operators of one
/// source share a journal, each by its name: which part of the light, and which channel.
pub struct JournaledOperator<'a> {
    journal: &'a RefCell<Journal>,
    inner: Option<Box<dyn Adjoint + 'a>>,
    name: String,
    shape: Shape,
}

/// What is known of an operator without taking a product.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Shape {
    rows: usize,
    cols: usize,
    symmetric: bool,
}

/// What stands beside a product.
#[derive(Serialize)]
struct Note<'a> {
    operator: &'a str,
    direction: Direction,
    /// The key of what was multiplied.
    pattern: String,
}

#[derive(Clone, Copy, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Direction {
    Forward,
    Adjoint,
}

impl<'a> JournaledOperator<'a> {
    /// Keeps the products of `inner`, whose journal's identity must say all that they depend on besides `name`.
    ///
    /// # Errors
    /// [`Error::Journal`].
    pub fn new(
        journal: &'a RefCell<Journal>,
        name: impl Into<String>,
        inner: Box<dyn Adjoint + 'a>,
    ) -> Result<Self> {
        let symmetric = inner.symmetry() == Symmetry::Symmetric;
        let shape = Shape { rows: inner.rows(), cols: inner.cols(), symmetric };
        let name = name.into();
        // Integers always have a JSON form.
        let encoded = serde_json::to_vec(&shape).unwrap_or_default();
        journal.borrow_mut().note(&shape_of(&name), &encoded)?;
        Ok(Self { journal, inner: Some(inner), name, shape })
    }

    /// Hands out what was kept under this name, and nothing else.
    ///
    /// # Errors
    /// [`Error::Journal`] when there is nothing.
    pub fn replay(journal: &'a RefCell<Journal>, name: impl Into<String>) -> Result<Self> {
        let name = name.into();
        let note = journal.borrow_mut().read_note(&shape_of(&name))?;
        let shape = note.and_then(|note| serde_json::from_slice(&note).ok());
        let shape = shape.ok_or_else(|| missing(&journal.borrow(), &name))?;
        Ok(Self { journal, inner: None, name, shape })
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
        let note = Note { operator: &self.name, direction, pattern };
        let photo: Vec<u8> = to.iter().flat_map(|value| value.to_le_bytes()).collect();
        // As above.
        journal.append(Kind::Photo, key, &serde_json::to_vec(&note).unwrap_or_default(), &photo)
    }
}

fn shape_of(name: &str) -> String {
    format!("shape of {name}")
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
        self.shape.rows
    }

    fn cols(&self) -> usize {
        self.shape.cols
    }

    fn symmetry(&self) -> Symmetry {
        if self.shape.symmetric { Symmetry::Symmetric } else { Symmetry::General }
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.product(Direction::Forward, x, y)
    }
}

impl Adjoint for JournaledOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.product(Direction::Adjoint, y, x)
    }
}
