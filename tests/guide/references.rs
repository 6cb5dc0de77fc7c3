//! Every file and folder of the repository that a page or a comment names is there.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::pages::root;

/// The folders whose files are read, and whose names begin a reference.
const FOLDERS: [&str; 12] = [
    "src",
    "tests",
    "benches",
    "guide",
    "docs",
    "assets",
    "shaders",
    "examples",
    "python",
    "packaging",
    ".ci",
    ".github",
];

/// Endings of files that comments also name without their folder.
const SOURCES: [&str; 2] = [".rs", ".wgsl"];

/// The files below the repository's folders and in its root, relative to it.
fn files() -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = FOLDERS.iter().map(|folder| root().join(folder)).collect();
    let mut files: Vec<PathBuf> = entries(root()).into_iter().filter(|path| path.is_file()).collect();
    while let Some(folder) = folders.pop() {
        let (below, here): (Vec<_>, Vec<_>) = entries(&folder).into_iter().partition(|path| path.is_dir());
        folders.extend(
            below.into_iter().filter(|path| !path.ends_with("target") && !path.ends_with("__pycache__")),
        );
        files.extend(here);
    }
    let relative = |path: PathBuf| path.strip_prefix(root()).expect("it is below the root").to_path_buf();
    files.into_iter().map(relative).collect()
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder)
        .expect("the repository can be read")
        .map(|entry| entry.expect("an entry").path())
        .collect()
}

/// The text that begins a comment in files of this kind; it is empty for pages and Python, which are read whole.
fn kind(path: &Path) -> Option<&'static str> {
    match path.extension()?.to_str()? {
        "md" | "py" => Some(""),
        "rs" | "wgsl" => Some("//"),
        // Comments of rig files tell users which files of their own to make.
        "toml" | "yml" if !path.starts_with("assets") => Some("#"),
        _ => None,
    }
}

/// The words of a file, with their lines: all of a page, and the comments of a source; blocks of code are left out.
fn prose(path: &Path, text: &str) -> Vec<(usize, String)> {
    let begin = kind(path).unwrap_or_default();
    let mut is_code = false;
    let lines = text.lines().enumerate().filter_map(|(index, line)| {
        let words = comment(line, begin)?;
        let is_fence = words.trim_start_matches(['/', '!', ' ']).starts_with("```");
        is_code ^= is_fence;
        (!is_code && !is_fence).then(|| (index + 1, words.to_owned()))
    });
    lines.collect()
}

/// The comment of a line. Two slashes after a colon are of an address.
fn comment<'a>(line: &'a str, begin: &str) -> Option<&'a str> {
    let at = line.match_indices(begin).map(|(at, _)| at).find(|&at| !line[..at].ends_with(':'))?;
    Some(&line[at..])
}

/// The references of a line: paths that begin with a folder of the repository, and names of sources.
fn references(line: &str) -> Vec<&str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || "_./-".contains(c);
    let mut found = Vec::new();
    let mut rest = line;
    while let Some(start) = rest.find(is_part) {
        let length = rest[start..].find(|c| !is_part(c)).unwrap_or(rest.len() - start);
        let (word, after) = rest[start..].split_at(length);
        // A pattern such as `src/*.rs` or `tests/NAME.rs` names no single file, nor does an address.
        let is_pattern = after.starts_with(['*', '{', '<', '…', '[', ':', '(']) && !after.starts_with(": ")
            || rest[..start].ends_with(['*', '}', '>', '…', '$', ':', '@', '~'])
            || word.contains("...")
            || word.split('/').any(is_placeholder);
        let word = word.trim_end_matches(['.', '-']).trim_end_matches('/');
        let is_path = word.split_once('/').is_some_and(|(first, _)| FOLDERS.contains(&first));
        let is_source = !word.contains('/')
            && SOURCES.iter().any(|ending| word.strip_suffix(ending).is_some_and(|stem| !stem.is_empty()));
        if !is_pattern && (is_path || is_source) {
            found.push(word);
        }
        rest = after;
    }
    found
}

