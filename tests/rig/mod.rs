//! Virtual rigs: what their devices do to light, what measuring them gives back, and what their calibration finds.

mod calibration;
mod devices;
mod end_to_end;
mod snapshots;
mod stages;
