//! The figures' scenes, made in memory, and what they become when they are traced.

use crate::image::Resolution;
use crate::scene::{Lens, Scene, builtin};
use crate::transport::{Assembled, MatrixOperator, Part};

/// A scene of the figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Set {
    Zigzag,
    Corner,
    /// The corner, by a projector whose lens is wide open and focused behind it.
    Defocused,
    TwoSheets,
    FacingSheets,
    Room,
    Carton,
    CartonEggs,
}

impl Set {
    pub(super) fn scene(self) -> Scene {
        match self {
            Self::Zigzag => builtin::zigzag().to_scene(),
            Self::Corner => builtin::corner().to_scene(),
            Self::Defocused => {
                let mut scene = builtin::corner().to_scene();
                let mut projector = scene.camera.clone();
                // Walls from 0.6 to 1.2 m away: at 128 pixels a side blurred over discs of 1 to 3 pixels' radius.
                projector.lens = Lens { radius: 0.015, focus: 2.4 };
                scene.projector = Some(projector);
                scene
            }
            Self::TwoSheets => builtin::two_sheets().to_scene(),
            Self::FacingSheets => builtin::facing_sheets().to_scene(),
            Self::Room => builtin::white_room().to_scene(),
            Self::Carton => builtin::nine_cells(false).to_scene(),
            Self::CartonEggs => builtin::nine_cells(true).to_scene(),
        }
    }
}

/// A traced scene.
pub(super) struct Stage {
    pub(super) traced: Assembled,
    /// The true region of each pixel.
    pub(super) truth: Vec<u8>,
    pub(super) resolution: Resolution,
}

impl Stage {
    /// The light itself, as the ideal rig sees it; what an answer is judged by, whoever took the photos.
    pub(super) fn ideal(&self, part: Part) -> MatrixOperator<'_> {
        MatrixOperator { matrix: &self.traced.matrix, part, channel: 0 }
    }

    pub(super) fn pixels(&self) -> usize {
        self.resolution.pixels()
    }

    /// The photo of `pattern` by all its light.
    pub(super) fn photo(&self, pattern: &[f64]) -> Vec<f64> {
        let mut photo = vec![0.0; self.pixels()];
        self.traced.matrix.apply(Part::Full, 0, pattern, &mut photo);
        photo
    }
}
