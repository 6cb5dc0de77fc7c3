//! The meanings of a page's figures, taken from the guide's glossary.

use std::collections::HashMap;
use std::sync::LazyLock;

/// The page of the guide with all definitions, in tables of two columns.
const GLOSSARY: &str = include_str!("../../../guide/src/reference/glossary.md");

static DEFINITIONS: LazyLock<HashMap<&str, String>> = LazyLock::new(|| {
    let rows =
        GLOSSARY.lines().filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |")?.split_once(" | "));
    let terms = rows.filter(|(term, _)| !term.starts_with('`') && !term.starts_with("--"));
    // Words of the field come last. If a column has the same name, the definition of the column wins.
    let mut found = HashMap::new();
    for (term, definition) in terms {
        found.entry(term).or_insert_with(|| plain(definition));
    }
    found
});

/// The terms that have a definition, each once, with their definitions.
pub(super) fn definitions<'a>(terms: impl IntoIterator<Item = &'a str>) -> Vec<(&'static str, &'static str)> {
    let mut found: Vec<(&str, &str)> = Vec::new();
    for term in terms {
        let known =
            DEFINITIONS.get_key_value(term).or_else(|| DEFINITIONS.get_key_value(generic(term).as_str()));
        if let Some((&term, definition)) = known
            && !found.iter().any(|(other, _)| *other == term)
        {
            found.push((term, definition));
        }
    }
    found
}

/// The general form of a term with numbers or letters: `from 3` becomes `from N`, `u7` becomes `uN`, and the pixel `C` becomes `A, B, …`.
fn generic(term: &str) -> String {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    match term.strip_prefix('u') {
        Some(rest) if is_number(rest) => "uN".into(),
        _ if term.len() == 1 && term.bytes().all(|byte| byte.is_ascii_uppercase()) => "A, B, …".into(),
        _ => {
            let words = term.split(' ').map(|word| if is_number(word) { "N" } else { word });
            words.collect::<Vec<_>>().join(" ")
        }
    }
}

/// Markdown as plain text. A link becomes its words.
fn plain(markdown: &str) -> String {
    let mut text = String::new();
    let mut rest = markdown;
    while let Some((before, after)) = rest.split_once("](") {
        text += before;
        rest = after.split_once(')').map_or("", |(_, rest)| rest);
    }
    (text + rest).replace(['[', '`', '*'], "")
}

#[cfg(test)]
mod tests {
    use super::{definitions, plain};

    #[test]
    fn terms_with_numbers_are_defined_once() {
        let found = definitions(["photos", "from 1", "from 2", "u3", "no such figure", "B"]);
        let terms: Vec<&str> = found.iter().map(|(term, _)| *term).collect();
        assert_eq!(terms, ["photos", "from N", "uN", "A, B, …"]);
        assert_eq!(found[0].1, "photos that the row's answer took");
    }

    #[test]
    fn links_keep_their_words() {
        assert_eq!(plain("a [link](b.md#c) of `x` ([how](d.md))"), "a link of x (how)");
    }
}
