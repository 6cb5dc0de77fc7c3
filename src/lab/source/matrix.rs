//! A matrix as a source, from a file or from a program.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::file;
use crate::image::{Image, Resolution};
use crate::io::{manifest, sparse};
use crate::measure::RunManifest;
use crate::operator::Operator;
use crate::sparse::{Csr, SparseOperator};
use crate::transport::{ExplicitMatrix, Part};

/// A matrix of any shape. The diagonal of a square matrix is the direct light, as for a coaxial rig.
pub(in crate::lab) struct MatrixSource {
    pub(in crate::lab) matrix: Csr,
    pub(in crate::lab) name: String,
    /// The file, with the BLAKE3 hash of its bytes.
    file: Option<(PathBuf, String)>,
}

impl MatrixSource {
    /// Reads `.npz` (SciPy), `.mtx` (Matrix Market) or a dense `.npy`.
    pub(in crate::lab) fn open(path: &Path) -> Result<Self> {
        let matrix = sparse::read(path)?;
        let bytes = file::read(path)?;
        let hash = blake3::hash(&bytes).to_hex().to_string();
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { matrix, name, file: Some((path.to_path_buf(), hash)) })
    }

    pub(in crate::lab) fn new(matrix: Csr, name: String) -> Self {
        Self { matrix, name, file: None }
    }

    pub(in crate::lab) fn describe(&self, manifest: &mut RunManifest) {
        manifest.scene = self
            .file
            .as_ref()
            .map(|(path, hash)| manifest::SourceFile { path: path.into(), hash: hash.clone() });
    }
}

/// An explicit matrix with its parts, each made when it is first requested.
pub(in crate::lab) struct ExplicitParts {
    pub(in crate::lab) full: SparseOperator,
    parts: [Option<SparseOperator>; 2],
}

impl ExplicitParts {
    pub(in crate::lab) fn new(matrix: Csr) -> Self {
        Self { full: SparseOperator::new(matrix), parts: [None, None] }
    }

    pub(in crate::lab) fn operator(&mut self, part: Part) -> Result<&mut SparseOperator> {
        let slot = match part {
            Part::Full => return Ok(&mut self.full),
            Part::Direct => 0,
            Part::Global => 1,
        };
        let matrix = self.full.matrix();
        if matrix.rows() != matrix.cols() {
            return Err(Error::option(
                "--part",
                "the direct light of a matrix is its diagonal, but this matrix is not square",
            )
            .help("use the full matrix"));
        }
        let made = match self.parts[slot].take() {
            Some(made) => made,
            None => SparseOperator::new(ExplicitMatrix::part_of(matrix, part)?),
        };
        Ok(self.parts[slot].insert(made))
    }

    pub(in crate::lab) fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        let resolution = Resolution::new(self.full.rows(), 1);
        let x = pattern.plane(0);
        Error::check_size("pixels of the pattern", self.full.cols(), x.len())?;
        let mut y = vec![0.0; self.full.rows()];
        self.full.apply(&x, &mut y)?;
        Image::from_planes(resolution, &[y])
    }
}
