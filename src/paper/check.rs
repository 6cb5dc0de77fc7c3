//! A measured number and its bound.

/// The bound of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// At least this value.
    AtLeast(f64),
    /// At most this value.
    AtMost(f64),
    /// No bound: the number is reported only.
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
    /// Why the number misses its bound where it does; empty where nothing is known of that.
    pub cause: String,
}

impl Check {
    /// A number that must be `limit` or more.
    pub fn at_least(what: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { what: what.into(), value, limit: Limit::AtLeast(limit), cause: String::new() }
    }

    /// A number that must be `limit` or less.
    pub fn at_most(what: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { what: what.into(), value, limit: Limit::AtMost(limit), cause: String::new() }
    }

    /// A number without a bound.
    pub fn stated(what: impl Into<String>, value: f64) -> Self {
        Self { what: what.into(), value, limit: Limit::Stated, cause: String::new() }
    }

    /// The same number, and why it misses its bound if it does.
    #[must_use]
    pub fn because(self, cause: impl Into<String>) -> Self {
        Self { cause: cause.into(), ..self }
    }

    /// The cause of a missed bound; empty where it is met, or where no cause is known.
    pub fn cause(&self) -> &str {
        if self.is_met() { "" } else { &self.cause }
    }

    /// Whether the number meets its bound. NaN meets no bound, except [`Limit::Stated`].
    pub fn is_met(&self) -> bool {
        match self.limit {
            Limit::AtLeast(limit) => self.value >= limit,
            Limit::AtMost(limit) => self.value <= limit,
            Limit::Stated => true,
        }
    }

    /// The distance by which the number misses its bound; 0 if it meets it.
    pub fn shortfall(&self) -> f64 {
        match self.limit {
            _ if self.is_met() => 0.0,
            Limit::AtLeast(limit) => limit - self.value,
            Limit::AtMost(limit) => self.value - limit,
            Limit::Stated => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_met_at_the_bound_and_missed_by_the_difference() {
        assert!(Check::at_least("purity", 0.99, 0.99).is_met());
        assert!(Check::at_most("photos", 12.0, 12.0).is_met());
        let missed = [Check::at_least("purity", 0.75, 1.0), Check::at_most("photos", 14.25, 14.0)];
        assert!(missed.iter().all(|check| !check.is_met() && check.shortfall() == 0.25));
        assert!(Check::stated("seconds", 7.0).is_met());
        let of = |value: f64| Check::at_least("purity", value, 0.99).because("the lamp is off");
        assert_eq!([of(1.0).cause(), of(0.5).cause()], ["", "the lamp is off"]);
    }

    #[test]
    fn not_a_number_meets_no_bound() {
        let missed = [Check::at_least("a", f64::NAN, 0.0), Check::at_most("b", f64::NAN, 1.0)];
        assert!(missed.iter().all(|check| !check.is_met() && check.shortfall().is_nan()));
    }
}
