//! The painting page: what its server answers and refuses, and, in a browser, what a user does with it.

#![allow(clippy::panic, reason = "a failed test panics")]

#[path = "../program/mod.rs"]
mod program;

mod browser;
mod hostile;
mod painting;
mod served;
