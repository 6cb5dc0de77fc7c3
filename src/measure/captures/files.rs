//! The numbered files of a folder of captures.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::raw::{self, Converter};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::io::npy;

/// A stack of pictures: numbered files, or the slices of one array.
pub(super) struct Stack {
    /// The kind of pictures: `patterns` or `photos`.
    what: &'static str,
    place: PathBuf,
    files: Option<BTreeMap<u64, PathBuf>>,
    slices: Vec<Image>,
}

impl Stack {
    /// Finds the files that `name` means in `folder`. In a name, `*` stands for the number.
    ///
    /// # Errors
    /// [`Error::Data`] if there are none, if a name has no number where the star is, or if two names have one number.
    pub(super) fn find(folder: &Path, name: &str, what: &'static str) -> Result<Self> {
        let place = folder.join(name);
        let Some((before, after)) = name.split_once('*') else {
            if place.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy")) {
                return Ok(Self { what, slices: slices(&place)?, place, files: None });
            }
            return Err(Error::data(&place, format!("{what} need a number in their names")).help(
                "write * where the number is, as in \"photos/*.png\", or give one .npy file of N×H×W",
            ));
        };
        let (below, before) = before.rsplit_once('/').unwrap_or(("", before));
        if after.contains(['*', '/']) {
            return Err(Error::data(&place, "only the name of a file has a number")
                .help("write one * and no / after it, as in \"photos/take-1/*.png\""));
        }
        let directory = folder.join(below);
        let entries = std::fs::read_dir(&directory).map_err(Error::reading(&directory))?;
        let mut files = BTreeMap::new();
        for entry in entries {
            let path = entry.map_err(Error::reading(&directory))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let number = name.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
            let Some(number) = number.filter(|number| !number.is_empty()) else { continue };
            let Ok(number) = number.parse::<u64>() else {
                return Err(Error::data(&path, format!("`{number}` in its name is not a number"))
                    .help(format!("name {what} {before}NUMBER{after}, or keep other files elsewhere")));
            };
            if let Some(other) = files.insert(number, path.clone()) {
                return Err(Error::data(&path, format!("it has the number {number}, as {} has", other.display()))
                    .help("remove one of them; repeated takes are a list: files = [\"take-1/*.png\", \"take-2/*.png\"]"));
            }
        }
        if files.is_empty() {
            return Err(Error::data(&place, format!("there are no {what} of this name"))
                .help("compare the name in captures.toml with the files; * stands for the number"));
        }
        Ok(Self { what, place, files: Some(files), slices: Vec::new() })
    }

    /// The number of pictures.
    pub(super) fn len(&self) -> usize {
        self.files.as_ref().map_or(self.slices.len(), BTreeMap::len)
    }

    /// The path of a picture, for messages.
    pub(super) fn path(&self, at: usize) -> PathBuf {
        let file = self.files.as_ref().and_then(|files| files.values().nth(at));
        file.unwrap_or(&self.place).clone()
    }

    /// Checks that this stack has a picture for each of `other`, by number if both have numbers.
    ///
    /// # Errors
    /// [`Error::Data`] naming the first file whose partner is missing.
    pub(super) fn match_with(&self, other: &Self) -> Result<()> {
        let (Some(own), Some(others)) = (&self.files, &other.files) else {
            return self.require(other.len(), &format!("there are {} {}", other.len(), other.what));
        };
        for ([a, b], [wanted, found]) in [([own, others], [self, other]), ([others, own], [other, self])] {
            if let Some((number, path)) = b.iter().find(|(number, _)| !a.contains_key(number)) {
                let fault = format!(
                    "there is no file of number {number} among {} ({})",
                    wanted.what,
                    wanted.place.display()
                );
                return Err(Error::data(path, fault).help(format!(
                    "add it, or remove this one; {} and {} of one number belong together",
                    wanted.what, found.what
                )));
            }
        }
        Ok(())
    }

    /// Checks the number of pictures. `because` is a clause with the reason.
    pub(super) fn require(&self, count: usize, because: &str) -> Result<()> {
        if self.len() == count {
            return Ok(());
        }
        Err(Error::data(&self.place, format!("there are {} {}, but {because}", self.len(), self.what))
            .help("one photo belongs to each pattern, in the same order"))
    }

    /// Reads a picture: its levels, and the highest level that the format can hold.
    pub(super) fn read(&self, at: usize, converter: Option<Converter>) -> Result<(Image, Option<f32>)> {
        match self.slices.get(at) {
            Some(image) => Ok((image.clone(), None)),
            None => raw::read(&self.path(at), converter),
        }
    }
}

/// The pictures of an array of `N×H×W` or `N×H×W×3`.
fn slices(path: &Path) -> Result<Vec<Image>> {
    let array = npy::read_npy(path)?;
    let (count, height, width, channels) = match *array.shape.as_slice() {
        [count, height, width] => (count, height, width, 1),
        [count, height, width, channels @ (1 | 3)] => (count, height, width, channels),
        _ => {
            let shape = array.shape.iter().map(usize::to_string).collect::<Vec<_>>().join("×");
            return Err(Error::data(path, format!("its shape is {shape}"))
                .help("give an array of N×H×W or N×H×W×3, one picture after another"));
        }
    };
    let length = height * width * channels;
    if length == 0 || count == 0 {
        return Err(Error::data(path, "it is empty").help("give an array of N×H×W"));
    }
    if let Some(at) = array.values.iter().position(|value| !value.is_finite()) {
        let fault = format!("a value of picture {} is {}", at / length, array.values[at]);
        return Err(Error::data(path, fault).help("replace NaN and infinite values by finite ones"));
    }
    let size = Resolution::new(width, height);
    let pictures = array.values.chunks_exact(length);
    pictures.map(|of| Image::new(size, channels, of.iter().map(|&value| value as f32).collect())).collect()
}
