//! The verbs at the bench, on virtual devices: `rig preview`, `rig align`, `rig check`, through the program.

mod align;
mod check;
mod preview;
mod support;
