//! The pages: the README and every page of the guide.

use std::fs;
use std::path::{Path, PathBuf};

/// A page, by its path in the repository.
pub struct Page {
    pub path: PathBuf,
    pub text: String,
}

impl Page {
    /// `guide/src/concepts/krylov.md:12`.
    pub fn at(&self, line: usize) -> String {
        format!("{}:{line}", self.path.display())
    }
}

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A file of the repository.
pub fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The README, and all pages that the guide's summary names, in its order.
pub fn all() -> Vec<Page> {
    let summary = read("guide/src/SUMMARY.md");
    let named = summary.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let pages = named.filter(|name| !name.is_empty()).map(|name| Path::new("guide/src").join(name));
    let paths = std::iter::once(PathBuf::from("README.md")).chain(pages);
    paths.map(|path| Page { text: read(&path.to_string_lossy()), path }).collect()
}

/// Pages beside the guide: in the root, in `docs`, and in folders that explain themselves.
pub fn others() -> Vec<Page> {
    let entries = fs::read_dir(root()).expect("the repository can be read");
    let here = entries.map(|entry| entry.expect("an entry").path()).filter(|path| path.is_file());
    let folders = ["docs", "benches", "assets", "python", "tests"];
    let below = folders.into_iter().flat_map(|folder| below(&root().join(folder)));
    let pages = here.chain(below).filter(|path| path.extension().is_some_and(|extension| extension == "md"));
    let relative = pages.map(|path| path.strip_prefix(root()).expect("it is below the root").to_path_buf());
    let new = relative.filter(|path| path != Path::new("README.md"));
    new.map(|path| Page { text: read(&path.to_string_lossy()), path }).collect()
}

/// The Markdown files below a folder.
fn below(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("the guide can be read");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let pages = paths.flat_map(|path| if path.is_dir() { below(&path) } else { vec![path] });
    pages.filter(|path| path.extension().is_some_and(|extension| extension == "md")).collect()
}

#[test]
fn the_summary_names_every_page() {
    let named: Vec<PathBuf> = all().into_iter().map(|page| root().join(page.path)).collect();
    let folder = root().join("guide/src");
    for page in below(&folder).into_iter().filter(|page| *page != folder.join("SUMMARY.md")) {
        assert!(named.contains(&page), "{} is not in guide/src/SUMMARY.md", page.display());
    }
}
