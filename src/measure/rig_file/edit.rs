//! The one change that the program makes to a rig file: it names the calibration. All else stays as its author wrote it.

use std::path::{Path, PathBuf};

use toml_edit::{DocumentMut, Item, value};

use super::RigFile;
use crate::error::{Error, Result};
use crate::file;
use crate::io::atomic;

impl RigFile {
    /// Writes into the rig file that `folder` holds its calibration, and returns the new content. Comments and the order of keys stay.
    /// A folder below that of the rig file is named relative to it.
    ///
    /// # Errors
    /// Those of [`Self::load`]; [`Error::Write`].
    pub fn name_calibration(&self, folder: &Path) -> Result<Self> {
        let bytes = file::read(&self.path)?;
        // What the user changed in the meantime must be as valid as what was read before.
        Self::from_bytes(&self.path, &bytes)?;
        let named = named_in(&String::from_utf8_lossy(&bytes), &relative(&self.path, folder)?);
        let named = named.map_err(|fault| Error::Data {
            path: self.path.clone(),
            fault: fault.to_string(),
            help: "write the line `calibration = …` into the file yourself".into(),
        })?;
        let file = Self::from_bytes(&self.path, named.as_bytes())?;
        atomic::write_bytes(&self.path, named.as_bytes())?;
        Ok(file)
    }
}

/// The text of a rig file with this calibration.
fn named_in(text: &str, calibration: &str) -> std::result::Result<String, toml_edit::TomlError> {
    let mut document: DocumentMut = text.parse()?;
    match document.get_mut("calibration").and_then(Item::as_value_mut) {
        Some(earlier) => {
            // The comment behind the value is part of its decoration.
            let decoration = earlier.decor().clone();
            *earlier = calibration.into();
            *earlier.decor_mut() = decoration;
        }
        None => {
            document.insert("calibration", value(calibration));
        }
    }
    Ok(document.to_string())
}

/// How the rig file at `path` names a folder.
fn relative(path: &Path, folder: &Path) -> Result<String> {
    let real = |path: &Path| std::fs::canonicalize(path).map_err(Error::reading(path));
    let folder = real(folder)?;
    let home = real(path)?.parent().map_or_else(PathBuf::new, Path::to_path_buf);
    let name = folder.strip_prefix(&home).unwrap_or(&folder);
    name.to_str().map(str::to_owned).ok_or_else(|| Error::Data {
        path: folder.clone(),
        fault: "its name is not UTF-8 text, as that of a file in TOML must be".into(),
        help: "rename the folder".into(),
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{named_in, relative};

    #[test]
    fn all_but_the_calibration_stays_as_it_was() {
        let text = "# my rig\nkind = \"virtual\"\nseed = 1   # chance\n\n[scene]   # lit\nfile = \"a.glb\"\n";
        let named = named_in(text, "my-calibration").expect("it is TOML");
        let expected = "seed = 1   # chance\ncalibration = \"my-calibration\"\n\n[scene]";
        assert!(named.contains(expected), "{named}");
        assert_eq!(named.replace("calibration = \"my-calibration\"\n", ""), text);
        let again = named_in(&named.replace("n\"\n", "n\" # of May\n"), "of-june").expect("it is TOML");
        assert_eq!(again.matches("calibration").count(), 1, "{again}");
        assert!(again.contains("calibration = \"of-june\" # of May\n"), "{again}");
    }

    #[test]
    fn folders_beside_the_file_are_named_relative_to_it() {
        let home = tempfile::tempdir().expect("a temporary folder can be made");
        let other = tempfile::tempdir().expect("a temporary folder can be made");
        let file = home.path().join("rig.toml");
        std::fs::write(&file, "").expect("it can be written");
        let beside = home.path().join("rig-calibration");
        std::fs::create_dir(&beside).expect("it can be made");
        let named = |folder: &Path| relative(&file, folder).expect("it is there");
        assert_eq!(named(&beside), "rig-calibration");
        let real = other.path().canonicalize().expect("it is there");
        assert_eq!(Path::new(&named(other.path())), real);
    }
}
