//! Saved factorizations, in the format that [`Factorization::save`] describes.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::path::PathBuf;

use super::place::Host;
use super::{Factorization, ProcessKind};
use crate::error::{Error, Result};
use crate::krylov::basis::Basis;

const MAGIC: &[u8; 8] = b"KRYLUXFZ";
const VERSION: u32 = 3;
/// The previous version of the format. It has no late parts.
const EARLIER: u32 = 2;
/// The number of floats written or read at once.
const CHUNK: usize = 8192;

impl Factorization {
    /// Saves the state. The process that [`Factorization::load`] returns continues with bitwise equal results.
    ///
    /// All processes use the same format. Numbers are little endian, floats IEEE 754 binary64:
    ///
    /// | bytes | content |
    /// |---|---|
    /// | 8 | `KRYLUXFZ` |
    /// | u32 | version, 3 |
    /// | u32 | kind: 1 Lanczos, 2 block Lanczos, 3 Arnoldi |
    /// | u64 × 7 | `n`, known vectors `k`, block size, columns `k + m + p`, steps `m`, products, random vectors drawn |
    /// | f64 × 2 | the largest `‖A v_j‖`; a bound on the part that restarts discarded |
    /// | `m` times | u64 count, as many f64: the coefficients of `A v_j` on `Q, v_1, …`; f64: the standard error of `A v_j` |
    /// | u64 count, as many f64 | the parts that the last column still has along the columns before it (not in version 2) |
    /// | `(k + m + p) n` f64 | `Q`, then `v_1 … v_{m+p}`, one after the other |
    /// | 32 | BLAKE3 hash of all preceding bytes |
    ///
    /// A file is accepted only if its checksum is right. A damaged length causes no large allocation.
    ///
    /// # Errors
    /// [`Error::Write`] if the writer fails.
    pub fn save(&self, writer: impl Write) -> Result<()> {
        let mut sink = Sink { writer, hasher: blake3::Hasher::new() };
        sink.everything(self).map_err(Error::writing(name()))
    }

    /// Loads the state of a process of this kind that [`Factorization::save`] saved.
    ///
    /// # Errors
    /// [`Error::Data`] if the state is damaged, has another version, or belongs to another kind of process.
    pub fn load(kind: ProcessKind, reader: impl Read) -> Result<Self> {
        let mut source = Source { reader, hasher: blake3::Hasher::new() };
        let state = source.everything(kind)?;
        let computed = *source.hasher.finalize().as_bytes();
        let mut stored = [0; 32];
        source.bytes(&mut stored)?;
        if computed != stored {
            return Err(damaged("the checksum does not fit"));
        }
        Ok(state)
    }
}

struct Sink<W> {
    writer: W,
    hasher: blake3::Hasher,
}

impl<W: Write> Sink<W> {
    fn everything(&mut self, state: &Factorization) -> std::io::Result<()> {
        self.bytes(MAGIC)?;
        self.bytes(&VERSION.to_le_bytes())?;
        self.bytes(&(state.kind as u32).to_le_bytes())?;
        for count in [state.n(), state.known, state.block, state.total(), state.steps(), state.products] {
            self.bytes(&(count as u64).to_le_bytes())?;
        }
        self.bytes(&state.draws.to_le_bytes())?;
        self.floats(&[state.scale, state.leak])?;
        for (column, error) in state.columns.iter().zip(&state.errors) {
            self.bytes(&(column.len() as u64).to_le_bytes())?;
            self.floats(column)?;
            self.floats(&[*error])?;
        }
        self.bytes(&(state.late.len() as u64).to_le_bytes())?;
        self.floats(&state.late)?;
        for column in state.host.basis.columns() {
            self.floats(column)?;
        }
        let checksum = *self.hasher.finalize().as_bytes();
        self.bytes(&checksum)?;
        self.writer.flush()
    }

    fn bytes(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.hasher.update(bytes);
        self.writer.write_all(bytes)
    }

    fn floats(&mut self, floats: &[f64]) -> std::io::Result<()> {
        let mut buffer = Vec::with_capacity(8 * CHUNK.min(floats.len()));
        for chunk in floats.chunks(CHUNK) {
            buffer.clear();
            buffer.extend(chunk.iter().flat_map(|value| value.to_le_bytes()));
            self.bytes(&buffer)?;
        }
        Ok(())
    }
}

