//! One line of `krylux rig check`.

use anyhow::Result;
use serde::Serialize;

use super::super::super::console::Console;
use crate::error::Error;

/// How something was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Grade {
    Ok,
    Warning,
    Fails,
}

/// What was found, what was expected, and what to do.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Finding {
    name: &'static str,
    pub(super) grade: Grade,
    found: String,
    #[serde(skip_serializing_if = "String::is_empty")]
    expected: String,
    #[serde(skip_serializing_if = "String::is_empty")]
    help: String,
}

impl Finding {
    pub(super) fn ok(name: &'static str, found: impl Into<String>) -> Self {
        Self { name, grade: Grade::Ok, found: found.into(), expected: String::new(), help: String::new() }
    }

    pub(super) fn graded(
        name: &'static str,
        grade: Grade,
        found: impl Into<String>,
        expected: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        // What is as it should be needs no advice.
        let help = if grade == Grade::Ok { String::new() } else { help.into() };
        Self { name, grade, found: found.into(), expected: expected.into(), help }
    }

    /// What keeps it from being looked at.
    pub(super) fn error(name: &'static str, error: &Error) -> Self {
        let text = error.to_string();
        let (found, help) = text.split_once("\n  help: ").unwrap_or((&text, ""));
        Self::graded(name, Grade::Fails, found, "", help)
    }

    /// `exposure     warning  found; expected …: what to do`; what is fine needs neither of the latter.
    fn line(&self) -> String {
        let grade = match self.grade {
            Grade::Ok => "ok",
            Grade::Warning => "warning",
            Grade::Fails => "FAILS",
        };
        let mut line = format!("{:<13} {grade:<7}  {}", self.name, self.found);
        if self.grade != Grade::Ok {
            if !self.expected.is_empty() {
                line.push_str(&format!("; expected: {}", self.expected));
            }
            if !self.help.is_empty() {
                line.push_str(&format!(" → {}", self.help));
            }
        }
        line
    }
}

/// All lines, each said as soon as it is found.
pub(super) struct Findings {
    pub(super) all: Vec<Finding>,
    console: Console,
}

impl Findings {
    pub(super) fn new(console: &Console) -> Self {
        Self { all: Vec::new(), console: console.clone() }
    }

    pub(super) fn add(&mut self, finding: Finding) -> Result<()> {
        self.console.say(finding.line())?;
        self.all.push(finding);
        Ok(())
    }

    pub(super) fn count(&self, grade: Grade) -> usize {
        self.all.iter().filter(|finding| finding.grade == grade).count()
    }

    /// The verdict as a sentence; `whole` if nothing was left out because of what failed.
    pub(super) fn sentence(&self, whole: bool) -> String {
        let [warnings, failures] = [self.count(Grade::Warning), self.count(Grade::Fails)];
        match (failures, warnings, whole) {
            (0, 0, _) => "The bench is ready.".into(),
            (0, warnings, _) => format!("The bench can be used; {warnings} warning{}.", plural(warnings)),
            (failures, _, true) => {
                format!("The bench is not ready: {failures} check{} failed.", plural(failures))
            }
            (_, _, false) => "The bench is not ready; what comes after the failure was not looked at.".into(),
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
    fn an_error_is_told_apart_into_what_was_found_and_what_to_do() {
        let error =
            Error::Rig { device: "camera".into(), fault: "it is off".into(), help: "switch it on".into() };
        let finding = Finding::error("camera", &error);
        assert_eq!(finding.line(), "camera        FAILS    camera: it is off → switch it on");
        let fine = Finding::graded("disk", Grade::Ok, "3 GB free", "1 GB", "delete something");
        assert_eq!(fine.line(), "disk          ok       3 GB free");
    }
}
