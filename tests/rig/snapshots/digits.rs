//! The numbers of a value as text: seven digits of each, and sums in place of long lists.

use std::fmt::{Debug, Write};

/// Lists of more numbers than this are summarised.
const LISTED: usize = 8;

/// The value as it is printed for debugging, with seven digits of each number and a [`summary`] of each long list. More digits would depend on the
/// system: its library may round logarithms and powers in another way.
pub fn text(value: &impl Debug) -> String {
    let printed = format!("{value:#?}");
    let mut text = String::new();
    let mut list: Vec<f64> = Vec::new();
    for line in printed.lines() {
        match line.trim().strip_suffix(',').and_then(|number| number.parse().ok()) {
            Some(number) => list.push(number),
            None => {
                write_list(&mut text, &mut list);
                writeln!(text, "{}", rounded(line)).expect("a string takes everything");
            }
        }
    }
    write_list(&mut text, &mut list);
    text
}

/// A list of numbers in one line: how many there are, their mean, the mean of their products with weights that ascend along the list, the mean of
/// their squares, and five of them. The weights tell lists of the same numbers in another order apart.
pub fn summary(values: &[f64]) -> String {
    let count = values.len() as f64;
    let mean = |of: &dyn Fn(usize, f64) -> f64| {
        let sum: f64 = values.iter().enumerate().map(|(index, &value)| of(index, value)).sum();
        digits(sum / count)
    };
    let places: Vec<String> = (0..5).map(|k| digits(values[k * (values.len() - 1) / 4])).collect();
    let weighted = mean(&|index, value| value * (1.0 + index as f64 / count).sqrt());
    format!(
        "{} numbers, mean {}, weighted {weighted}, square {}: {}",
        values.len(),
        mean(&|_, value| value),
        mean(&|_, value| value * value),
        places.join(" ")
    )
}

fn write_list(text: &mut String, list: &mut Vec<f64>) {
    if list.len() > LISTED {
        writeln!(text, "{}", summary(list)).expect("a string takes everything");
    } else {
        list.iter()
            .for_each(|&number| writeln!(text, "{}", digits(number)).expect("a string takes everything"));
    }
    list.clear();
}

fn digits(number: f64) -> String {
    // −0 and 0 are the same number.
    if number == 0.0 { "0".into() } else { format!("{number:.6e}") }
}

/// The line with seven digits of each of its numbers that has a point or an exponent.
fn rounded(line: &str) -> String {
    let mut text = String::new();
    let mut rest = line;
    while !rest.is_empty() {
        let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '+' | '_');
        let end = rest.find(|c| !is_part(c)).unwrap_or(rest.len());
        let (word, after) = rest.split_at(end);
        match word.parse::<f64>() {
            Ok(number) if word.contains(['.', 'e']) && number.is_finite() => text += &digits(number),
            _ => text += word,
        }
        let next = after.chars().next().map_or(0, char::len_utf8);
        text += &after[..next];
        rest = &after[next..];
    }
    text
}
