//! A small program with every kind of mutant: it is switched, compiled once, and run with each mutant on.

#![allow(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::path::Path;
use std::process::Command;

use crate::list::{Genre, Listed, Place, Span};
use crate::plan;
use crate::rewrite::{Owner, rewrite};
use crate::sites::Places;

const SOURCE: &str = r#"
#[derive(Clone, Default)]
struct Pair { a: i32, b: i32 }
const FIXED: i32 = 2 + 3;
fn body() -> i32 { 7 }
fn nested(a: i32, b: i32) -> i32 { a * (b + 1) - 2 }
fn short(a: bool, b: &mut i32) -> bool { a && { *b += 1; *b > 1 } }
fn arm(n: i32) -> i32 { match n { 1 => 10, k if k > 5 => 20, _ => 30 } }
fn field() -> i32 { let base = Pair { a: 1, b: 2 }; let pair = Pair { a: 5, ..base }; pair.a * 10 + pair.b }
fn unary(x: bool) -> i32 { if !x { -4 } else { 4 } }
fn chain(x: Option<i32>) -> bool { if let Some(x) = x && x == 3 { true } else { false } }
fn main() {
    let mut calls = 0;
    let short = (short(false, &mut calls), short(true, &mut calls), calls);
    println!("{} {} {} {:?} {} {} {} {} {} {}", FIXED, body(), nested(3, 4), short, arm(1), arm(6), arm(2),
        field(), unary(true), chain(Some(3)));
}
"#;

/// The output with all mutants off.
const UNCHANGED: &str = "5 7 13 (false, false, 1) 10 20 30 52 4 true";

/// The mutant of a kind at the `which`th place of a text in the source, counted from zero.
fn mutant(genre: Genre, text: &str, which: usize, replacement: &str) -> Listed {
    let (at, _) = SOURCE.match_indices(text).nth(which).unwrap();
    let line = SOURCE[..at].matches('\n').count() + 1;
    let column = at - SOURCE[..at].rfind('\n').unwrap();
    let name = format!("{text} becomes {replacement}");
    let span = Span { start: Place { line, column } };
    Listed { name, file: "src/room/file.rs".into(), genre, replacement: replacement.into(), span }
}

/// Mutants, and what is printed with each.
fn cases() -> Vec<(Listed, &'static str)> {
    use Genre::{BinaryOperator, FnValue, MatchArm, MatchArmGuard, StructField, UnaryOperator};
    vec![
        (mutant(FnValue, "7 }", 0, "1"), "5 1 13 (false, false, 1) 10 20 30 52 4 true"),
        (mutant(BinaryOperator, "* (b", 0, "+"), "5 7 6 (false, false, 1) 10 20 30 52 4 true"),
        (mutant(BinaryOperator, "+ 1)", 0, "-"), "5 7 7 (false, false, 1) 10 20 30 52 4 true"),
        (mutant(BinaryOperator, "+ 1)", 0, "*"), "5 7 10 (false, false, 1) 10 20 30 52 4 true"),
        (mutant(BinaryOperator, "- 2", 0, "+"), "5 7 17 (false, false, 1) 10 20 30 52 4 true"),
        (mutant(BinaryOperator, "&& {", 0, "||"), "5 7 13 (false, true, 1) 10 20 30 52 4 true"),
        (mutant(BinaryOperator, "+= 1", 0, "-="), "5 7 13 (false, false, -1) 10 20 30 52 4 true"),
        (mutant(BinaryOperator, "> 1", 0, ">="), "5 7 13 (false, true, 1) 10 20 30 52 4 true"),
        (mutant(MatchArm, "1 => 10", 0, ""), "5 7 13 (false, false, 1) 30 20 30 52 4 true"),
        (mutant(MatchArm, "k if", 0, ""), "5 7 13 (false, false, 1) 10 30 30 52 4 true"),
        (mutant(MatchArmGuard, "k > 5", 0, "true"), "5 7 13 (false, false, 1) 10 20 20 52 4 true"),
        (mutant(BinaryOperator, "> 5", 0, "<"), "5 7 13 (false, false, 1) 10 30 20 52 4 true"),
        (mutant(StructField, "a: 5", 0, ""), "5 7 13 (false, false, 1) 10 20 30 12 4 true"),
        (mutant(UnaryOperator, "!x", 0, ""), "5 7 13 (false, false, 1) 10 20 30 52 -4 true"),
    ]
}

