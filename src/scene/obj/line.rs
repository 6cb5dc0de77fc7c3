//! Lines of `.obj` and `.mtl` files: a keyword and its arguments.

use std::path::Path;

use crate::error::{Error, Result};
use crate::scene::source::fault;

/// One statement, with continued lines joined.
#[derive(Clone, Copy)]
pub(super) struct Line<'a> {
    pub path: &'a Path,
    number: usize,
    pub keyword: &'a str,
    /// The rest of the line, trimmed.
    pub rest: &'a str,
}

/// One number more than any statement takes.
const MAX_NUMBERS: usize = 8;

/// The numbers of a statement, at most [`MAX_NUMBERS`] of them.
pub(super) struct Numbers {
    first: [f32; MAX_NUMBERS],
    count: usize,
}

impl std::ops::Deref for Numbers {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.first[..self.count]
    }
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
        let statement = if joined.is_empty() {
            line.trim()
        } else {
            joined.push_str(line);
            joined.trim()
        };
        let (keyword, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
        if !keyword.is_empty() && !keyword.starts_with('#') {
            each(&Line { path, number: index + 1, keyword, rest: rest.trim() })?;
        }
        joined.clear();
    }
    Ok(())
}

impl<'a> Line<'a> {
    pub(super) fn fault(&self, what: &str) -> Error {
        fault(
            self.path,
            format!("line {}: {what}", self.number),
            "correct the line, or export the scene again",
        )
    }

    /// The line's place, as in `line 7 of paint.mtl`.
    pub(super) fn place(&self) -> String {
        let file = self.path.file_name().unwrap_or_default();
        format!("line {} of {}", self.number, file.display())
    }

    /// The line without its first argument, if that is `word`.
    pub(super) fn after(&self, word: &str) -> Option<Self> {
        let rest = self.rest.strip_prefix(word)?;
        rest.starts_with(char::is_whitespace).then(|| Self { rest: rest.trim_start(), ..*self })
    }

    /// The arguments before a comment.
    pub(super) fn words(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.rest.split_whitespace().take_while(|word| !word.starts_with('#'))
    }

    /// The arguments as finite numbers.
    pub(super) fn numbers(&self) -> Result<Numbers> {
        let mut numbers = Numbers { first: [0.0; MAX_NUMBERS], count: 0 };
        for word in self.words() {
            let number = word.parse::<f32>().ok().filter(|number| number.is_finite());
            let number =
                number.ok_or_else(|| self.fault(&format!("`{}` is not a finite number", shortened(word))))?;
            if numbers.count < MAX_NUMBERS {
                numbers.first[numbers.count] = number;
                numbers.count += 1;
            }
        }
        Ok(numbers)
    }

    /// The only argument, a finite number.
    pub(super) fn number(&self) -> Result<f32> {
        match *self.numbers()? {
            [number] => Ok(number),
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
