//! A journal for products. A product is written to the journal before it is used, so no product is computed twice.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::journal::{Journal, Key, Kind};
use crate::observer::Observer;
use crate::operator::{Adjoint, Direction, Operator, Product, Symmetry};

/// An operator that keeps its products in a journal. A product that is in the journal is read instead of computed. All operators of a scene
/// or matrix share a journal. The name of an operator states its part of the light and its channel.
pub struct JournaledOperator<'a> {
    journal: &'a mut Journal,
    inner: Option<&'a mut dyn Adjoint>,
    name: String,
    shape: ([usize; 2], Symmetry),
}

#[derive(Serialize, Deserialize)]
struct Note {
    operator: String,
    direction: Direction,
    /// The key of the vector that was multiplied.
    pattern: String,
}

struct Keys {
    pattern: Key,
    product: Key,
}

impl<'a> JournaledOperator<'a> {
    /// Keeps the products of `inner`. The identity of the journal must name everything else on which the products depend.
    pub fn new(journal: &'a mut Journal, name: impl Into<String>, inner: &'a mut dyn Adjoint) -> Self {
        let shape = ([inner.rows(), inner.cols()], inner.symmetry());
        Self { journal, inner: Some(inner), name: name.into(), shape }
    }

    /// Reads the journaled products of an operator of this name and shape. A product that is not in the journal is an error.
    pub fn replay(
        journal: &'a mut Journal,
        name: impl Into<String>,
        [rows, cols]: [usize; 2],
        symmetry: Symmetry,
    ) -> Self {
        Self { journal, inner: None, name: name.into(), shape: ([rows, cols], symmetry) }
    }

    /// Appends a product of the operator of this name, unless the journal has it. Fails with [`Error::Journal`].
    pub fn keep(
        journal: &'a mut Journal,
        name: impl Into<String>,
        direction: Direction,
        product: &Product,
    ) -> Result<()> {
        // Only products that are read or computed need the true shape.
        let shape = [product.to.len(), product.from.len()];
        let mut operator = Self::replay(journal, name, shape, Symmetry::General);
        let keys = operator.keys(direction, &product.from);
        // A record that is damaged counts as not written, which only reading it shows.
        if operator.journal.get(keys.product)?.is_some() {
            return Ok(());
        }
        operator.append(direction, &keys, &product.from, &product.to)
    }

    /// The undamaged products in this direction that were journaled under this name, in the order of computation.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Journal`] for a record in a form that this version does not know.
    pub fn kept(journal: &mut Journal, name: &str, direction: Direction) -> Result<Vec<Product>> {
        let misread = |journal: &Journal| {
            Error::journal(
                journal.path(),
                "the record of a product is whole, but not in a form that this version knows",
            )
            .help("open it with the version of krylux that wrote it")
        };
        let photos = journal.entries().iter().filter(|entry| entry.kind == Kind::Photo);
        let noted: Vec<(Key, Vec<u8>)> = photos.map(|entry| (entry.key, entry.metadata.clone())).collect();
        let mut products = Vec::new();
        for (key, metadata) in noted {
            let note: Note = serde_json::from_slice(&metadata).map_err(|_| misread(journal))?;
            if note.operator != name || note.direction != direction {
                continue;
            }
            let pattern = Key::from_hex(&note.pattern).ok_or_else(|| misread(journal))?;
            if let (Some(x), Some(y)) = (journal.get(pattern)?, journal.get(key)?) {
                products.push(Product { from: numbers(&x.payload), to: numbers(&y.payload) });
            }
        }
        Ok(products)
    }

