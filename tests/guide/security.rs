//! Tests hold the promises of the page on files from strangers, which names them out of sight.

use std::path::{Path, PathBuf};

use crate::pages::{read, root};

fn sources(folder: &Path) -> Vec<PathBuf> {
    let paths = std::fs::read_dir(folder).expect("sources can be read").flatten().map(|entry| entry.path());
    paths.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] }).collect()
}

#[test]
fn every_promise_about_strangers_files_names_its_tests() {
    let paths = ["src", "tests"].iter().flat_map(|folder| sources(&root().join(folder)));
    let rust = paths.filter(|path| path.extension().is_some_and(|it| it == "rs"));
    let code: String = rust.map(|path| std::fs::read_to_string(path).unwrap_or_default()).collect();
    let page = read("guide/src/how-to/security.md");
    let promises = page.split("\n## ").skip(1).filter(|section| !section.starts_with("How this is tested"));
    let mut count = 0;
    for section in promises {
        let (heading, text) = section.split_once('\n').expect("a section has text");
        // A comment after a blank line, as behind a table, is of the block before it.
        let text = text.replace("\n\n<!-- tests", "\n<!-- tests").replace("\n- ", "\n\n- ");
        for promise in
            text.split("\n\n").map(str::trim).filter(|block| !block.is_empty() && !block.ends_with(':'))
        {
            let named = promise.split("<!-- tests: ").nth(1).and_then(|rest| rest.split(" -->").next());
            let named = named.unwrap_or_else(|| panic!("{heading}: no test is named for: {promise}"));
            for test in named.split(", ") {
                assert!(code.contains(&format!("fn {test}(")), "{heading}: there is no test {test}");
            }
            count += 1;
        }
    }
    assert!(count > 15, "{count} promises");
}
