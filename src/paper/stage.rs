//! The figures' scenes, built in memory, and their traced matrices.

use std::sync::Arc;

use super::figure::{Content, Panel};
use crate::image::Resolution;
use crate::scene::{Lens, Scene, builtin};
use crate::transport::{Assembled, Part};

/// A scene of the figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Set {
    Zigzag,
    Corner,
    /// The corner with a projector whose lens is wide open and focused behind the scene.
    Defocused,
    /// The same with an equal camera lens, which makes the matrix symmetric again.
    BothDefocused,
    TwoSheets,
    /// The two sheets behind a post.
    Post,
    FoldedSheet,
    Carton,
    CartonEggs,
    /// The zigzag with the projector [`APART`] to the right of the camera.
    Apart,
    /// The same with projector and camera exchanged.
    Exchanged,
    /// The corner with the projector so many tenths of a millimetre to the right of the camera, and turned towards the point of the corner
    /// that the camera looks at.
    Beside(u32),
}

/// How far the projector of [`Set::Apart`] stands from the camera, in metres.
pub(super) const APART: f32 = 0.1;

/// The distance of the corner's edge from the camera, in metres: where the projector of [`Set::Beside`] looks.
pub(super) const EDGE: f32 = 1.2;

/// Walls at 0.6 to 1.2 m are blurred at 128 pixels per side by discs of radius 2.6 to 7.7 pixels.
const DEFOCUSED: Lens = Lens { radius: 0.035, focus: 2.4 };

impl Set {
    pub(super) fn is_out_of_focus(self) -> bool {
        matches!(self, Self::Defocused | Self::BothDefocused)
    }

    /// Whether projector and camera have the same pose and lens, so that the light transport is symmetric.
    pub(super) fn is_coaxial(self) -> bool {
        !matches!(self, Self::Defocused | Self::Apart | Self::Exchanged | Self::Beside(1..))
    }

    /// Light paths per pixel. With an open lens, direct light is sampled as well. At 256 paths the optimal pattern exploits the
    /// noise in the fixed matrix, a gain of five per cent that methods with few products cannot reach. Devices that are exchanged are traced a second
    /// time, with other paths, and both are to be the same scene.
    pub(super) fn samples(self) -> u32 {
        match self {
            Self::Defocused | Self::BothDefocused | Self::Apart | Self::Exchanged => 1024,
            _ => 256,
        }
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
            Self::Post => builtin::two_sheets_post().to_scene(),
            Self::FoldedSheet => builtin::folded_sheet().to_scene(),
            Self::Carton => builtin::nine_cells(false).to_scene(),
            Self::CartonEggs => builtin::nine_cells(true).to_scene(),
            Self::Apart | Self::Exchanged => {
                let mut scene = builtin::zigzag().to_scene();
                let mut projector = scene.camera.clone();
                projector.position += APART * projector.right;
                if self == Self::Exchanged {
                    std::mem::swap(&mut projector, &mut scene.camera);
                }
                scene.projector = Some(projector);
                scene
            }
            Self::Beside(0) => builtin::corner().to_scene(),
            Self::Beside(tenths) => {
                let mut scene = builtin::corner().to_scene();
                let beside = 1e-4 * tenths as f32;
                let mut projector = scene.camera.clone();
                let looks_at = projector.position + EDGE * projector.forward;
                projector.position += beside * projector.right;
                projector.forward = (looks_at - projector.position).normalize();
                projector.right = projector.forward.cross(projector.up).normalize();
                scene.projector = Some(projector);
                scene
            }
        }
    }
}

/// A traced scene.
pub(super) struct Stage {
    pub(super) set: Set,
    pub(super) resolution: Resolution,
    /// True region of each pixel.
    pub(super) truth: Vec<u8>,
    pub(super) traced: Arc<Assembled>,
}

impl Stage {
    pub(super) fn pixels(&self) -> usize {
        self.resolution.pixels()
    }

    /// The photo of `pattern` with direct and global light, in W/(m² sr).
    pub(super) fn photo(&self, pattern: &[f64]) -> Vec<f64> {
        let mut photo = vec![0.0; self.pixels()];
        self.traced.matrix.apply(Part::Full, 0, pattern, &mut photo);
        photo
    }

    /// The photo under white.
    pub(super) fn white(&self) -> Vec<f64> {
        self.photo(&vec![1.0; self.pixels()])
    }

    /// A picture of the scene's size.
    pub(super) fn panel(
        &self,
        name: impl Into<String>,
        caption: impl Into<String>,
        content: Content,
    ) -> Panel {
        Panel { name: name.into(), caption: caption.into(), resolution: self.resolution, content }
    }
}
