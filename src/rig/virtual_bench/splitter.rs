//! The beam splitter of a virtual rig: what it adds to the camera's picture.

use serde::Deserialize;

/// The faults of the beam splitter that the camera looks through. By default there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Splitter {
    /// The share of a second image of the scene, which is reflected at the splitter's back.
    pub ghost: f64,
    /// The displacement of the second image to the right and down, in projector pixels.
    pub ghost_shift: [f64; 2],
    /// Light of the projector that reaches all camera pixels evenly without the scene, for instance from a light trap that reflects:
    /// for a white frame this share of the mean of the white photo, and for another frame in proportion to its mean light.
    pub stray: f64,
}
