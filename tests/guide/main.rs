//! The guide and the README: every command in them runs, every link and every file name leads somewhere, every figure of a report has a
//! definition, and the reference is what the command line says of itself.

#![allow(clippy::panic, reason = "a failed test panics")]

mod blocks;
mod commands;
#[allow(dead_code, reason = "the generator of the guide uses the rest")]
#[path = "../../examples/regenerate_guide/gallery.rs"]
mod gallery;
mod glossary;
mod links;
mod pages;
#[allow(dead_code, reason = "the generator of the guide uses the rest")]
#[path = "../../examples/regenerate_guide/panels.rs"]
mod panels;
#[path = "../../examples/regenerate_guide/reference.rs"]
mod reference;
mod references;
mod same_text;
mod security;
mod workplace;
