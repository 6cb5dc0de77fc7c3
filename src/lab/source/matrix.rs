//! A matrix as a source, from files or from a program.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::file;
use crate::image::{Image, LUMINANCE, Resolution};
use crate::io::manifest;
use crate::io::sparse::{self, MatrixFile, ProductNoise};
use crate::lab::settings::{ChannelChoice, Settings};
use crate::measure::RunManifest;
use crate::operator::{Operator, product};
use crate::sparse::{Csr, SparseOperator};
use crate::transport::Part;

/// A matrix of any shape, in one or three channels.
pub(in crate::lab) struct MatrixSource {
    matrix: MatrixFile,
    pub(in crate::lab) name: String,
    /// The file, with the BLAKE3 hash of its bytes.
    file: Option<(PathBuf, String)>,
}

impl MatrixSource {
    /// Reads a matrix as [`sparse::read_file`] does. The settings may give the sizes of its pictures.
    pub(in crate::lab) fn open(path: &Path, settings: &Settings) -> Result<Self> {
        let matrix = sparse::read_file(path)?;
        let mut hash = blake3::Hasher::new();
        for file in sparse::files_of(path) {
            hash.update(&file::read(&file)?);
        }
        let source = Self::new(matrix, path, settings)?;
        Ok(Self { file: Some((path.to_path_buf(), hash.finalize().to_hex().to_string())), ..source })
    }

    /// A matrix of a program. The last component of `name`, without its extension, is used in titles.
    pub(in crate::lab) fn new(matrix: MatrixFile, name: &Path, settings: &Settings) -> Result<Self> {
        let mut matrix = matrix.sized(name, settings.trace.resolution, settings.trace.projector)?;
        match (settings.channels, matrix.channels.len()) {
            (ChannelChoice::Rgb, 1) => {
                return Err(Error::option("--channels", format!("{} is gray", name.display()))
                    .help("leave it out, or give a matrix in colour"));
            }
            (ChannelChoice::Luma, 3) => {
                matrix.channels = gray(&matrix.channels)?;
                matrix.direct = gray(&matrix.direct)?;
                matrix.noise = None;
            }
            _ => {}
        }
        let short = sparse::stem(name);
        Ok(Self { matrix, name: short, file: None })
    }

    pub(in crate::lab) fn describe(&self, manifest: &mut RunManifest) {
        manifest.scene = self
            .file
            .as_ref()
            .map(|(path, hash)| manifest::SourceFile { path: path.into(), hash: hash.clone() });
    }

    pub(in crate::lab) fn channels(&self) -> usize {
        self.matrix.channels.len()
    }

    /// Whether it is known which pictures rows and columns are.
    pub(in crate::lab) fn has_pictures(&self) -> bool {
        self.matrix.pictures.is_some()
    }

    /// The direct light of each channel, if it is held separately and is a diagonal.
    pub(in crate::lab) fn direct_diagonal(&self) -> Option<Vec<Vec<f64>>> {
        let is_diagonal = |matrix: &Csr| matrix.entries().all(|(row, column, _)| row == column);
        let is_known = self.has_direct() && self.matrix.direct.iter().all(is_diagonal);
        is_known.then(|| self.matrix.direct.iter().map(Csr::diagonal).collect())
    }

    /// Whether the direct light is held separately.
    pub(in crate::lab) fn has_direct(&self) -> bool {
        !self.matrix.direct.is_empty()
    }

    /// The size of photos. It is the number of rows × 1 if it is not known.
    pub(in crate::lab) fn resolution(&self) -> Resolution {
        let rows = self.matrix.shape()[0];
        self.matrix.pictures.map_or(Resolution::new(rows, 1), |pictures| pictures.camera)
    }

    /// The size of patterns, as [`Self::resolution`].
    pub(in crate::lab) fn projector_resolution(&self) -> Resolution {
        let columns = self.matrix.shape()[1];
        self.matrix.pictures.map_or(Resolution::new(columns, 1), |pictures| pictures.projector)
    }

    /// One part of a channel. If the file does not hold the direct light separately, it is the diagonal, as for a coaxial rig. Fails if it
    /// cannot be the diagonal, because photos and patterns have different sizes.
    pub(in crate::lab) fn part(&self, part: Part, channel: usize) -> Result<Csr> {
        let whole = &self.matrix.channels[channel];
        if part == Part::Full {
            return Ok(whole.clone());
        }
        let direct = match self.matrix.direct.get(channel) {
            Some(direct) => direct.clone(),
            None if self.resolution() == self.projector_resolution() => whole.only_diagonal()?,
            None => {
                let fault = format!(
                    "{} does not hold its direct light separately, and that is no diagonal for photos of {} and patterns of {}",
                    self.name,
                    self.resolution(),
                    self.projector_resolution()
                );
                return Err(Error::option("--part", fault)
                    .help("use the full matrix, or a file that krylux matrix wrote"));
            }
        };
        match part {
            Part::Direct => Ok(direct),
            _ => Csr::sum(&[(1.0, whole), (-1.0, &direct)]),
        }
    }
}

/// The luminance of three channels; empty if there are none.
fn gray(channels: &[Csr]) -> Result<Vec<Csr>> {
    let terms: Vec<(f64, &Csr)> = LUMINANCE.into_iter().zip(channels).collect();
    if terms.is_empty() { Ok(Vec::new()) } else { Ok(vec![Csr::sum(&terms)?]) }
}

/// The operators of a matrix, `[channel]` for each part. Each is made when it is first requested.
pub(in crate::lab) struct ExplicitParts {
    source: MatrixSource,
    operators: [Vec<Option<SparseOperator>>; 3],
}

impl ExplicitParts {
    pub(in crate::lab) fn new(source: &MatrixSource) -> Self {
        let MatrixSource { matrix, name, .. } = source;
        let source = MatrixSource { matrix: matrix.clone(), name: name.clone(), file: None };
        let none = || (0..matrix.channels.len()).map(|_| None).collect();
        Self { source, operators: [none(), none(), none()] }
    }

    pub(in crate::lab) fn noise(&self) -> Option<ProductNoise> {
        self.source.matrix.noise
    }

    pub(in crate::lab) fn operator(&mut self, part: Part, channel: usize) -> Result<&mut SparseOperator> {
        let slot = &mut self.operators[part as usize][channel];
        let made = match slot.take() {
            Some(made) => made,
            None => SparseOperator::new(self.source.part(part, channel)?),
        };
        Ok(slot.insert(made))
    }

    pub(in crate::lab) fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        let (size, channels) = (self.source.resolution(), self.source.channels());
        let photo = |channel| {
            let operator = self.operator(Part::Full, channel)?;
            let x = pattern.plane(if pattern.channels() == 1 { 0 } else { channel });
            Error::check_size("pixels of the pattern", operator.cols(), x.len())?;
            product(operator, &x)
        };
        let planes: Vec<Vec<f64>> = (0..channels).map(photo).collect::<Result<_>>()?;
        Image::from_planes(size, &planes)
    }
}
