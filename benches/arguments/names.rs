//! Names among the arguments of a benchmark.

/// Whether this one of the names is asked for: all are where none is named.
pub fn asked(arguments: &[String], names: &[&str], name: &str) -> bool {
    let mut of_these = arguments.iter().filter(|text| names.contains(&text.as_str())).peekable();
    of_these.peek().is_none() || of_these.any(|text| text == name)
}
