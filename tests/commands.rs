//! The program: its commands, the painting page, and the journal of a program that is killed.

#![allow(clippy::panic, reason = "a failed test panics")]

mod common;
mod program;

mod cli;
mod journal;
mod paint;
