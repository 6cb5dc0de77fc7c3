//! Virtual rigs: what their devices do to light, what measuring them gives back, and what their calibration finds.

#[path = "../common/mod.rs"]
mod common;
#[path = "../rig_support/mod.rs"]
mod rig_support;

mod calibration;
mod devices;
mod end_to_end;
mod snapshots;
mod stages;
