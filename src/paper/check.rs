//! A measured number: its bound, the score of a wrong answer, and what is known of the cause where it misses the bound.

/// The bound of a measured number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// At least this value.
    AtLeast(f64),
    /// At most this value.
    AtMost(f64),
    /// There is no bound, and the number is only reported.
    Stated,
}

/// A measured number with its bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// Quantity and unit.
    pub what: String,
    /// The measured value.
    pub value: f64,
    /// The bound.
    pub limit: Limit,
    /// The score of a wrong answer: its name and its value. A bound that the wrong answer meets proves nothing, and counts as missed.
    pub wrong: Option<(String, f64)>,
    /// The same number without one effect, which tells whether this effect is the cause of a miss: a phrase that names the effect, and the
    /// value.
    pub without: Option<(String, f64)>,
}

impl Limit {
    /// Whether a value meets the bound. NaN meets no bound, except [`Limit::Stated`].
    pub fn allows(self, value: f64) -> bool {
        match self {
            Self::AtLeast(limit) => value >= limit,
            Self::AtMost(limit) => value <= limit,
            Self::Stated => true,
        }
    }
}

impl Check {
    /// A quantity, with its unit, without a measured value yet.
    pub fn of(what: impl Into<String>) -> Self {
        Self { what: what.into(), value: f64::NAN, limit: Limit::Stated, wrong: None, without: None }
    }

    /// A number that must be `limit` or more.
    #[must_use]
    pub fn at_least(self, value: f64, limit: f64) -> Self {
        Self { value, limit: Limit::AtLeast(limit), ..self }
    }

    /// A number that must be `limit` or less.
    #[must_use]
    pub fn at_most(self, value: f64, limit: f64) -> Self {
        Self { value, limit: Limit::AtMost(limit), ..self }
    }

    /// A number without a bound.
    #[must_use]
    pub fn stated(self, value: f64) -> Self {
        Self { value, ..self }
    }

    /// Adds what a wrong answer scores. `name` is a plural or singular noun, for example `random labels`.
    #[must_use]
    pub fn refutes(self, name: impl Into<String>, value: f64) -> Self {
        Self { wrong: Some((name.into(), value)), ..self }
    }

    /// Adds the number without an effect that may be the cause of a miss. `effect` begins a sentence, for example `Without the blur`.
    #[must_use]
    pub fn without(self, effect: impl Into<String>, value: f64) -> Self {
        Self { without: Some((effect.into(), value)), ..self }
    }

    /// Adds the same number of the matrix itself, where the devices have no effect.
    #[must_use]
    pub(super) fn without_devices(self, value: f64) -> Self {
        self.without("Without the devices, on the matrix itself,", value)
    }

    /// Whether the number meets its bound, and the wrong answer does not.
    pub fn is_met(&self) -> bool {
        self.limit.allows(self.value) && !self.is_idle()
    }

    /// Whether the wrong answer meets the bound, too, or has no score.
    pub fn is_idle(&self) -> bool {
        let is_met = |value: f64| value.is_nan() || self.limit.allows(value);
        self.limit != Limit::Stated && self.wrong.as_ref().is_some_and(|(_, value)| is_met(*value))
    }

    /// The distance by which the number misses its bound; 0 if it meets the bound.
    pub fn shortfall(&self) -> f64 {
        match self.limit {
            limit if limit.allows(self.value) => 0.0,
            Limit::AtLeast(limit) => limit - self.value,
            Limit::AtMost(limit) => self.value - limit,
            Limit::Stated => 0.0,
        }
    }

    /// Why the number misses its bound, as far as numbers tell; empty if it meets the bound.
    pub fn cause(&self) -> String {
        if self.is_met() {
            return String::new();
        }
        if let (true, Some((name, value))) = (self.is_idle(), &self.wrong) {
            return format!(
                "The bound proves nothing here: the score of {name}, {}, meets it.",
                digits(*value)
            );
        }
        let Some((effect, value)) = &self.without else { return "The cause is not proven.".into() };
        let value_is = format!("{effect} it is {}", digits(*value));
        match self.limit.allows(*value) {
            true => format!("{value_is}, which meets the bound."),
            false => {
                format!("The cause is not proven: {}, which misses the bound, too.", lower_first(&value_is))
            }
        }
    }
}

fn lower_first(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_lowercase().chain(letters).collect())
}

/// A number with four significant digits. Counts are written in full.
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
    fn bounds_are_met_at_the_bound_and_missed_by_the_difference() {
        assert!(Check::of("purity").at_least(0.99, 0.99).is_met());
        assert!(Check::of("photos").at_most(12.0, 12.0).is_met());
        let missed = [Check::of("purity").at_least(0.75, 1.0), Check::of("photos").at_most(14.25, 14.0)];
        assert!(missed.iter().all(|check| !check.is_met() && check.shortfall() == 0.25));
        assert!(Check::of("seconds").stated(7.0).is_met());
    }

    #[test]
    fn a_cause_is_proven_only_by_a_number_that_meets_the_bound() {
        let purity = |value: f64| Check::of("purity").at_least(value, 0.99);
        assert_eq!(purity(1.0).without("Without noise", 1.0).cause(), "");
        assert_eq!(purity(0.5).cause(), "The cause is not proven.");
        let cause = |value: f64| purity(0.5).without("Without noise", value).cause();
        assert_eq!(cause(1.0), "Without noise it is 1, which meets the bound.");
        let not_proven = "The cause is not proven: without noise it is 0.625, which misses the bound, too.";
        assert_eq!(cause(0.625), not_proven);
    }

    #[test]
    fn a_bound_that_a_wrong_answer_meets_is_not_met() {
        let check = |wrong: f64| Check::of("index").at_most(0.25, 0.9).refutes("random labels", wrong);
        assert!(check(0.95).is_met() && !check(0.0).is_met() && !check(f64::NAN).is_met());
        assert_eq!(check(0.0).shortfall(), 0.0);
        assert!(check(0.0).cause().contains("random labels, 0, meets it"), "{}", check(0.0).cause());
        // A number that is only reported has no bound that could prove nothing.
        assert!(Check::of("index").stated(0.25).refutes("random labels", 0.0).is_met());
    }

    #[test]
    fn numbers_have_four_digits_and_counts_none_after_the_point() {
        let shown = [12.0, 0.99, 0.999_96, 1.018_43, 0.0, -0.5, 3.2e-9, f64::NAN, f64::INFINITY].map(digits);
        assert_eq!(shown, ["12", "0.99", "1", "1.018", "0", "−0.5", "3.2e−9", "none", "∞"]);
    }

    #[test]
    fn not_a_number_meets_no_bound() {
        let missed = [Check::of("a").at_least(f64::NAN, 0.0), Check::of("b").at_most(f64::NAN, 1.0)];
        assert!(missed.iter().all(|check| !check.is_met() && check.shortfall().is_nan()));
    }
}
