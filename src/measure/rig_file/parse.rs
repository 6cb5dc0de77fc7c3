//! The parser of rig files. Its errors name the line, the key, and the name that was probably meant.

use std::path::Path;

use serde::de::DeserializeOwned;

use crate::error::Error;
use crate::rig::nearest::nearest;

/// Parses `text`, the content of the file at `path`.
pub(crate) fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, Error> {
    toml::from_str(text).map_err(|error| explain(path, text, &error))
}

fn explain(path: &Path, text: &str, error: &toml::de::Error) -> Error {
    let message = error.message().trim_end();
    let place = error.span().map_or_else(String::new, |span| place(text, span.start));
    let data = |fault, help| Error::Data { path: path.to_path_buf(), fault, help };
    // The messages of serde are "unknown field `a`, expected one of `b`, `c`" and "unknown variant `a`,
    // expected `b` or `c`".
    let unknown = [("unknown field `", "key"), ("unknown variant `", "value")];
    for (beginning, what) in unknown {
        let Some((name, rest)) = message.strip_prefix(beginning).and_then(|rest| rest.split_once('`')) else {
            continue;
        };
        let known: Vec<&str> = rest.split('`').skip(1).step_by(2).collect();
        let meant =
            nearest(name, &known).map_or_else(String::new, |known| format!("; did you mean `{known}`?"));
        let known = if known.is_empty() { "none".into() } else { known.join(", ") };
        return data(format!("{place}unknown {what} `{name}`{meant}"), format!("known here: {known}"));
    }
    let help = "a rig file is TOML: tables like [camera], and lines like `bits = 14`; see the examples in assets/rigs";
    data(format!("{place}{message}"), help.into())
}

/// `line 7, in [camera]: ` for the byte at `at`. The table is left out when that line is itself a table's
/// header.
fn place(text: &str, at: usize) -> String {
    // The span of an error may end at the end of the text, and inside of a character.
    let before = String::from_utf8_lossy(text.as_bytes().get(..at).unwrap_or(text.as_bytes()));
    let line = before.matches('\n').count() + 1;
    let is_header = text.lines().nth(line - 1).is_some_and(|line| line.trim_start().starts_with('['));
    let table = before.lines().rev().find_map(|line| {
        let (name, _) = line.trim().strip_prefix('[')?.split_once(']')?;
        // A line of an array of arrays begins with a bracket, too.
        name.starts_with(|c: char| c.is_ascii_alphabetic()).then(|| name.to_owned())
    });
    match table {
        Some(table) if !is_header => format!("line {line}, in [{table}]: "),
        _ => format!("line {line}: "),
    }
}