    /// Reads products that are in the journal. All other products are computed in blocks of the inner operator's block size, and appended
    /// in order. If a block fails, the blocks before it are in the journal.
    fn block(&mut self, direction: Direction, from: &[&[f64]], to: &mut [&mut [f64]]) -> Result<()> {
        debug_assert_eq!(from.len(), to.len());
        let mut new: Vec<(usize, Keys)> = Vec::new();
        let mut repeated: Vec<(usize, usize)> = Vec::new();
        for (place, (from, to)) in from.iter().zip(&mut *to).enumerate() {
            let keys = self.keys(direction, from);
            if let Some((first, _)) = new.iter().find(|(_, known)| known.product == keys.product) {
                repeated.push((*first, place));
            } else if !self.read(keys.product, to)? {
                new.push((place, keys));
            }
        }
        for new in new.chunks(self.block_size().max(1)) {
            let places: Vec<usize> = new.iter().map(|(place, _)| *place).collect();
            self.take(direction, from, to, &places)?;
            for (place, keys) in new {
                self.append(direction, keys, from[*place], to[*place])?;
            }
        }
        for (first, place) in repeated {
            let product = to[first].to_vec();
            to[place].copy_from_slice(&product);
        }
        Ok(())
    }

    fn keys(&self, direction: Direction, from: &[f64]) -> Keys {
        let side: &[u8] = match direction {
            Direction::Forward => b"forward",
            Direction::Adjoint => b"adjoint",
        };
        let pattern = Journal::pattern_key(&bytes(from));
        let product = self.journal.key(&[b"product", self.name.as_bytes(), side, pattern.bytes()]);
        Keys { pattern, product }
    }

    /// Copies the product from the journal. Returns whether the journal has it.
    fn read(&mut self, key: Key, to: &mut [f64]) -> Result<bool> {
        let Some(stored) = self.journal.get(key)? else { return Ok(false) };
        if stored.payload.len() != size_of_val(to) {
            return Err(Error::dimension(
                "a product in the journal",
                format!("{} values", to.len()),
                format!("{} bytes", stored.payload.len()),
            ));
        }
        to.copy_from_slice(&numbers(&stored.payload));
        Ok(true)
    }

    /// Computes the products at the given indices as one block. The indices must ascend.
    fn take(
        &mut self,
        direction: Direction,
        from: &[&[f64]],
        to: &mut [&mut [f64]],
        places: &[usize],
    ) -> Result<()> {
        let Some(inner) = &mut self.inner else { return Err(not_journaled(self.journal, &self.name)) };
        let from: Vec<&[f64]> = places.iter().map(|&place| from[place]).collect();
        let to = to.iter_mut().enumerate().filter(|(place, _)| places.contains(place));
        let mut to: Vec<&mut [f64]> = to.map(|(_, to)| &mut **to).collect();
        inner.products(direction, &from, &mut to)
    }

    fn append(&mut self, direction: Direction, keys: &Keys, from: &[f64], to: &[f64]) -> Result<()> {
        self.journal.keep_pattern(keys.pattern, &bytes(from))?;
        let note = Note { operator: self.name.clone(), direction, pattern: keys.pattern.to_string() };
        // Strings always have a JSON form, so this cannot fail.
        let note = serde_json::to_vec(&note).unwrap_or_default();
        self.journal.append_buffered(Kind::Photo, keys.product, &note, &bytes(to))
    }
}

fn numbers(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks::<8>().0.iter().map(|value| f64::from_le_bytes(*value)).collect()
}

/// The bytes of numbers, little endian.
fn bytes(numbers: &[f64]) -> Cow<'_, [u8]> {
    if cfg!(target_endian = "little") {
        Cow::Borrowed(bytemuck::cast_slice(numbers))
    } else {
        Cow::Owned(numbers.iter().flat_map(|value| value.to_le_bytes()).collect())
    }
}

fn not_journaled(journal: &Journal, name: &str) -> Error {
    let folder = journal.path().parent().and_then(|journal| journal.parent()).unwrap_or(journal.path());
    Error::not_taken(
        journal.path(),
        format!("a photo ({name}) is not among its {}, and there is no scene", journal.photos()),
    )
    .help(format!("give the scene: krylux VERB SCENE --resume -o {}", folder.display()))
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

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.block(Direction::Forward, xs, ys)
    }

    fn block_size(&self) -> usize {
        self.inner.as_ref().map_or(1, |inner| inner.block_size())
    }

    fn observer(&self) -> &dyn Observer {
        match &self.inner {
            Some(inner) => inner.observer(),
            None => &(),
        }
    }
}

impl Adjoint for JournaledOperator<'_> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.block(Direction::Adjoint, ys, xs)
    }
}
