//! Numbers and their bounds, as text and as JSON.

use serde_json::{Value, json};

use crate::paper::{Check, Limit, Reproduced};
use crate::report::html::{Number, Outcome, Verdict};

/// Whether a number has a bound.
pub(super) fn is_judged(check: &Check) -> bool {
    check.limit != Limit::Stated
}

/// `met`, or the number of missed bounds.
pub(super) fn verdict(made: &Reproduced) -> Verdict {
    let judged = made.checks.iter().filter(|check| is_judged(check)).count();
    let missed = made.checks.iter().filter(|check| !check.is_met()).count();
    if missed == 0 {
        Verdict { outcome: Outcome::Good, sentence: "met".into() }
    } else {
        Verdict { outcome: Outcome::Short, sentence: format!("{missed} of {judged} not met") }
    }
}

/// A number for the page.
pub(super) fn number(check: &Check) -> Number {
    let bound = match check.limit {
        Limit::AtLeast(limit) => format!("at least {} wanted", digits(limit)),
        Limit::AtMost(limit) => format!("at most {} wanted", digits(limit)),
        Limit::Stated => String::new(),
    };
    let (wanted, outcome) = match (is_judged(check), check.is_met()) {
        (false, _) => (bound, None),
        (true, true) => (format!("{bound}: met"), Some(Outcome::Good)),
        (true, false) => {
            let mut missed = format!("{bound}: not met, by {}", digits(check.shortfall()));
            if !check.cause().is_empty() {
                missed += &format!(". {}", check.cause());
            }
            (missed, Some(Outcome::Short))
        }
    };
    Number { what: check.what.clone(), value: digits(check.value), wanted, outcome }
}

/// A figure's numbers as JSON; values that are not finite become null.
pub(super) fn json(made: &Reproduced) -> Value {
    let check = |check: &Check| {
        let (bound, limit) = match check.limit {
            Limit::AtLeast(limit) => ("at least", Some(limit)),
            Limit::AtMost(limit) => ("at most", Some(limit)),
            Limit::Stated => ("stated", None),
        };
        json!({ "what": check.what, "value": check.value, "bound": bound, "limit": limit, "met": check.is_met(), "cause": check.cause() })
    };
    json!({
        "figure": made.figure.name(),
        "rig": made.rig.name(),
        "setting": made.setting,
        "met": made.is_met(),
        "photos": made.photos,
        "frames": made.frames,
        "seconds": made.seconds,
        "checks": made.checks.iter().map(check).collect::<Vec<_>>(),
    })
}

/// A number with four significant digits; counts are written in full.
pub(super) fn digits(value: f64) -> String {
    let text = match value.abs() {
        _ if value.is_nan() => "none".into(),
        size if size.is_infinite() => "∞".into(),
        size if size == size.round() && size < 1e6 => format!("{value:.0}"),
        size if (1e-3..1e5).contains(&size) => {
            let decimals = (3.0 - size.log10().floor()).clamp(0.0, 6.0) as usize;
            let text = format!("{value:.decimals$}");
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        }
        _ => format!("{value:.1e}"),
    };
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits_and_counts_none_after_the_point() {
        let shown = [12.0, 0.99, 0.999_96, 1.018_43, 0.0, -0.5, 3.2e-9, f64::NAN, f64::INFINITY].map(digits);
        assert_eq!(shown, ["12", "0.99", "1", "1.018", "0", "−0.5", "3.2e−9", "none", "∞"]);
    }

    #[test]
    fn what_is_missed_says_by_how_much_and_what_is_stated_says_nothing() {
        let missed = number(&Check::at_least("purity", 0.75, 0.99));
        assert_eq!(
            (missed.outcome, missed.wanted.as_str()),
            (Some(Outcome::Short), "at least 0.99 wanted: not met, by 0.24")
        );
        let met = number(&Check::at_most("photos", 9.0, 12.0));
        assert_eq!((met.outcome, met.wanted.as_str()), (Some(Outcome::Good), "at most 12 wanted: met"));
        let stated = number(&Check::stated("optimum, %", 4.2));
        assert_eq!((stated.outcome, stated.wanted.as_str()), (None, ""));
    }
}
