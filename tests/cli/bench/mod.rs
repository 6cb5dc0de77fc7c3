//! The verbs `rig preview`, `rig align` and `rig check` on virtual devices, run by the command line.

mod align;
mod bad;
mod check;
mod preview;
mod support;
