//! What a low-rank model answered.

use crate::image::Image;

/// A pattern relit.
#[derive(Clone, Debug)]
pub struct Relit {
    /// The pattern's name.
    pub name: String,
    /// What is projected.
    pub pattern: Image,
    /// The photo by the model, ambient light included.
    pub relit: Image,
    /// The true photo, where the scene is simulated.
    pub truth: Option<Image>,
    /// `‖relit − true‖ / ‖true‖` of the projector's light, for each number of photos from 1; empty without the true photo.
    pub errors: Vec<f64>,
}

/// A dual photograph.
#[derive(Clone, Debug)]
pub struct Dual {
    /// The name of the pattern on the camera's side.
    pub name: String,
    /// `Aᵀ y`.
    pub image: Image,
    /// The relative error, where the scene is simulated.
    pub error: Option<f64>,
}

/// A photo without its interreflections.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// The photo's name.
    pub name: String,
    /// The photo, without ambient light.
    pub photo: Image,
    /// `D A⁻¹ y` by the model.
    pub direct: Image,
    /// The same by the true matrix, where the scene is simulated.
    pub truth: Option<Image>,
    /// `‖direct − true‖ / ‖true‖`.
    pub error: Option<f64>,
    /// The share of the photo that the model left unexplained.
    pub residual: f64,
}

/// The model's error after so many photos, in the Frobenius norm of the global part of the matrix.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RankRow {
    /// Photos.
    pub photos: usize,
    /// Of the model; with symmetry, where the rig has it.
    pub error: f64,
    /// Of `W Qᵀ` alone.
    pub one_sided: f64,
    /// The least that any matrix of this rank has.
    pub optimal: Option<f64>,
}