struct Source<R> {
    reader: R,
    hasher: blake3::Hasher,
}

impl<R: Read> Source<R> {
    fn everything(&mut self, kind: ProcessKind) -> Result<Factorization> {
        let mut magic = [0; 8];
        self.bytes(&mut magic)?;
        if &magic != MAGIC {
            return Err(damaged("the file does not begin like a saved factorization"));
        }
        let version = self.u32()?;
        if version != VERSION && version != EARLIER {
            let fault = format!("version {version}; this program reads versions {EARLIER} and {VERSION}");
            return Err(damaged(&fault));
        }
        let found = self.u32()?;
        if found != kind as u32 {
            return Err(damaged(&format!("kind {found} was saved; {kind:?} is kind {}", kind as u32)));
        }
        let mut counts = [0; 6];
        for count in &mut counts {
            *count = usize::try_from(self.u64()?).map_err(|_| damaged("a count is beyond all memory"))?;
        }
        let [n, known, block, total, steps, products] = counts;
        let draws = self.u64()?;
        let fits = (1..=n).contains(&total) && (1..=n).contains(&block);
        if !fits || known.checked_add(steps).is_none_or(|used| used > total) {
            return Err(damaged("the counts contradict each other"));
        }
        let (scale, leak) = (self.float()?, self.float()?);
        let (mut columns, mut errors) = (Vec::new(), Vec::new());
        for step in 0..steps {
            let length = self.u64()?;
            if length > total as u64 || length <= (known + step) as u64 {
                return Err(damaged("the counts contradict each other"));
            }
            columns.push(self.floats(length as usize)?);
            errors.push(self.float()?);
        }
        let late = if version == EARLIER { Vec::new() } else { self.late(known + steps, total)? };
        let mut basis = Basis::new(n);
        for _ in 0..total {
            basis.push_scaled(&self.floats(n)?, 1.0);
        }
        Ok(Factorization {
            kind,
            host: Host { basis, work: vec![0.0; n] },
            known,
            pending: total - known - steps,
            block,
            columns,
            errors,
            leak,
            products,
            scale,
            draws,
            late,
            ready: VecDeque::new(),
            filter: None,
        })
    }

    /// Reads the late parts of the last of `total` columns. The columns after the first `used` wait for their products.
    fn late(&mut self, used: usize, total: usize) -> Result<Vec<f64>> {
        let length = self.u64()?;
        if length != 0 && (length != total as u64 - 1 || used == total) {
            return Err(damaged("the counts contradict each other"));
        }
        self.floats(length as usize)
    }

    fn bytes(&mut self, bytes: &mut [u8]) -> Result<()> {
        self.reader.read_exact(bytes).map_err(|error| match error.kind() {
            std::io::ErrorKind::UnexpectedEof => damaged("it ends too early"),
            _ => Error::reading(name())(error),
        })?;
        self.hasher.update(bytes);
        Ok(())
    }

    fn u32(&mut self) -> Result<u32> {
        let mut bytes = [0; 4];
        self.bytes(&mut bytes)?;
        Ok(u32::from_le_bytes(bytes))
    }

    fn u64(&mut self) -> Result<u64> {
        let mut bytes = [0; 8];
        self.bytes(&mut bytes)?;
        Ok(u64::from_le_bytes(bytes))
    }

    fn float(&mut self) -> Result<f64> {
        self.u64().map(f64::from_bits)
    }

    /// Reads in pieces, so that a file with a damaged length ends before the memory is exhausted.
    fn floats(&mut self, count: usize) -> Result<Vec<f64>> {
        let mut floats = Vec::with_capacity(count.min(CHUNK));
        let mut buffer = vec![0; 8 * CHUNK.min(count)];
        while floats.len() < count {
            let bytes = &mut buffer[..8 * CHUNK.min(count - floats.len())];
            self.bytes(bytes)?;
            floats.extend(bytes.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)));
        }
        Ok(floats)
    }
}

fn name() -> PathBuf {
    PathBuf::from("saved factorization")
}

fn damaged(fault: &str) -> Error {
    Error::data(name(), fault).help("give a file that the same method saved, undamaged; or start anew")
}
