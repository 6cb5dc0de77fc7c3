//! A finding of the check, and all of them together.

use std::fmt;

use serde::Serialize;

use crate::error::Error;

/// How serious a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// As expected.
    Ok,
    /// The rig can be used, but something should be improved.
    Warning,
    /// The rig cannot be used like this.
    Fails,
}

/// What was found of one thing, what was expected, and what to do.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was examined, in a word or two: `disk`, `pixel map`.
    pub name: &'static str,
    /// How serious it is.
    pub grade: Grade,
    /// What was found.
    pub found: String,
    /// What was expected. It is empty when the finding states no bound.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub expected: String,
    /// What to do. It is empty when nothing need be done.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub help: String,
}

impl Finding {
    /// A finding that is as expected.
    pub(super) fn ok(name: &'static str, found: impl Into<String>) -> Self {
        Self { name, grade: Grade::Ok, found: found.into(), expected: String::new(), help: String::new() }
    }

    /// A finding with a grade. `help` is dropped when the grade is [`Grade::Ok`].
    pub(super) fn graded(
        name: &'static str,
        grade: Grade,
        found: impl Into<String>,
        expected: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        let help = if grade == Grade::Ok { String::new() } else { help.into() };
        Self { name, grade, found: found.into(), expected: expected.into(), help }
    }

    /// An error that prevents the examination.
    pub(super) fn error(name: &'static str, error: &Error) -> Self {
        let text = error.to_string();
        let (found, help) = text.split_once("\n  help: ").unwrap_or((&text, ""));
        Self::graded(name, Grade::Fails, found, "", help)
    }
}

/// One line: `exposure      warning  found; expected: … → what to do`. The last two are left out of a finding
/// that is as expected.
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let grade = match self.grade {
            Grade::Ok => "ok",
            Grade::Warning => "warning",
            Grade::Fails => "FAILS",
        };
        write!(f, "{:<13} {grade:<7}  {}", self.name, self.found)?;
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

/// All findings of a check, in the order of the examination.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// The findings.
    pub all: Vec<Finding>,
    /// Whether everything was examined. A failure may prevent the rest.
    pub complete: bool,
}

impl Findings {
    /// How many findings have this grade.
    pub fn count(&self, grade: Grade) -> usize {
        self.all.iter().filter(|finding| finding.grade == grade).count()
    }

    /// Whether nothing fails.
    pub fn passed(&self) -> bool {
        self.count(Grade::Fails) == 0
    }

    /// The result of the check as a sentence.
    pub fn sentence(&self) -> String {
        let [warnings, failures] = [self.count(Grade::Warning), self.count(Grade::Fails)];
        match (failures, warnings, self.complete) {
            (0, 0, _) => "The bench is ready.".into(),
            (0, warnings, _) => format!("The bench can be used; {warnings} warning{}.", plural(warnings)),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_split_into_what_was_found_and_what_to_do() {
        let error =
            Error::Rig { device: "camera".into(), fault: "it is off".into(), help: "switch it on".into() };
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
        ] {
            let found = of(grades, complete);
            assert_eq!((found.passed(), found.sentence().as_str()), (passed, sentence));
        }
    }
}
