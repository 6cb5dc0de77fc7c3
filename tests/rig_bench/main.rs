//! The verbs `rig preview`, `rig align` and `rig check` on virtual devices, run by the command line.

#[path = "../program/mod.rs"]
mod program;

mod align;
mod check;
mod preview;
mod support;
