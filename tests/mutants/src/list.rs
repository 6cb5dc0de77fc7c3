//! The list of mutants, as `cargo mutants --list --json` gives it. What a mutant is, is defined there and nowhere else.

use std::path::Path;
use std::process::Command;

use serde::{Deserialize, Serialize};

use crate::Fallible;

/// A place in a file: lines and columns count from one, columns in characters.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct Place {
    /// The line.
    pub line: usize,
    /// The column.
    pub column: usize,
}

/// The replaced text. The syntax tree knows its end.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct Span {
    /// The first character.
    pub start: Place,
}

/// One entry of the list.
#[derive(Clone, Debug, Deserialize)]
pub struct Listed {
    /// The name, which has the file, the line and the change.
    pub name: String,
    /// The file, relative to the project.
    pub file: String,
    /// The kind of change.
    pub genre: Genre,
    /// The text that takes the place of what stands at the span.
    pub replacement: String,
    /// The replaced text.
    pub span: Span,
}

/// The kinds of changes that cargo-mutants makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Genre {
    /// The body of a function becomes a value.
    FnValue,
    /// A binary operator becomes another, also one that assigns.
    BinaryOperator,
    /// A unary operator is left out.
    UnaryOperator,
    /// An arm of a match with a wildcard is left out.
    MatchArm,
    /// The guard of an arm becomes true or false.
    MatchArmGuard,
    /// A field of a structure with a base is left out.
    StructField,
}

/// All mutants of the rooms, in the order of the list.
pub fn mutants(program: &Path, project: &Path, rooms: &[String]) -> Fallible<Vec<Listed>> {
    let mut command = Command::new(program);
    command
        .arg("mutants")
        .args(["--list", "--json", "--no-config", "--colors", "never"])
        .current_dir(project);
    for room in rooms {
        command.args(["-f", &format!("src/{room}/**")]);
    }
    let said = command.output().map_err(|why| format!("{} cannot be started: {why}", program.display()))?;
    if !said.status.success() {
        return Err(format!("cargo mutants --list failed: {}", String::from_utf8_lossy(&said.stderr)).into());
    }
    Ok(serde_json::from_slice(&said.stdout)?)
}
