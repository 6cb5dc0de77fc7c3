//! Programs that a rig file names. The author of the file chooses what is run, and so a stranger's file runs nothing unasked.

use std::path::{Path, PathBuf};

use super::{RigFile, RigKind};
use crate::error::{Error, Result};
use crate::rig::{CameraSpec, Gphoto2Spec};

impl RigFile {
    /// The programs that the file names, with their arguments, one text for each. Those that are run where a file names none, `gphoto2` and
    /// `dcraw`, are not among them.
    pub fn named_programs(&self) -> Vec<String> {
        let RigKind::Hardware(rig) = &self.kind else { return Vec::new() };
        let CameraSpec::Gphoto2(camera) = &rig.camera else { return Vec::new() };
        let usual = Gphoto2Spec::new(1, 1);
        let program = (camera.program != usual.program).then(|| camera.program.clone());
        let decoder = (camera.decoder != usual.decoder).then(|| camera.decoder.join(" "));
        program.into_iter().chain(decoder).collect()
    }

    /// Whether the file is in the user's own folder of rigs ([`own_folder`]), which only the user or the administrator writes.
    pub fn is_in_own_folder(&self) -> bool {
        own_folder().is_some_and(|folder| is_own(&self.path, &folder))
    }

    /// Checks that the programs that the file names may be run: because it is in the user's own folder, or because `allowed` says so.
    ///
    /// # Errors
    /// [`Error::Data`], with the programs.
    pub fn require_programs_allowed(&self, allowed: bool) -> Result<()> {
        let programs = self.named_programs();
        if programs.is_empty() || allowed || self.is_in_own_folder() {
            return Ok(());
        }
        let folder =
            own_folder().map_or_else(|| "~/.config/krylux".to_owned(), |folder| folder.display().to_string());
        Err(Error::Data {
            path: self.path.clone(),
            fault: format!(
                "it names programs, which are run only for files in your own folder {folder}: {}",
                programs.iter().map(|program| format!("`{program}`")).collect::<Vec<_>>().join(" and ")
            ),
            help: "if you trust the file and these programs, add --allow-programs, or move the file into that folder".into(),
        })
    }
}

/// The user's own folder of rigs, `$XDG_CONFIG_HOME/krylux` or `~/.config/krylux`. `None` if neither `XDG_CONFIG_HOME` nor `HOME` is set.
pub fn own_folder() -> Option<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let base = absolute("XDG_CONFIG_HOME").or_else(|| Some(absolute("HOME")?.join(".config")))?;
    Some(base.join("krylux"))
}

/// Whether a file is below a folder, links followed, and belongs to its owner alone.
fn is_own(path: &Path, folder: &Path) -> bool {
    let [Ok(path), Ok(folder)] = [path, folder].map(std::fs::canonicalize) else { return false };
    path.starts_with(&folder) && is_written_by_owner_only(&path, &folder)
}

/// Whether the owner of the folder, or the administrator, also owns the file, and no group or other user may write it.
#[cfg(unix)]
fn is_written_by_owner_only(path: &Path, folder: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let [Ok(file), Ok(folder)] = [path, folder].map(std::fs::metadata) else { return false };
    (file.uid() == folder.uid() || file.uid() == 0) && file.mode() & 0o022 == 0
}

#[cfg(not(unix))]
fn is_written_by_owner_only(_: &Path, _: &Path) -> bool {
    true
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs;
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

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
        for folder in [&own, &other] {
            fs::create_dir(folder).expect("the folder is writable");
            fs::write(folder.join("rig.toml"), "").expect("the folder is writable");
        }
        assert!(is_own(&own.join("rig.toml"), &own));
        assert!(!is_own(&other.join("rig.toml"), &own) && !is_own(&own.join("../other/rig.toml"), &own));
        symlink(other.join("rig.toml"), own.join("link.toml")).expect("the folder is writable");
        assert!(!is_own(&own.join("link.toml"), &own), "what counts is where the file is");
        let anybody = fs::Permissions::from_mode(0o666);
        fs::set_permissions(own.join("rig.toml"), anybody).expect("it is ours");
        assert!(!is_own(&own.join("rig.toml"), &own), "anybody can write it");
        assert!(!is_own(&own.join("none.toml"), &own));
    }
}
