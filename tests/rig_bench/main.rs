//! The bench verbs on virtual devices, through the program: `rig preview`, `rig align`, `rig check`.

#[path = "../program/mod.rs"]
mod program;

mod align;
mod check;
mod preview;
mod support;
