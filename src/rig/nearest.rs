//! Suggestions for mistyped names.

// A swap of two neighbouring letters counts as one edit.
use strsim::osa_distance as distance;

/// The known name with the fewest edits from `name`. `None`: all known names differ so much that they are probably other words.
pub(crate) fn nearest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let distances = known.iter().map(|known| (distance(name, known), *known));
    let (edits, known) = distances.min_by_key(|(edits, _)| *edits)?;
    (2 * edits <= name.chars().count().max(known.chars().count()) + 1).then_some(known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mistyped_name_is_recognized_but_another_word_is_not() {
        let known = ["gamma", "curve", "black_level", "bits"];
        for (name, expected) in [
            ("gama", Some("gamma")),
            ("gmama", Some("gamma")),
            ("blacklevel", Some("black_level")),
            ("bit", Some("bits")),
            ("temperature", None),
            ("", None),
        ] {
            assert_eq!(nearest(name, &known), expected, "{name}");
        }
        assert_eq!(nearest("anything", &[]), None);
    }

    #[test]
    fn edits_are_counted() {
        let cases = [("saturday", "sunday", 3), ("", "abc", 3), ("ab", "ba", 1), ("same", "same", 0)];
        assert!(cases.iter().all(|(a, b, edits)| distance(a, b) == *edits && distance(b, a) == *edits));
    }
}
