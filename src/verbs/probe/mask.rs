//! `--mask`: which pairs of a camera pixel and a projector pixel let their light through.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::analysis::probe::Mask;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::io::sparse;
use crate::lab::{GivenArray, Lab};
use crate::sparse::Csr;

/// A mask by name, by a file, or by its weights.
#[derive(Clone, Debug, PartialEq)]
pub enum MaskChoice {
    /// Light from the projector row of the camera pixel's home, the projector pixel that lights it directly.
    Row,
    /// Light from the home's column.
    Column,
    /// Light from the camera pixel's epipolar line.
    Epipolar,
    /// Light from the columns that are at least the first and at most the second number to the right of the home.
    Band([i32; 2]),
    /// Light from farther than so many pixels from the home.
    Beyond(f64),
    /// The weights of a matrix file: a row for each camera pixel, and a column for each projector pixel.
    File(PathBuf),
    /// The weights that a program gives. The record of a run does not contain them.
    Given(Mask),
}

impl FromStr for MaskChoice {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (name, argument) = text.split_once(':').unwrap_or((text, ""));
        match name {
            "row" | "column" | "epipolar" if !argument.is_empty() => Err(format!("`{name}` takes no argument")),
            "row" => Ok(Self::Row),
            "column" => Ok(Self::Column),
            "epipolar" => Ok(Self::Epipolar),
            "band" => argument
                .split_once(',')
                .and_then(|(a, b)| Some([a.trim().parse().ok()?, b.trim().parse().ok()?]))
                .filter(|[first, last]| first <= last && *last < i32::MAX)
                .map(Self::Band)
                .ok_or_else(|| format!("`{text}` needs its first and last column, e.g. band:-2,8")),
            "beyond" => argument
                .parse()
                .ok()
                .filter(|distance| (0.0..=4096.0).contains(distance))
                .map(Self::Beyond)
                .ok_or_else(|| format!("`{text}` needs a distance from 0 to 4096 pixels, e.g. beyond:8")),
            _ if sparse::is_matrix(Path::new(text)) => Ok(Self::File(text.into())),
            _ => Err("expected row, column, epipolar, band:A,B, beyond:N, or a matrix file (.npz, .npy, .mtx, .mat)".into()),
        }
    }
}

/// Writes a mask in the syntax of the command line.
impl std::fmt::Display for MaskChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Row => f.write_str("row"),
            Self::Column => f.write_str("column"),
            Self::Epipolar => f.write_str("epipolar"),
            Self::Band([first, last]) => write!(f, "band:{first},{last}"),
            Self::Beyond(distance) => write!(f, "beyond:{distance}"),
            Self::File(path) => path.display().fmt(f),
            Self::Given(_) => f.write_str("given"),
        }
    }
}

impl Serialize for MaskChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        match self {
            Self::Given(_) => serializer.serialize_none(),
            _ => serializer.collect_str(self),
        }
    }
}

impl<'de> Deserialize<'de> for MaskChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

impl MaskChoice {
    /// Checks the mask before anything is traced. Fails as [`Self::mask`].
    pub(super) fn check_on(&self, lab: &Lab) -> Result<()> {
        match self {
            Self::Epipolar => lab.epipolar_lines_of_poses().map(drop),
            _ => self.given(lab).map(drop),
        }
    }

    /// The mask for the pictures of a laboratory.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--mask` for weights of another size, or if the source has no epipolar lines; the errors of reading a file,
    /// and those of tracing.
    pub(super) fn mask(&self, lab: &mut Lab) -> Result<Mask> {
        if let Some(mask) = self.given(lab)? {
            return Ok(mask);
        }
        if *self == Self::Epipolar {
            let [camera, projector] = lab.epipolar_lines()?;
            return Mask::lines(&camera, &projector);
        }
        let size = lab.projector_resolution();
        let homes = lab.homes()?;
        let homes = homes.as_deref();
        match *self {
            Self::Column => Mask::column(size, homes),
            Self::Band(columns) => Mask::band(size, homes, columns),
            Self::Beyond(distance) => Mask::beyond(size, homes, distance),
            _ => Mask::row(size, homes),
        }
    }

    /// The mask of a file or a program.
    fn given(&self, lab: &Lab) -> Result<Option<Mask>> {
        let mask = match self {
            Self::File(path) => Mask::given(&sparse::read(path)?)?,
            Self::Given(mask) => mask.clone(),
            _ => return Ok(None),
        };
        let [rows, columns] = mask.shape();
        let wanted = [lab.resolution(), lab.projector_resolution()];
        if [rows, columns] == wanted.map(Resolution::pixels) {
            return Ok(Some(mask));
        }
        let fault = format!("{self} has {rows} rows and {columns} columns");
        Err(Error::option("--mask", fault).help(format!(
            "give a row for each of the {} camera pixels and a column for each of the {} projector pixels",
            wanted[0], wanted[1]
        )))
    }

    /// The mask of given arrays: `masks` (`K×m`) and `patterns` (`K×n`), or a sparse matrix in compressed rows by its `data`, `indices`,
    /// `indptr` and `shape`.
    pub(super) fn of_arrays(given: Vec<GivenArray>) -> Result<Self> {
        let find = |name: &str| given.iter().find(|array| array.name == name);
        let whole = |array: &GivenArray| array.values.iter().map(|&value| value as usize).collect::<Vec<_>>();
        let malformed = || {
            Error::option("--mask", "its arrays are not those of a mask")
                .help("give a sparse matrix, or a pair of arrays of K×m masks and K×n patterns")
        };
        if let (Some(masks), Some(patterns)) = (find("masks"), find("patterns")) {
            let rows = |array: &GivenArray| match *array.shape {
                [_, length] if length > 0 => {
                    Ok(array.values.chunks(length).map(<[f64]>::to_vec).collect::<Vec<_>>())
                }
                _ => Err(malformed()),
            };
            return Ok(Self::Given(Mask::pairs(&rows(masks)?, rows(patterns)?)?));
        }
        let (Some(data), Some(indices), Some(starts), Some(shape)) =
            (find("data"), find("indices"), find("indptr"), find("shape"))
        else {
            return Err(malformed());
        };
        let columns = *whole(shape).last().ok_or_else(malformed)?;
        let indices = whole(indices).into_iter().map(|index| index as u32).collect();
        Ok(Self::Given(Mask::given(&Csr::new(columns, whole(starts), indices, data.values.clone())?)?))
    }
}
