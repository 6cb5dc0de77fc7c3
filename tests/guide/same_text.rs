//! Texts that stand in two places are the same in both.

use crate::blocks;
use crate::gallery;
use crate::pages::{self, Page, read};
use crate::reference;

#[test]
fn the_reference_is_what_the_command_line_says() {
    let (made, written) = (reference::page(krylux::cli::command()), read(reference::PAGE));
    let changed = made.lines().zip(written.lines()).find(|(made, written)| made != written);
    assert!(
        made == written,
        "run `cargo run --release --example regenerate_guide reference`; the first line that differs: {changed:?}"
    );
}

#[test]
fn the_gallery_is_what_its_generator_writes() {
    assert!(gallery::page() == read(gallery::PAGE), "run `cargo run --release --example regenerate_guide`");
}

/// The lines of Rust in a page, without their indentation.
fn rust(page: &Page) -> Vec<Vec<String>> {
    let blocks = blocks::of(page).into_iter().filter(|block| block.language == "rust");
    blocks.map(|block| block.text.lines().map(|line| line.trim().to_owned()).collect()).collect()
}

/// The code of a line, without the comment behind it.
fn code(line: &str) -> &str {
    line.split("//").next().unwrap_or_default().trim()
}

#[test]
fn rust_in_the_guide_is_rust_of_an_example_that_ci_runs() {
    let ci = read(".ci/run");
    let names = std::fs::read_dir(pages::root().join("examples")).expect("there are examples");
    let names = names.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    let names: Vec<String> = names.filter(|name| name.ends_with(".rs")).collect();
    let run = names.iter().filter(|name| ci.contains(name.trim_end_matches(".rs")));
    let sources: Vec<Vec<String>> = run
        .map(|name| read(&format!("examples/{name}")).lines().map(|line| code(line).to_owned()).collect())
        .collect();
    let mut found = 0;
    for page in pages::all() {
        for block in rust(&page) {
            let lines: Vec<&str> =
                block.iter().map(|line| code(line)).filter(|line| !line.is_empty()).collect();
            let is_in = |source: &Vec<String>| {
                let source: Vec<&str> =
                    source.iter().map(String::as_str).filter(|line| !line.is_empty()).collect();
                source.windows(lines.len().max(1)).any(|part| part == lines)
            };
            assert!(
                sources.iter().any(is_in),
                "{}: no example has these lines: {block:#?}",
                page.path.display()
            );
            found += 1;
        }
    }
    assert!(found > 0, "the README has a block of Rust");
}
