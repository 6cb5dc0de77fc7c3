//! Text of drawings.

use super::LETTER;

/// Splits a text that is wider than `length` into two rows.
pub(super) fn rows(text: &str, length: f64) -> Vec<&str> {
    let half = text.len() / 2;
    let break_at = text.match_indices(' ').map(|(at, _)| at).min_by_key(|at| at.abs_diff(half));
    match break_at {
        Some(at) if LETTER * text.chars().count() as f64 > length => vec![&text[..at], &text[at + 1..]],
        _ => vec![text],
    }
}

pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            // XML forbids other control characters, even escaped ones.
            character if character.is_control() => escaped.push(' '),
            character => escaped.push(character),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_longer_than_its_axis_takes_two_rows() {
        assert_eq!(rows("relative residual", 260.0), ["relative residual"]);
        let long = "relative error of global light, Frobenius norm";
        assert_eq!(rows(long, 260.0), ["relative error of global", "light, Frobenius norm"]);
        assert_eq!(rows("withoutanyspace", 10.0), ["withoutanyspace"]);
    }
}