/// Whether a part of a path stands for any name, as in `tests/NAME.rs`.
fn is_placeholder(part: &str) -> bool {
    let stem = part.split('.').next().unwrap_or_default();
    stem.len() > 1 && stem != "README" && stem.bytes().all(|byte| byte.is_ascii_uppercase())
}

/// The references of a text that lead nowhere, with their lines: from the root, or from a folder that the file is in.
fn stale(path: &Path, text: &str, files: &BTreeSet<PathBuf>) -> Vec<(usize, String)> {
    let is_there = |name: &str| {
        let is_below = |base: &Path| {
            let wanted = base.join(name);
            files.contains(&wanted)
                || files.range(wanted.clone()..).next().is_some_and(|file| file.starts_with(&wanted))
        };
        let is_source = !name.contains('/') && files.iter().any(|file| file.ends_with(name));
        is_source || path.ancestors().skip(1).any(is_below)
    };
    let lines = prose(path, text);
    let named =
        lines.iter().flat_map(|(line, words)| references(words).into_iter().map(|name| (*line, name)));
    named.filter(|(_, name)| !is_there(name)).map(|(line, name)| (line, name.to_owned())).collect()
}

#[test]
fn every_file_that_a_page_or_a_comment_names_is_there() {
    let files: BTreeSet<PathBuf> = files().into_iter().collect();
    // This file names some that are not there.
    let is_read = |path: &&PathBuf| !path.ends_with(file!()) && kind(path).is_some();
    let (mut read, mut failures) = (0, Vec::new());
    for path in files.iter().filter(is_read) {
        let Ok(text) = fs::read_to_string(root().join(path)) else { continue };
        let found = stale(path, &text, &files);
        failures.extend(found.into_iter().map(|(line, name)| format!("{}:{line}: {name}", path.display())));
        read += 1;
    }
    assert!(read > 300, "{read} files were read");
    assert!(failures.is_empty(), "these files are not there:\n{}", failures.join("\n"));
}

#[test]
fn a_wrong_name_is_found() {
    let files: BTreeSet<PathBuf> =
        ["src/lib.rs", "src/room/mod.rs", "docs/page.md", "python/src/lib.rs"].map(PathBuf::from).into();
    let stale = |path: &str, text: &str| stale(Path::new(path), text, &files);
    let page = "See `src/lib.rs`, src/room/ and `docs/page.md`.\n`src/gone.rs`; (docs/pages.md)\n```sh\nls src/x.rs\n```\n";
    assert_eq!(stale("docs/page.md", page), [(2, "src/gone.rs".into()), (2, "docs/pages.md".into())]);
    let source = "/// As `lib.rs` and `gone.rs` say: src/room.\nlet path = \"src/none.rs\"; // src/roo\n";
    assert_eq!(stale("src/lib.rs", source), [(1, "gone.rs".into()), (2, "src/roo".into())]);
    assert_eq!(stale("python/src/lib.rs", "// `src/room/mod.rs`, `src/lib.rs`, https://host/src/x.rs\n"), []);
    assert_eq!(stale("README.md", "`src/*.rs`, `assets/NAME/scene.glb`, tests/{a,b}, `src/`\n"), []);
}

/// The page of the paper's rows names the test that holds each row, as `file.rs::test`.
#[test]
fn tests_that_the_guide_names_are_there() {
    let pages = files().into_iter().filter(|path| path.starts_with("guide/src") && kind(path) == Some(""));
    let mut named = 0;
    for page in pages {
        let text = fs::read_to_string(root().join(&page)).expect("a page");
        for name in text.split('`').filter(|quoted| quoted.contains(".rs::")) {
            let (file, test) = name.split_once("::").expect("a file and a test");
            let source = fs::read_to_string(root().join(file));
            let is_there = source.is_ok_and(|source| {
                source.contains(&format!("#[test]\nfn {test}("))
                    || source.contains(&format!("#[test]\n    fn {test}("))
            });
            assert!(is_there, "{}: {name}", page.display());
            named += 1;
        }
    }
    assert!(named > 100, "{named} tests are named");
}
