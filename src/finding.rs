//! Findings about a bench or a result. Only findings decide the colour of a page, the exit status of a verb, and whether a bench can be
//! used.

use std::borrow::Cow;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// A measured value violates its bound if it lies more than this many standard errors beyond the bound.
pub const SIGMAS: f64 = 3.0;

/// The seriousness of a finding. Grades ascend from the least serious.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// Nothing is amiss.
    Ok,
    /// Nothing could be measured, so nothing is confirmed.
    Unmeasured,
    /// The bench or the result can be used, but something should be improved.
    Warning,
    /// The bench or the result cannot be used in this state.
    Fails,
}

impl Grade {
    /// The grade as one word. A failure is written in capitals.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Unmeasured => "no data",
            Self::Warning => "warning",
            Self::Fails => "FAILS",
        }
    }
}

/// The result of one check: the state found, the expected state and the remedy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// The subject of the check, in a word or two: `disk`, `pixel map`.
    pub name: Cow<'static, str>,
    /// The seriousness of the finding.
    pub grade: Grade,
    /// The measured value, if the grade follows from a measured value.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub value: Option<f64>,
    /// The standard error of the value.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub error: Option<f64>,
    /// The bound on the value. `None` when the value is not judged.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub bound: Option<f64>,
    /// The state that was found.
    pub found: String,
    /// The expected state. It is empty when the finding states no bound.
    #[serde(skip_serializing_if = "String::is_empty", default)]
    pub expected: String,
    /// The remedy. It is empty when nothing needs to be done.
    #[serde(skip_serializing_if = "String::is_empty", default)]
    pub help: String,
}

impl Finding {
    /// A finding of the expected state.
    pub fn ok(name: &'static str, found: impl Into<String>) -> Self {
        Self::graded(name, Grade::Ok, found, "", "")
    }

    /// A finding with a grade. `help` is dropped when the grade is [`Grade::Ok`].
    pub fn graded(
        name: &'static str,
        grade: Grade,
        found: impl Into<String>,
        expected: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        let help = if grade == Grade::Ok { String::new() } else { help.into() };
        let (name, found, expected) = (name.into(), found.into(), expected.into());
        Self { name, grade, value: None, error: None, bound: None, found, expected, help }
    }

    /// A finding that something cannot be measured. `because` is a clause with the reason.
    pub fn unmeasured(name: &'static str, because: impl fmt::Display) -> Self {
        Self::graded(name, Grade::Unmeasured, format!("not measured, because {because}"), "", "")
    }

    /// A finding about a value with a standard error and an upper bound. The grade is `beyond` if the value exceeds the bound by more than
    /// [`SIGMAS`] standard errors, or if the standard error is NaN.
    pub fn at_most(
        name: &'static str,
        [value, error, bound]: [f64; 3],
        beyond: Grade,
        found: impl Into<String>,
        expected: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        let grade = if value - SIGMAS * error <= bound { Grade::Ok } else { beyond };
        Self::graded(name, grade, found, expected, help).measured(value, error, bound)
    }

    /// Like [`Self::at_most`], for a value with a lower bound.
    pub fn at_least(
        name: &'static str,
        [value, error, bound]: [f64; 3],
        beyond: Grade,
        found: impl Into<String>,
        expected: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        Self::at_most(name, [-value, error, -bound], beyond, found, expected, help)
            .measured(value, error, bound)
    }

    /// A finding about a share of the light. The share and its standard error are judged like [`Self::at_most`]. The text `passes` explains
    /// a share that is within the bound, and `fails` explains a share beyond the bound.
    pub fn judged(
        name: &'static str,
        share: Ratio,
        error: f64,
        bound: f64,
        [passes, fails]: [&str; 2],
    ) -> Self {
        let Some(value) = share.value() else {
            return Self::unmeasured(name, "there is no light to compare it with");
        };
        let expected = format!("at most {} %", percent(bound));
        let mut finding = Self::at_most(name, [value, error, bound], Grade::Fails, "", expected, "");
        let meaning = if finding.grade == Grade::Ok { passes } else { fails };
        finding.found = format!("{} % ± {} %: {meaning}", percent(value), percent(error));
        finding
    }

    /// A finding about a share of the light that is reported but not judged.
    pub fn told(name: &'static str, share: Ratio, error: f64, meaning: &str) -> Self {
        let Some(value) = share.value() else {
            return Self::unmeasured(name, "there is no light to compare it with");
        };
        let finding = Self::ok(name, format!("{} % ± {} %: {meaning}", percent(value), percent(error)));
        Self { value: Some(value), error: Some(error), ..finding }
    }

    /// Adds the numbers that determine the grade of the finding.
    #[must_use]
    pub fn measured(self, value: f64, error: f64, bound: f64) -> Self {
        Self { value: Some(value), error: Some(error), bound: Some(bound), ..self }
    }

