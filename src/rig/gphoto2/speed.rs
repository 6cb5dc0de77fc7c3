//! Shutter speeds in seconds, from the names that cameras give them.

/// The seconds of a speed such as `1/200`, `0.5`, `30`, `1.3s`, `1/1.3` or `0"4`. `None`: it is not a time, e.g. `bulb`.
///
/// Cameras name powers of a root of 2 by round numbers, e.g. 1/64 s by 1/60. With `stops` steps to a doubling, the result is the
/// nearest power of `2^(1/stops)`.
pub(super) fn seconds(speed: &str, stops: Option<u32>) -> Option<f64> {
    let speed = speed.trim().trim_end_matches(['s', '"']).trim_end().replace('"', ".");
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let said = match speed.split_once('/') {
        Some((above, below)) => number(above)? / number(below)?,
        None => number(&speed)?,
    };
    let said = Some(said).filter(|said| said.is_finite() && *said > 0.0)?;
    let Some(stops) = stops.map(f64::from) else { return Some(said) };
    Some(((said.log2() * stops).round() / stops).exp2())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_read_in_every_notation() {
        for (speed, expected) in [
            ("1/200", Some(0.005)),
            ("0.5", Some(0.5)),
            ("30", Some(30.0)),
            ("1.3s", Some(1.3)),
            ("0.0166s", Some(0.0166)),
            ("10/13", Some(10.0 / 13.0)),
            ("1/1.3", Some(1.0 / 1.3)),
            ("0\"4", Some(0.4)),
            ("15\"", Some(15.0)),
            ("bulb", None),
            ("Time", None),
            ("0", None),
            ("1/0", None),
            ("-1", None),
            ("", None),
        ] {
            assert_eq!(seconds(speed, None), expected, "{speed}");
        }
    }

    #[test]
    fn round_numbers_are_replaced_by_powers_of_a_root_of_two() {
        for (speed, stops, power) in [
            ("1/8000", 3, -13.0),
            ("1/60", 3, -6.0),
            ("1/15", 3, -4.0),
            ("1/13", 3, -11.0 / 3.0),
            ("1/10", 3, -10.0 / 3.0),
            ("0.8", 3, -1.0 / 3.0),
            ("1.3", 3, 1.0 / 3.0),
            ("20", 3, 13.0 / 3.0),
            ("30", 3, 5.0),
            ("1/45", 2, -5.5),
            ("1/90", 2, -6.5),
        ] {
            let found = seconds(speed, Some(stops)).expect("it is a time");
            assert!((found.log2() - power).abs() < 1e-12, "{speed}: {found}");
        }
    }
}
