//! The folder that the commands of a page run in: as a fresh clone, with the program on the path.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::pages::root;

/// No block takes longer; one that waits for a key or for Ctrl-C would never end.
const LIMIT: Duration = Duration::from_secs(300);

/// A temporary folder with a copy of the shipped scenes and rigs. Files that earlier commands of the README left among them are not copied.
pub struct Workplace {
    folder: TempDir,
    cache: PathBuf,
}

/// How a block ended.
pub struct Ended {
    /// `None` where it took too long.
    pub status: Option<i32>,
    /// Stdout and stderr.
    pub output: String,
}

impl Workplace {
    /// A new folder; matrices are kept in `cache`.
    pub fn new(cache: &Path) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        for file in shipped() {
            let target = folder.path().join(&file);
            fs::create_dir_all(target.parent().expect("it is in the folder"))
                .expect("the folder can be written");
            fs::copy(root().join(&file), target).expect("the folder can be written");
        }
        Self { folder, cache: cache.to_path_buf() }
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Writes a file.
    pub fn write(&self, name: &str, text: &str) {
        let path = self.folder.path().join(name);
        fs::create_dir_all(path.parent().expect("it is in the folder")).expect("it can be made");
        fs::write(path, text).expect("the folder can be written");
    }

    /// Runs a program here.
    pub fn run(&self, program: &Path, arguments: &[&str]) -> Ended {
        let log = self.folder.path().join(".output");
        let file = fs::File::create(&log).expect("the folder can be written");
        let path = std::env::var_os("PATH").unwrap_or_default();
        let built = Path::new(env!("CARGO_BIN_EXE_krylux")).parent().expect("a program is in a folder");
        let paths = std::iter::once(built.to_path_buf()).chain(std::env::split_paths(&path));
        let mut child = Command::new(program)
            .args(arguments)
            .current_dir(self.folder.path())
            .env("PATH", std::env::join_paths(paths).expect("the build's folder has no colon"))
            .env("KRYLUX_CACHE", &self.cache)
            .env("NODEVICE_SELECT", "1")
            .stdin(Stdio::null())
            .stdout(file.try_clone().expect("a file can be shared"))
            .stderr(file)
            .spawn()
            .unwrap_or_else(|error| panic!("{}: {error}", program.display()));
        let start = Instant::now();
        let status = loop {
            match child.try_wait().expect("it was started") {
                Some(status) => break status.code(),
                None if start.elapsed() > LIMIT => {
                    // It may have ended by itself just now.
                    let _ = child.kill();
                    let _ = child.wait();
                    break None;
                }
                None => std::thread::sleep(Duration::from_millis(5)),
            }
        };
        let mut bytes = Vec::new();
        fs::File::open(&log).and_then(|mut file| file.read_to_end(&mut bytes)).expect("it was written");
        Ended { status, output: String::from_utf8_lossy(&bytes).into_owned() }
    }
}

/// The files of `assets` that the repository tracks; in a copy without its history, all of them.
fn shipped() -> Vec<PathBuf> {
    let listed = Command::new("git").args(["ls-files", "-z", "assets"]).current_dir(root()).output();
    match listed.ok().filter(|listed| listed.status.success() && !listed.stdout.is_empty()) {
        Some(listed) => {
            String::from_utf8_lossy(&listed.stdout).split_terminator('\0').map(PathBuf::from).collect()
        }
        None => below(Path::new("assets")),
    }
}

fn below(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join(folder)).expect("the repository can be read");
    let paths = entries.map(|entry| folder.join(entry.expect("an entry").file_name()));
    paths.flat_map(|path| if root().join(&path).is_dir() { below(&path) } else { vec![path] }).collect()
}
