//! A file with all its mutants in it, each behind a switch.
//!
//! `a + b` becomes `(match (a, b) { (l, r) => match crate::mutant::at(9) { 17 => l - r, 18 => l * r, _ => l + r } })`:
//! the operands are evaluated once and in their order, and temporary values keep their lifetimes.

use std::ops::Range;

use crate::sites::{Found, Shape};

/// A mutant that has found its place.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Its number, which switches it on.
    pub number: u32,
    /// Whether the change is one of the guard alone, where an arm may lose its guard or itself.
    pub of_guard: bool,
    /// The text of the list.
    pub replacement: String,
}

/// A place with its mutants.
#[derive(Clone, Debug)]
pub struct Site {
    /// Its number, by which it is known whether a test reaches it.
    pub number: u32,
    /// Its place.
    pub found: Found,
    /// The mutants that can be switched on there.
    pub mutants: Vec<Placed>,
}

/// The owner of a part of the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// All that stands for a site.
    Site(u32),
    /// The change of one mutant.
    Mutant(u32),
}

/// Text whose parts have owners.
#[derive(Default, Debug)]
pub struct Text {
    /// The text.
    pub text: String,
    /// Its owned parts; a part within another comes after it or before it.
    pub owned: Vec<(Range<usize>, Owner)>,
}

impl Text {
    fn push(&mut self, text: &str) {
        self.text.push_str(text);
    }

    fn append(&mut self, other: Self) {
        let shift = self.text.len();
        self.push(&other.text);
        self.owned.extend(
            other.owned.into_iter().map(|(range, owner)| (range.start + shift..range.end + shift, owner)),
        );
    }

    fn owned(&mut self, owner: Owner, text: &str) {
        let start = self.text.len();
        self.push(text);
        self.owned.push((start..self.text.len(), owner));
    }
}

/// Writes a file with switches at its sites.
pub fn rewrite(source: &str, mut sites: Vec<Site>) -> Text {
    // Outer edits come before inner ones, and insertions come before edits that start at the same byte.
    sites.sort_by_key(|site| {
        let range = &site.found.range;
        (range.start, !range.is_empty(), std::cmp::Reverse(range.end))
    });
    let sites: Vec<&Site> = sites.iter().collect();
    part(source, 0..source.len(), &sites)
}

/// A part of a file, with the sites that lie in it.
fn part(source: &str, range: Range<usize>, sites: &[&Site]) -> Text {
    let inside = |site: &&Site, range: &Range<usize>| {
        range.start <= site.found.range.start && site.found.range.end <= range.end
    };
    let sites: Vec<&Site> = sites.iter().copied().filter(|site| inside(site, &range)).collect();
    let mut out = Text::default();
    let mut at = range.start;
    let mut next = 0;
    while next < sites.len() {
        let site = sites[next];
        let within = &site.found.range;
        let children = if within.is_empty() {
            0
        } else {
            sites[next + 1..].iter().take_while(|child| inside(child, within)).count()
        };
        out.push(&source[at..within.start]);
        let start = out.text.len();
        switch(source, site, &sites[next + 1..next + 1 + children], &mut out);
        out.owned.push((start..out.text.len(), Owner::Site(site.number)));
        at = within.end;
        next += 1 + children;
    }
    out.push(&source[at..range.end]);
    out
}

/// The arms of the switch: each mutant's, and what the source says.
fn arms<'a>(
    site: &Site,
    mutants: impl Iterator<Item = (&'a Placed, String)>,
    unchanged: &str,
    out: &mut Text,
) {
    out.push(&format!("match crate::mutant::at({}) {{ ", site.number));
    for (mutant, does) in mutants {
        out.owned(Owner::Mutant(mutant.number), &format!("{} => {does}, ", mutant.number));
    }
    out.push(&format!("_ => {unchanged} }}"));
}

