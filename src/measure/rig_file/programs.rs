//! Programs that a rig file names, and the line that krylux itself writes into a rig file. The author of the file chooses the programs, so
//! a stranger's file runs nothing without permission.

use std::path::{Path, PathBuf};

use toml_edit::{DocumentMut, Item, value};

use crate::error::{Error, Result};
use crate::file;
use crate::io::atomic;
use crate::measure::rig_file::{RigFile, RigKind};
use crate::rig::{CameraSpec, Gphoto2Spec};

impl RigFile {
    /// The programs that the file names, each with its arguments as one text. The defaults `gphoto2` and `dcraw` are not included.
    pub fn named_programs(&self) -> Vec<String> {
        let RigKind::Hardware(rig) = &self.kind else { return Vec::new() };
        let CameraSpec::Gphoto2(camera) = &rig.camera else { return Vec::new() };
        let usual = Gphoto2Spec::new(1, 1);
        let program = (camera.program != usual.program).then(|| camera.program.clone());
        let decoder = (camera.decoder != usual.decoder).then(|| camera.decoder.join(" "));
        program.into_iter().chain(decoder).collect()
    }

    /// Checks that the programs of the file may be run, because the file is in the user's own folder or because `allowed` is set.
    ///
    /// # Errors
    /// [`Error::Data`], which names the programs.
    pub fn require_programs_allowed(&self, allowed: bool) -> Result<()> {
        let programs = self.named_programs();
        if programs.is_empty() || allowed {
            return Ok(());
        }
        let objection = own_folder().map_or_else(
            || Some("neither XDG_CONFIG_HOME nor HOME names your own folder".to_owned()),
            |folder| objection(&self.path, &folder),
        );
        let Some(objection) = objection else { return Ok(()) };
        Err(Error::data(&self.path, format!(
                "it names programs, which are run only for files in a folder that nobody but you and root writes: {}; {objection}",
                programs.iter().map(|program| format!("`{program}`")).collect::<Vec<_>>().join(" and ")
            )).help("if you trust the file and these programs, add --allow-programs"))
    }
}

/// The user's own folder of rigs, `$XDG_CONFIG_HOME/krylux` or `~/.config/krylux`. It is `None` if neither variable is set.
pub fn own_folder() -> Option<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let base = absolute("XDG_CONFIG_HOME").or_else(|| Some(absolute("HOME")?.join(".config")))?;
    Some(base.join("krylux"))
}

/// The reason why somebody else may have written a file, as a clause. It is `None` if the file is below the folder once links are followed,
/// and only this user or root can write the file, the folder and all folders between them.
fn objection(path: &Path, folder: &Path) -> Option<String> {
    let outside = || Some(format!("move it into your own folder {}", folder.display()));
    let [Ok(path), Ok(real)] = [path, folder].map(std::fs::canonicalize) else { return outside() };
    if !path.starts_with(&real) {
        return outside();
    }
    path.ancestors().take_while(|part| part.starts_with(&real)).find_map(|part| {
        match std::fs::metadata(part) {
            Ok(about) => file::stranger(&about).map(|fault| format!("{} {fault}", part.display())),
            Err(why) => Some(format!("{} cannot be looked at: {why}", part.display())),
        }
    })
}

impl RigFile {
    /// Enters `folder` into the rig file as the folder of its calibration, and returns the new content. Comments and the order of keys
    /// stay. A folder below the folder of the rig file is named by its relative path.
    ///
    /// # Errors
    /// The errors of [`Self::load`], and [`Error::Write`].
    pub fn name_calibration(&self, folder: &Path) -> Result<Self> {
        let bytes = file::read(&self.path)?;
        // The user may have changed the file in the meantime. It must still be valid.
        Self::from_bytes(&self.path, &bytes)?;
        let named = named_in(&String::from_utf8_lossy(&bytes), &relative(&self.path, folder)?);
        let named = named.map_err(|fault| {
            Error::data(&self.path, fault.to_string())
                .help("write the line `calibration = …` into the file yourself")
        })?;
        let file = Self::from_bytes(&self.path, named.as_bytes())?;
        atomic::write_bytes(&self.path, named.as_bytes())?;
        Ok(file)
    }
}

/// The text of a rig file after this calibration is entered.
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