#[test]
fn every_kind_of_mutant_is_switched_on_by_its_number_in_one_build() {
    let cases = cases();
    let listed: Vec<(u32, &Listed)> = (1..).zip(cases.iter().map(|(listed, _)| listed)).collect();
    let places = Places::of(&syn::parse_file(SOURCE).unwrap());
    let (mutants, sites) = plan::place(SOURCE, &places, &listed);
    assert!(mutants.iter().all(|mutant| mutant.left_out.is_none()), "{mutants:?}");

    let folder = std::env::temp_dir().join(format!("krylux-mutants-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let text = rewrite(SOURCE, sites).text;
    std::fs::write(folder.join("main.rs"), format!("#![allow(warnings)]\nmod mutant;\n{text}")).unwrap();
    let switch = include_str!("switch.rs.txt").replace("SITES", "100");
    std::fs::write(folder.join("mutant.rs"), switch).unwrap();
    let rustc = Command::new("rustc")
        .args(["--edition", "2024", "main.rs", "-o", "program"])
        .current_dir(&folder)
        .status();
    assert!(rustc.unwrap().success(), "{text}");

    assert_eq!(printed(&folder, None), UNCHANGED);
    for (number, (listed, expected)) in (1..).zip(&cases) {
        assert_eq!(printed(&folder, Some(number)), *expected, "{}", listed.name);
    }
    let reached = reached(&folder);
    // Two mutants of one operator share a place; the guard that is left out shares it with the arm.
    let sites: Vec<u32> =
        mutants.iter().map(|mutant| mutant.site).filter(|site| reached.contains(site)).collect();
    assert_eq!(sites, [1, 2, 3, 3, 5, 6, 7, 8, 9, 10, 10, 12, 13, 14]);
    std::fs::remove_dir_all(&folder).unwrap();
}

fn printed(folder: &Path, mutant: Option<u32>) -> String {
    let mut command = Command::new(folder.join("program"));
    command.env_remove("KRYLUX_REACHED").env_remove("KRYLUX_MUTANT");
    if let Some(number) = mutant {
        command.env("KRYLUX_MUTANT", number.to_string());
    }
    String::from_utf8(command.output().unwrap().stdout).unwrap().trim().to_owned()
}

fn reached(folder: &Path) -> Vec<u32> {
    let file = folder.join("reached");
    let program = Command::new(folder.join("program")).env("KRYLUX_REACHED", &file).output();
    assert!(program.unwrap().status.success());
    let bytes = std::fs::read(file).unwrap();
    bytes.chunks_exact(4).map(|bytes| u32::from_le_bytes(bytes.try_into().unwrap())).collect()
}

#[test]
fn what_cannot_be_switched_is_left_out_with_a_reason() {
    let constant = mutant(Genre::BinaryOperator, "+ 3", 0, "-");
    let chain = mutant(Genre::BinaryOperator, "&& x ==", 0, "||");
    let nowhere = mutant(Genre::BinaryOperator, "println", 0, "-");
    let places = Places::of(&syn::parse_file(SOURCE).unwrap());
    let (mutants, sites) = plan::place(SOURCE, &places, &[(1, &constant), (2, &chain), (3, &nowhere)]);
    let reasons: Vec<&str> = mutants.iter().filter_map(|mutant| mutant.left_out.as_deref()).collect();
    assert_eq!(reasons, ["constant context", "chain with let", "not found in the syntax tree"]);
    assert!(sites.is_empty());
}

#[test]
fn an_error_in_one_arm_of_a_switch_belongs_to_that_mutant() {
    let subtract = mutant(Genre::BinaryOperator, "+ 1)", 0, "-");
    let multiply = mutant(Genre::BinaryOperator, "+ 1)", 0, "*");
    let places = Places::of(&syn::parse_file(SOURCE).unwrap());
    let (_, sites) = plan::place(SOURCE, &places, &[(1, &subtract), (2, &multiply)]);
    let text = rewrite(SOURCE, sites);
    let owners: Vec<(&str, Owner)> =
        text.owned.iter().map(|(range, owner)| (&text.text[range.clone()], *owner)).collect();
    assert_eq!(owners[0], ("1 => l - r, ", Owner::Mutant(1)));
    assert_eq!(owners[1], ("2 => l * r, ", Owner::Mutant(2)));
    let (whole, owner) = owners[2];
    assert_eq!(owner, Owner::Site(1));
    assert_eq!(
        whole,
        "(match (b, 1) { (l, r) => match crate::mutant::at(1) { 1 => l - r, 2 => l * r, _ => l + r } })"
    );
}