    /// A failed finding about an error that prevents the check.
    pub fn error(name: &'static str, error: &Error) -> Self {
        let text = error.to_string();
        let (found, help) = text.split_once("\n  help: ").unwrap_or((&text, ""));
        Self::graded(name, Grade::Fails, found, "", help)
    }

    /// Returns [`Error::Rig`] with the finding's name, state and remedy if the finding fails.
    pub fn require(&self) -> Result<(), Error> {
        if self.grade != Grade::Fails {
            return Ok(());
        }
        let fault = format!("{}: {} ({} expected)", self.name, self.found, self.expected);
        Err(Error::rig("rig", fault).help(&self.help))
    }
}

/// One line: `exposure      warning  found; expected: … → what to do`. It ends after `found` if the grade is [`Grade::Ok`].
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<13} {:<7}  {}", self.name, self.grade.word(), self.found)?;
        if self.grade == Grade::Ok {
            return Ok(());
        }
        if !self.expected.is_empty() {
            write!(f, "; expected: {}", self.expected)?;
        }
        if !self.help.is_empty() {
            write!(f, " → {}", self.help)?;
        }
        Ok(())
    }
}

/// The most serious grade among the findings, or [`Grade::Ok`] if there are no findings.
pub fn worst<'a>(findings: impl IntoIterator<Item = &'a Finding>) -> Grade {
    findings.into_iter().map(|finding| finding.grade).max().unwrap_or(Grade::Ok)
}

/// Adds the findings `more` to `into`. If two findings have the same name, only the more serious finding is kept.
pub fn merge(into: &mut Vec<Finding>, more: impl IntoIterator<Item = Finding>) {
    for finding in more {
        match into.iter_mut().find(|known| known.name == finding.name) {
            Some(known) if known.grade < finding.grade => *known = finding,
            Some(_) => {}
            None => into.push(finding),
        }
    }
}

/// A share of the light in per cent, with a precision that suits it.
pub(crate) fn percent(share: f64) -> String {
    match 100.0 * share {
        0.0 => "0".into(),
        value if value.abs() >= 10.0 => format!("{value:.0}"),
        value if value.abs() >= 0.01 => format!("{value:.2}"),
        value => format!("{value:.0e}"),
    }
}

/// All findings of a check, in the order of examination.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// The findings.
    pub all: Vec<Finding>,
    /// True if the check is complete. A failure may prevent the remaining examinations.
    pub complete: bool,
}

impl Findings {
    /// The number of findings with this grade.
    pub fn count(&self, grade: Grade) -> usize {
        self.all.iter().filter(|finding| finding.grade == grade).count()
    }

    /// Returns true if the check is complete and nothing failed.
    pub fn passed(&self) -> bool {
        self.complete && self.count(Grade::Fails) == 0
    }

    /// The result of the check as a sentence.
    pub fn sentence(&self) -> String {
        let warnings = self.count(Grade::Warning) + self.count(Grade::Unmeasured);
        let failures = self.count(Grade::Fails);
        match (failures, warnings, self.complete) {
            (0, 0, true) => "The bench is ready.".into(),
            (0, warnings, true) => format!("The bench can be used; {warnings} warning{}.", plural(warnings)),
            (failures, _, true) => {
                format!("The bench is not ready: {failures} check{} failed.", plural(failures))
            }
            (_, _, false) => "The bench is not ready; what follows the failure was not checked.".into(),
        }
    }
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

/// A ratio that has a value only if the denominator exceeds [`SIGMAS`] of its standard errors. Otherwise, nothing can be measured. The
/// value is never infinite or NaN. A ratio displays as a percentage of three digits, such as `3.14 %`, or as `–` without a value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Ratio(Option<f64>);

impl Ratio {
    /// `numerator / denominator`, where `error` is the standard error of the denominator. The error is 0 for an exact denominator.
    pub fn of(numerator: f64, denominator: f64, error: f64) -> Self {
        let is_measured = denominator.abs() > SIGMAS * error;
        Self(Some(numerator / denominator).filter(|value| is_measured && value.is_finite()))
    }

    /// `numerator / ‖v‖` for a vector `v` of measured values, each given with its variance. The contribution of noise is subtracted from
    /// `‖v‖²`. The ratio has no value if the remainder is within [`SIGMAS`] standard errors of this sum of squares. If the values are only
    /// noise, they exceed this threshold in one case of 45 for a single value, in one of 246 for 64 values, and in one of 741 for many
    /// values. The chances differ because the sum of few squares has a skewed distribution.
    pub fn to_length(numerator: f64, measured: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let [mut excess, mut spread] = [0.0; 2];
        for [value, variance] in measured {
            excess += value * value - variance;
            spread += 2.0 * variance * variance;
        }
        // Under noise alone, `excess` has the standard error √spread and the threshold SIGMAS · √spread. `of` compares the roots of both.
        Self::of(numerator, excess.max(0.0).sqrt(), (spread.sqrt() / SIGMAS).sqrt())
    }

