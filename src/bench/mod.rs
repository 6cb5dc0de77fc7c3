//! Checks of a bench before its photos are trusted. Each check results in a list of [`Finding`](crate::finding::Finding)s.
//!
//! | question | module |
//! |---|---|
//! | can the devices of this rig file be used? | [`rig_check`] |
//! | what does the camera see right now? | [`preview`] |
//! | do camera and projector share one centre of projection? | [`align`] |
//! | is the source a linear, symmetric operator? | [`audit`] |

pub mod align;
pub mod audit;
pub mod preview;
pub mod rig_check;
