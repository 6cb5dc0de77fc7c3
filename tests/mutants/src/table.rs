//! The table of the rooms, and the reasons for what survived.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde::Deserialize;

use crate::Fallible;
use crate::plan::Mutant;
use crate::trial::{Outcome, Trial};

/// A reason that covers the mutants whose name and line of code contain its texts.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reason {
    /// A part of the mutant's name without line and column, such as `src/io/picture/mod.rs: replace * with +`.
    pub mutant: String,
    /// A part of the line of code.
    #[serde(default)]
    pub code: String,
    /// Why no test needs to catch it.
    pub reason: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Reasons {
    #[serde(default)]
    survivor: Vec<Reason>,
}

/// The reasons of a file.
pub fn reasons(file: &Path) -> Fallible<Vec<Reason>> {
    let reasons: Reasons = toml::from_str(&std::fs::read_to_string(file)?)?;
    Ok(reasons.survivor)
}

/// A name without its line and column, which change with every edit above.
pub fn without_place(name: &str) -> String {
    let parts: Vec<&str> = name.splitn(4, ':').collect();
    match parts[..] {
        [file, _, _, change] => format!("{file}:{change}"),
        _ => name.to_owned(),
    }
}

impl Reason {
    /// Whether this is the reason of a mutant.
    pub fn covers(&self, mutant: &Mutant) -> bool {
        without_place(&mutant.name).contains(&self.mutant) && mutant.code.contains(&self.code)
    }
}

#[derive(Default)]
struct Row {
    listed: usize,
    switched: usize,
    outcomes: BTreeMap<Outcome, usize>,
    explained: usize,
}

impl Row {
    fn of(&self, outcomes: &[Outcome]) -> usize {
        outcomes.iter().filter_map(|outcome| self.outcomes.get(outcome)).sum()
    }
}

/// The table in Markdown, and what survived below it.
pub fn table(mutants: &[Mutant], trials: &BTreeMap<String, Trial>, reasons: &[Reason]) -> String {
    let mut rows: BTreeMap<&str, Row> = BTreeMap::new();
    let mut left_out: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    let mut survivors = String::new();
    for mutant in mutants {
        let row = rows.entry(&mutant.room).or_default();
        row.listed += 1;
        if let Some(reason) = &mutant.left_out {
            *left_out.entry((&mutant.room, reason)).or_default() += 1;
            continue;
        }
        row.switched += 1;
        let Some(trial) = trials.get(&mutant.name) else { continue };
        *row.outcomes.entry(trial.outcome).or_default() += 1;
        if matches!(trial.outcome, Outcome::Caught | Outcome::TimedOut) {
            continue;
        }
        let reason = reasons.iter().find(|reason| reason.covers(mutant));
        row.explained += usize::from(reason.is_some());
        let said = reason.map_or("not explained", |reason| &reason.reason);
        survivors += &format!("{:?}: {}\n    {}\n    {said}\n", trial.outcome, mutant.name, mutant.code);
    }
    let mut out = String::from(
        "| room | listed | switched | tried | caught | of these by time | survived | not reached | explained | caught of tried |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (room, row) in &rows {
        let tried: usize = row.outcomes.values().sum();
        let caught = row.of(&[Outcome::Caught, Outcome::TimedOut]);
        let share = if tried == 0 { 0.0 } else { 100.0 * caught as f64 / tried as f64 };
        let survived = row.of(&[Outcome::Survived, Outcome::SurvivedSoFar]);
        out += &format!(
            "| {room} | {} | {} | {tried} | {caught} | {} | {survived} | {} | {} | {share:.1} % |\n",
            row.listed,
            row.switched,
            row.of(&[Outcome::TimedOut]),
            row.of(&[Outcome::Unreached]),
            row.explained,
        );
    }
    out += "\nLeft out:\n";
    for ((room, reason), count) in left_out {
        out += &format!("{count:5} in {room}: {reason}\n");
    }
    let unused: BTreeSet<&str> = reasons
        .iter()
        .filter(|reason| !mutants.iter().any(|mutant| reason.covers(mutant)))
        .map(|reason| reason.mutant.as_str())
        .collect();
    for reason in unused {
        out += &format!("A reason covers no mutant any more: {reason}\n");
    }
    out + "\nNot caught:\n" + &survivors
}
