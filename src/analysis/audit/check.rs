//! One line of an audit.

use serde::Serialize;

/// The outcome of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Within the bound, or beyond it by no more than noise explains.
    Passes,
    /// Beyond the bound.
    Fails,
    /// The figure is reported, but not judged.
    Told,
}

/// One line of an audit. Figures are relative: 0.01 is one per cent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// The check's name, e.g. `additivity`.
    pub name: &'static str,
    /// Its outcome.
    pub verdict: Verdict,
    /// The measured figure.
    pub figure: f64,
    /// The figure's standard error.
    pub error: f64,
    /// The largest figure that passes; infinite where nothing is judged.
    #[serde(skip_serializing_if = "is_infinite")]
    pub bound: f64,
    /// What the figure means, and what to do if the check fails.
    pub meaning: String,
}

fn is_infinite(bound: &f64) -> bool {
    bound.is_infinite()
}

/// A check fails when its figure exceeds the bound by more than this many standard errors.
const SIGMAS: f64 = 3.0;

impl Check {
    /// A figure judged against a bound.
    pub(super) fn judged(
        name: &'static str,
        figure: f64,
        error: f64,
        bound: f64,
        passes: &str,
        fails: &str,
    ) -> Self {
        // NaN does not pass.
        let within = figure - SIGMAS * error <= bound;
        let (verdict, meaning) = if within { (Verdict::Passes, passes) } else { (Verdict::Fails, fails) };
        Self { name, verdict, figure, error, bound, meaning: meaning.into() }
    }

    /// A figure that is not judged.
    pub(super) fn told(name: &'static str, figure: f64, error: f64, meaning: String) -> Self {
        Self { name, verdict: Verdict::Told, figure, error, bound: f64::INFINITY, meaning }
    }

    /// The check as a line of text: `additivity     pass   0.12 % ± 0.05 %, at most 1 %: …`
    pub fn line(&self) -> String {
        let verdict = match self.verdict {
            Verdict::Passes => "pass",
            Verdict::Fails => "FAIL",
            Verdict::Told => "    ",
        };
        let bound = if self.bound.is_finite() {
            format!(", at most {} %", percent(self.bound))
        } else {
            String::new()
        };
        format!(
            "{:<13} {verdict}  {} % ± {} %{bound}: {}",
            self.name,
            percent(self.figure),
            percent(self.error),
            self.meaning
        )
    }
}

fn percent(share: f64) -> String {
    match 100.0 * share {
        0.0 => "0".into(),
        value if value.abs() >= 10.0 => format!("{value:.0}"),
        value if value.abs() >= 0.01 => format!("{value:.2}"),
        value => format!("{value:.0e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_fails_only_beyond_what_noise_explains() {
        let judged = |figure, error| Check::judged("x", figure, error, 0.01, "fine", "broken").verdict;
        assert_eq!(judged(0.009, 0.0), Verdict::Passes);
        assert_eq!(judged(0.02, 0.004), Verdict::Passes, "within three standard errors of the bound");
        assert_eq!(judged(0.03, 0.004), Verdict::Fails);
        assert_eq!(judged(f64::NAN, 0.0), Verdict::Fails);
    }
}
