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
    /// The corner, by such a projector and through such a camera: that is symmetric again.
    BothDefocused,
    TwoSheets,
    FacingSheets,
    Room,
    Carton,
    CartonEggs,
}

/// Walls from 0.6 to 1.2 m away: at 128 pixels a side blurred over discs of 1 to 3 pixels' radius.
const DEFOCUSED: Lens = Lens { radius: 0.015, focus: 2.4 };

impl Set {
    pub(super) fn is_out_of_focus(self) -> bool {
        matches!(self, Self::Defocused | Self::BothDefocused)
    }

    /// Light paths per pixel. Through an open lens direct light is sampled, too: at 256 paths the best pattern makes use of the noise that is
    /// frozen into the matrix, which costs any method that has not seen all of it five per cent.
    pub(super) fn samples(self) -> u32 {
        if self.is_out_of_focus() { 1024 } else { 256 }
    }

    pub(super) fn scene(self) -> Scene {
        match self {
            Self::Zigzag => builtin::zigzag().to_scene(),
            Self::Corner => builtin::corner().to_scene(),
            Self::Defocused => {
                let mut scene = builtin::corner().to_scene();
                let mut projector = scene.camera.clone();
                projector.lens = DEFOCUSED;
                scene.projector = Some(projector);
                scene
            }
            Self::BothDefocused => {
                let mut scene = builtin::corner().to_scene();
                scene.camera.lens = DEFOCUSED;
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
    /// Whether some lens is out of focus.
    pub(super) out_of_focus: bool,
}

impl Stage {
    /// The light itself, as the ideal rig sees it; what an answer is judged by, whoever took the photos.
    pub(super) fn ideal(&self, part: Part) -> MatrixOperator<'_> {
        MatrixOperator::new(&self.traced.matrix, part, 0)
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