    /// The ratio, or `None` if nothing can be measured.
    pub fn value(self) -> Option<f64> {
        self.0
    }

    /// The percentage as text without the sign `%`.
    pub fn percent(self) -> String {
        let Some(value) = self.0 else { return "–".into() };
        let percent = 100.0 * value;
        let decimals = match percent.abs() {
            100.0.. => 0,
            10.0.. => 1,
            _ => 2,
        };
        format!("{percent:.decimals$}")
    }
}

/// Converts a share that is known exactly. An infinite share or NaN becomes a ratio without a value.
impl From<f64> for Ratio {
    fn from(share: f64) -> Self {
        Self(Some(share).filter(|share| share.is_finite()))
    }
}

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.percent())?;
        if self.0.is_some() { f.write_str(" %") } else { Ok(()) }
    }
}

/// Formats a number with `decimals` decimals, as in `0.1235`. This text must have two or more significant digits, and at most nine digits
/// before the point. Otherwise the number has `decimals` significant digits (at least three) and a power of ten, as in `1.235e-7`. Only
/// zero is shown as zero.
pub fn decimal(value: f64, decimals: usize) -> String {
    let least = 10_f64.powi(1 - decimals as i32);
    if value == 0.0 || !value.is_finite() || (least..1e9).contains(&value.abs()) {
        return format!("{value:.decimals$}");
    }
    let digits = decimals.max(3) - 1;
    format!("{value:.digits$e}")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::{decimal, *};

    #[test]
    fn an_error_is_split_into_what_was_found_and_what_to_do() {
        let error = Error::rig("camera", "it is off").help("switch it on");
        let finding = Finding::error("camera", &error);
        assert_eq!(finding.to_string(), "camera        FAILS    camera: it is off → switch it on");
        let fine = Finding::graded("disk", Grade::Ok, "3 GB free", "1 GB", "delete something");
        assert_eq!(fine.to_string(), "disk          ok       3 GB free");
    }

    #[test]
    fn the_sentence_counts_failures_before_warnings() {
        let of = |grades: &[Grade], complete: bool| {
            let all = grades.iter().map(|&grade| Finding::graded("disk", grade, "found", "bound", "help"));
            Findings { all: all.collect(), complete }
        };
        let (ok, warning, fails) = (Grade::Ok, Grade::Warning, Grade::Fails);
        let several = of(&[ok, warning, fails, fails, fails, warning], true);
        assert_eq!([ok, warning, fails].map(|grade| several.count(grade)), [1, 2, 3]);
        for (grades, complete, passed, sentence) in [
            (&[ok, ok][..], true, true, "The bench is ready."),
            (&[ok, warning], true, true, "The bench can be used; 1 warning."),
            (&[warning, warning], true, true, "The bench can be used; 2 warnings."),
            (&[warning, fails], true, false, "The bench is not ready: 1 check failed."),
            (&[fails, ok, fails], true, false, "The bench is not ready: 2 checks failed."),
            (&[fails], false, false, "The bench is not ready; what follows the failure was not checked."),
            (&[ok], false, false, "The bench is not ready; what follows the failure was not checked."),
        ] {
            let found = of(grades, complete);
            assert_eq!((found.passed(), found.sentence().as_str()), (passed, sentence));
        }
    }

    #[test]
    fn a_share_fails_only_beyond_what_noise_explains_and_nothing_is_no_pass() {
        let judged =
            |share: f64, error| Finding::judged("x", share.into(), error, 0.01, ["fine", "broken"]).grade;
        assert_eq!(judged(0.009, 0.0), Grade::Ok);
        assert_eq!(judged(0.02, 0.004), Grade::Ok, "within three standard errors of the bound");
        assert_eq!(judged(0.03, 0.004), Grade::Fails);
        assert_eq!(judged(f64::NAN, 0.0), Grade::Unmeasured);
        assert_eq!(judged(0.0, f64::NAN), Grade::Fails);
    }

    #[test]
    fn of_two_findings_of_one_name_the_more_serious_one_is_kept() {
        let of = |name, grade| Finding::graded(name, grade, "found", "", "help");
        let mut all = vec![of("drift", Grade::Ok), of("light", Grade::Warning)];
        merge(&mut all, [of("drift", Grade::Fails), of("light", Grade::Ok), of("noise", Grade::Unmeasured)]);
        let grades: Vec<Grade> = all.iter().map(|finding| finding.grade).collect();
        assert_eq!(grades, [Grade::Fails, Grade::Warning, Grade::Unmeasured]);
        assert_eq!((worst(&all), worst(&all[1..]), worst(&[])), (Grade::Fails, Grade::Warning, Grade::Ok));
        assert!(all[0].require().is_err() && all[1].require().is_ok());
        let text = serde_json::to_string(&all).expect("findings can be written");
        assert_eq!(serde_json::from_str::<Vec<Finding>>(&text).expect("and read"), all);
    }

    /// The numerators and denominators have every size, and include zeros, infinities and NaN.
    #[test]
    fn a_ratio_is_a_number_beyond_the_error_of_its_denominator_or_nothing() {
        let mut random = Pcg64::seed_from_u64(3);
        let ends = [0.0, -0.0, f64::MIN_POSITIVE, 1e-310, f64::MAX, f64::INFINITY, f64::NAN];
        let mut draw = || match random.random_range(0..3) {
            0 => ends[random.random_range(0..ends.len())],
            _ => 10_f64.powf(random.random_range(-200.0..200.0)) * [1.0, -1.0][random.random_range(0..2)],
        };
        let mut nothing = 0;
        for _ in 0..10_000 {
            let [numerator, denominator] = [draw(), draw()];
            let error = draw().abs();
            for (ratio, error) in [
                (Ratio::of(numerator, denominator, error), error),
                (Ratio::of(numerator, denominator, 0.0), 0.0),
            ] {
                match ratio.value() {
                    Some(value) => {
                        assert!(value.is_finite() && denominator.abs() > 3.0 * error);
                        assert_eq!(value, numerator / denominator);
                        assert!(ratio.to_string().ends_with(" %"));
                    }
                    None => {
                        nothing += 1;
                        assert_eq!(ratio.to_string(), "–");
                        let is_number = (numerator / denominator).is_finite() && !error.is_nan();
                        assert!(!is_number || denominator.abs() <= 3.0 * error);
                    }
                }
            }
        }
        assert!((1000..19_000).contains(&nothing), "{nothing}");
    }

    #[test]
    fn noise_alone_has_no_length() {
        let mut random = Pcg64::seed_from_u64(5);
        let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let found = |light: f64| -> usize {
            let measured = |_| {
                let values: Vec<[f64; 2]> = (0..64).map(|_| [light + normal(), 1.0]).collect();
                Ratio::to_length(1.0, values).value().is_some()
            };
            (0..1000).map(measured).filter(|&is_measured| is_measured).count()
        };
        // With noise alone, a sum of 64 squares exceeds 64 + 3 √128 in 4 of 1000 cases (χ²). With light as strong as noise, the sum exceeds
        // this value in 945 cases; with light 1.5 times as strong, in all cases except a share of 1e-5 (noncentral χ²). The bounds are four
        // deviations of such counts.
        let [noise, faint, light] = [0.0, 1.0, 1.5].map(found);
        assert!(noise <= 12 && (916..=974).contains(&faint) && light == 1000, "{noise} {faint} {light}");
        let exact = Ratio::to_length(2.0, [[3.0, 0.0], [4.0, 0.0]]);
        assert_eq!((exact.value(), Ratio::to_length(0.0, [[0.0; 2]; 2]).value()), (Some(0.4), None));
    }

    #[test]
    fn percentages_have_three_digits() {
        let shown = |share: f64| Ratio::from(share).percent();
        assert_eq!([1.5, 0.25, 0.0123, -0.5, f64::NAN].map(shown), ["150", "25.0", "1.23", "-50.0", "–"]);
    }

    proptest! {
        #[test]
        fn numbers_of_every_size_are_shown_within_their_digits(
            mantissa in 1.0_f64..10.0, power in -30..=30, sign in prop::sample::select(vec![-1.0, 1.0]), decimals in 3_usize..9,
        ) {
            let value = sign * mantissa * 10_f64.powi(power);
            let text = decimal(value, decimals);
            let shown: f64 = text.parse().expect("a number");
            prop_assert!(text.bytes().any(|digit| (b'1'..=b'9').contains(&digit)), "{value:e} is shown as {text}");
            // The bound is half of the last digit, plus the rounding in this test's arithmetic.
            let last = match text.contains('e') {
                true => 10_f64.powi(1 - decimals as i32) * value.abs(),
                false => 10_f64.powi(-(decimals as i32)),
            };
            prop_assert!((shown - value).abs() <= 0.5 * last + 1e-15 * value.abs(), "{value:e} is shown as {text}");
            prop_assert!((shown / value - 1.0).abs() < 0.05, "{value:e} is shown as {text}");
        }
    }

    #[test]
    fn usual_numbers_have_their_decimals_and_others_a_power_of_ten() {
        let shown =
            [0.25, 0.0, -0.0123, 9.87654e-4, -3.2e-12, 12_345.678_9, f64::NAN].map(|value| decimal(value, 4));
        assert_eq!(shown, ["0.2500", "0.0000", "-0.0123", "9.877e-4", "-3.200e-12", "12345.6789", "NaN"]);
    }
}
