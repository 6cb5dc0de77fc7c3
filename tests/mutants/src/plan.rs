//! The mutants with their numbers and places: which can be switched, and why the others cannot.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::Fallible;
use crate::list::{Genre, Listed, Place};
use crate::rewrite::{Placed, Site};
use crate::sites::{Found, Places, Shape};

/// A mutant as the runner knows it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Mutant {
    /// Its number, from 1 in the order of the list.
    pub number: u32,
    /// The number of its place: that of the first mutant there.
    pub site: u32,
    /// The name that cargo-mutants gives it.
    pub name: String,
    /// The room of the file.
    pub room: String,
    /// The line of the source.
    pub code: String,
    /// Why it is left out.
    pub left_out: Option<String>,
}

/// A file of the list.
pub struct Source {
    /// Relative to the project.
    pub file: String,
    /// Its content.
    pub text: String,
    /// Its places with mutants.
    pub sites: Vec<Site>,
}

/// All mutants, and the files with their places.
pub struct Plan {
    /// In the order of the list.
    pub mutants: Vec<Mutant>,
    /// Each file once.
    pub sources: Vec<Source>,
}

/// The bytes at which the lines of a text begin.
struct Lines<'a>(Vec<(usize, &'a str)>);

impl<'a> Lines<'a> {
    fn of(text: &'a str) -> Self {
        let start = text.as_ptr() as usize;
        Self(text.split('\n').map(|line| (line.as_ptr() as usize - start, line)).collect())
    }

    /// The byte of a place.
    fn byte(&self, place: Place) -> usize {
        let Some((start, line)) = self.0.get(place.line - 1) else { return 0 };
        start + line.char_indices().nth(place.column - 1).map_or(line.len(), |(byte, _)| byte)
    }
}

/// The place of a mutant in its file.
fn find(places: &Places, genre: Genre, start: usize) -> Option<&Found> {
    match genre {
        Genre::FnValue => places.body(start),
        Genre::BinaryOperator | Genre::UnaryOperator => places.operators.get(&start),
        Genre::MatchArm => places.arms.get(&start),
        Genre::MatchArmGuard => places.guards.get(&start),
        Genre::StructField => places.fields.get(&start),
    }
}

/// Finds the place of every mutant.
pub fn plan(project: &Path, listed: &[Listed]) -> Fallible<Plan> {
    let mut plan = Plan { mutants: Vec::new(), sources: Vec::new() };
    let mut files: BTreeMap<&str, Vec<(u32, &Listed)>> = BTreeMap::new();
    for (number, one) in (1..).zip(listed) {
        files.entry(&one.file).or_default().push((number, one));
    }
    for (file, listed) in files {
        let text = std::fs::read_to_string(project.join(file))?;
        let places = Places::of(&syn::parse_file(&text).map_err(|why| format!("{file}: {why}"))?);
        let (mutants, sites) = place(&text, &places, &listed);
        plan.mutants.extend(mutants);
        plan.sources.push(Source { file: file.to_owned(), text, sites });
    }
    plan.mutants.sort_by_key(|mutant| mutant.number);
    Ok(plan)
}

/// The mutants of one file at their places.
pub fn place(text: &str, places: &Places, listed: &[(u32, &Listed)]) -> (Vec<Mutant>, Vec<Site>) {
    let lines = Lines::of(text);
    let mut sites: BTreeMap<(usize, usize, bool), Site> = BTreeMap::new();
    let mut mutants = Vec::new();
    for &(number, one) in listed {
        let found = find(places, one.genre, lines.byte(one.span.start));
        let left_out = match found {
            None => Some("not found in the syntax tree".to_owned()),
            Some(found) => found.barred.map(str::to_owned),
        };
        let mut site = number;
        if let (Some(found), None) = (found, &left_out) {
            let body = matches!(found.shape, Shape::Body);
            let entry = sites.entry((found.range.start, found.range.end, body));
            let entry = entry.or_insert_with(|| Site { number, found: found.clone(), mutants: Vec::new() });
            let of_guard = one.genre == Genre::MatchArmGuard;
            entry.mutants.push(Placed { number, of_guard, replacement: one.replacement.clone() });
            site = entry.number;
        }
        let room = one.file.split('/').nth(1).unwrap_or_default().to_owned();
        let code = lines.0.get(one.span.start.line - 1).map_or("", |(_, line)| line.trim()).to_owned();
        mutants.push(Mutant { number, site, name: one.name.clone(), room, code, left_out });
    }
    (mutants, sites.into_values().collect())
}
