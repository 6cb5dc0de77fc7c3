//! Suggestions for mistyped names.

/// The known name with the fewest edits from `name`. `None`: all are so different that they are probably other words.
pub(crate) fn nearest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let distances = known.iter().map(|known| (distance(name, known), *known));
    let (edits, known) = distances.min_by_key(|(edits, _)| *edits)?;
    (2 * edits <= name.chars().count().max(known.chars().count()) + 1).then_some(known)
}

/// The number of insertions, deletions, replacements and swaps of neighbouring letters between two words: the optimal string alignment
/// distance, a restricted Damerau–Levenshtein distance.
fn distance(from: &str, to: &str) -> usize {
    let (from, to): (Vec<char>, Vec<char>) = (from.chars().collect(), to.chars().collect());
    let mut rows = vec![(0..=to.len()).collect::<Vec<_>>()];
    for i in 1..=from.len() {
        let mut row = vec![i];
        for j in 1..=to.len() {
            let replaced = rows[i - 1][j - 1] + usize::from(from[i - 1] != to[j - 1]);
            let mut best = replaced.min(rows[i - 1][j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1] {
                best = best.min(rows[i - 2][j - 2] + 1);
            }
            row.push(best);
        }
        rows.push(row);
    }
    rows[from.len()][to.len()]
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