/// The text that stands for a site.
fn switch(source: &str, site: &Site, inner: &[&Site], out: &mut Text) {
    let mutants = || site.mutants.iter();
    match &site.found.shape {
        Shape::Body => {
            out.push(" ");
            arms(site, mutants().map(|m| (m, format!("return {}", m.replacement))), "{}", out);
            out.push(";");
        }
        Shape::Unary { operand, operator } => {
            out.push("(match (");
            out.append(part(source, operand.clone(), inner));
            out.push(") { v => ");
            arms(site, mutants().map(|m| (m, "v".to_owned())), &format!("{operator}v"), out);
            out.push(" })");
        }
        Shape::Field { member, value, base } => {
            out.push(&format!("{member}: "));
            let unchanged = part(source, value.clone(), inner);
            out.push(&format!("match crate::mutant::at({}) {{ ", site.number));
            for mutant in mutants() {
                let does = format!("{} => ({}).{member}, ", mutant.number, &source[base.clone()]);
                out.owned(Owner::Mutant(mutant.number), &does);
            }
            out.push("_ => ");
            out.append(unchanged);
            out.push(" }");
        }
        Shape::Arm { guard } => arm(source, site, guard.as_ref(), inner, out),
        Shape::Binary { left, right, operator } => {
            let (left, right) = (part(source, left.clone(), inner), part(source, right.clone(), inner));
            binary(site, left, operator, right, out);
        }
    }
}

/// The guard of an arm. An arm that is left out has a guard that is false.
fn arm(source: &str, site: &Site, guard: Option<&Range<usize>>, inner: &[&Site], out: &mut Text) {
    out.push(&format!(" if (match crate::mutant::at({}) {{ ", site.number));
    for mutant in &site.mutants {
        let does = if mutant.of_guard { &mutant.replacement } else { "false" };
        out.owned(Owner::Mutant(mutant.number), &format!("{} => {does}, ", mutant.number));
    }
    out.push("_ => ");
    match guard {
        Some(guard) => out.append(part(source, guard.clone(), inner)),
        None => out.push("true"),
    }
    out.push(" })");
}

fn binary(site: &Site, left: Text, operator: &str, right: Text, out: &mut Text) {
    let mutants = || site.mutants.iter();
    match operator {
        // The right operand is evaluated only where its value matters. With the mutant it is so where it was not.
        "&&" | "||" => {
            out.push("({ let l: bool = ");
            out.append(left);
            let stays = if operator == "&&" { "!=" } else { "==" };
            let on: Vec<String> = mutants().map(|m| m.number.to_string()).collect();
            out.push(&format!(
                "; if l {stays} (matches!(crate::mutant::at({}), {})) {{ ",
                site.number,
                on.join(" | ")
            ));
            out.append(right);
            out.push(" } else { l } })");
        }
        "==" | "!=" | "<" | ">" | "<=" | ">=" => {
            out.push("(match (&(");
            out.append(left);
            out.push("), &(");
            out.append(right);
            out.push(")) { (l, r) => ");
            arms(
                site,
                mutants().map(|m| (m, format!("*l {} *r", m.replacement))),
                &format!("*l {operator} *r"),
                out,
            );
            out.push(" })");
        }
        _ if operator.ends_with('=') => {
            // Numbers evaluate the right operand first. The place is written once for each mutant, without switches in it
            // but for the unchanged operator.
            out.push("(match (");
            out.append(right);
            out.push(") { r => ");
            out.push(&format!("match crate::mutant::at({}) {{ ", site.number));
            for mutant in mutants() {
                out.push(&format!("{} => {{ ", mutant.number));
                let start = out.text.len();
                out.append(Text { text: left.text.clone(), owned: left.owned.clone() });
                out.push(&format!(" {} r; ", mutant.replacement));
                out.owned.push((start..out.text.len(), Owner::Mutant(mutant.number)));
                out.push("} ");
            }
            out.push("_ => { ");
            out.append(left);
            out.push(&format!(" {operator} r; }} }} }})"));
        }
        _ => {
            out.push("(match (");
            out.append(left);
            out.push(", ");
            out.append(right);
            out.push(") { (l, r) => ");
            arms(
                site,
                mutants().map(|m| (m, format!("l {} r", m.replacement))),
                &format!("l {operator} r"),
                out,
            );
            out.push(" })");
        }
    }
}
