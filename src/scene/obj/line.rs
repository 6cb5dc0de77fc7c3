//! Lines of `.obj` and `.mtl` files: a keyword and its arguments.

use std::path::Path;

use crate::error::{Error, Result};
use crate::scene::source::fault;

/// One statement, with continued lines joined.
pub(super) struct Line<'a> {
    pub path: &'a Path,
    number: usize,
    pub keyword: &'a str,
    /// The rest of the line, trimmed.
    pub rest: &'a str,
}

/// Calls `each` for every statement of a file.
pub(super) fn statements(
    path: &Path,
    text: &str,
    mut each: impl FnMut(&Line<'_>) -> Result<()>,
) -> Result<()> {
    let mut joined = String::new();
    for (index, line) in text.lines().enumerate() {
        if let Some(continued) = line.trim_end().strip_suffix('\\') {
            joined.push_str(continued);
            joined.push(' ');
            continue;
        }
        joined.push_str(line);
        let statement = joined.trim();
        let (keyword, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
        if !keyword.is_empty() && !keyword.starts_with('#') {
            each(&Line { path, number: index + 1, keyword, rest: rest.trim() })?;
        }
        joined.clear();
    }
    Ok(())
}

impl Line<'_> {
    pub(super) fn fault(&self, what: &str) -> Error {
        fault(
            self.path,
            format!("line {}: {what}", self.number),
            "correct the line, or export the scene again",
        )
    }

    /// The arguments before a comment.
    pub(super) fn words(&self) -> impl Iterator<Item = &str> {
        self.rest.split_whitespace().take_while(|word| !word.starts_with('#'))
    }

    /// The arguments as finite numbers.
    pub(super) fn numbers(&self) -> Result<Vec<f32>> {
        self.words()
            .map(|word| match word.parse::<f32>() {
                Ok(number) if number.is_finite() => Ok(number),
                _ => Err(self.fault(&format!("`{}` is not a finite number", shortened(word)))),
            })
            .collect()
    }

    /// The only argument, a finite number.
    pub(super) fn number(&self) -> Result<f32> {
        match self.numbers()?.as_slice() {
            [number] => Ok(*number),
            _ => Err(self.fault(&format!("`{}` takes one number", shortened(self.keyword)))),
        }
    }
}

/// The beginning of a word, short enough for a one-line message.
pub(super) fn shortened(word: &str) -> String {
    match word.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &word[..end]),
        None => word.into(),
    }
}
