//! Where a bench stands.

/// The last good frame and the time after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamp {
    /// The camera's number of the frame.
    pub id: u64,
    /// Seconds on the rig's clock when it was there.
    pub time: f64,
}