/// The name that the rig file at `path` uses for a folder.
fn relative(path: &Path, folder: &Path) -> Result<String> {
    let real = |path: &Path| std::fs::canonicalize(path).map_err(Error::reading(path));
    let folder = real(folder)?;
    let home = real(path)?.parent().map_or_else(PathBuf::new, Path::to_path_buf);
    let name = folder.strip_prefix(&home).unwrap_or(&folder);
    name.to_str().map(str::to_owned).ok_or_else(|| {
        Error::data(&folder, "its name is not UTF-8 text, as that of a file in TOML must be")
            .help("rename the folder")
    })
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::{PermissionsExt, symlink};
    use std::path::Path;

    fn file(more: &str) -> RigFile {
        let text = format!(
            "kind = \"hardware\"\n[projector]\nkind = \"x11\"\nsize = [8, 8]\n\
             [camera]\nkind = \"gphoto2\"\nsize = [8, 8]\n{more}\n"
        );
        RigFile::from_bytes(Path::new("/nowhere/rig.toml"), text.as_bytes()).expect("it is whole")
    }

    #[test]
    fn only_programs_that_a_file_names_have_to_be_allowed() {
        let usual = file("program = \"gphoto2\"");
        assert!(usual.named_programs().is_empty() && usual.require_programs_allowed(false).is_ok());
        let named = file("program = \"/tmp/evil\"\ndecoder = [\"sh\", \"-c\", \"rm -rf ~\"]");
        assert_eq!(named.named_programs(), ["/tmp/evil", "sh -c rm -rf ~"]);
        let error = named.require_programs_allowed(false).expect_err("it was not allowed").to_string();
        for part in ["/nowhere/rig.toml", "`/tmp/evil` and `sh -c rm -rf ~`", "--allow-programs"] {
            assert!(error.contains(part), "{part}: {error}");
        }
        assert!(named.require_programs_allowed(true).is_ok());
    }

    #[test]
    fn a_file_is_the_users_own_where_nobody_else_can_have_put_it() {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let [own, other] = ["own", "other"].map(|name| folder.path().join(name));
        for folder in [&own, &own.join("lab"), &other] {
            fs::create_dir(folder).expect("the folder is writable");
            fs::set_permissions(folder, fs::Permissions::from_mode(0o755)).expect("it is ours");
            fs::write(folder.join("rig.toml"), "").expect("the folder is writable");
            fs::set_permissions(folder.join("rig.toml"), fs::Permissions::from_mode(0o644))
                .expect("it is ours");
        }
        let is_own = |path: &Path| objection(path, &own).is_none();
        let inner = own.join("lab/rig.toml");
        assert!(is_own(&inner) && is_own(&own.join("rig.toml")));
        assert!(!is_own(&other.join("rig.toml")) && !is_own(&own.join("../other/rig.toml")));
        symlink(other.join("rig.toml"), own.join("link.toml")).expect("the folder is writable");
        assert!(!is_own(&own.join("link.toml")), "what counts is where the file is");
        assert!(!is_own(&own.join("none.toml")));
        // Each part of the path is tried with each mode that lets others write.
        for (part, usual) in [(own.clone(), 0o755), (own.join("lab"), 0o755), (inner.clone(), 0o644)] {
            for more in [0o002, 0o020, 0o022, 0o1002, 0o1022] {
                fs::set_permissions(&part, fs::Permissions::from_mode(usual | more)).expect("it is ours");
                let objection = objection(&inner, &own).unwrap_or_default();
                let real = fs::canonicalize(&part).expect("it is there");
                assert!(
                    objection.starts_with(&format!("{} can be written", real.display())),
                    "{more:o} {objection}"
                );
            }
            fs::set_permissions(&part, fs::Permissions::from_mode(usual)).expect("it is ours");
            assert!(is_own(&inner), "{}", part.display());
        }
    }

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
        fs::write(&file, "").expect("it can be written");
        let beside = home.path().join("rig-calibration");
        fs::create_dir(&beside).expect("it can be made");
        let named = |folder: &Path| relative(&file, folder).expect("it is there");
        assert_eq!(named(&beside), "rig-calibration");
        let real = other.path().canonicalize().expect("it is there");
        assert_eq!(Path::new(&named(other.path())), real);
    }
}
