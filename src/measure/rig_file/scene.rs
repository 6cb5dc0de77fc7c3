//! The table `[scene]` of a virtual rig: a scene to be traced, or a matrix.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::error::Error;
use crate::image::Resolution;
use crate::measure::rig_file::check::Check;
use crate::render::MAX_BOUNCES;
use crate::rig::VirtualScene;

/// The table as it is in the file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneTable {
    /// Width and height in pixels, of the projector and of the simulated photo before the camera resamples it.
    size: [usize; 2],
    /// The file of a scene to be traced.
    file: Option<PathBuf>,
    /// The file of a matrix, instead of a scene.
    matrix: Option<PathBuf>,
    camera: Option<String>,
    camera_file: Option<PathBuf>,
    samples: Option<u32>,
    max_bounces: Option<u32>,
    seed: Option<u32>,
}

impl SceneTable {
    /// The scene, with paths relative to `folder`.
    pub(crate) fn into_scene(self, check: &Check, folder: &Path) -> Result<VirtualScene, Error> {
        let [width, height] = self.size;
        for side in [width, height] {
            check.range("scene.size", side as f64, 1.0, 16384.0)?;
        }
        let size = Resolution::new(width, height);
        match (self.file, self.matrix) {
            (Some(file), None) => {
                let samples = self.samples.unwrap_or(64);
                let max_bounces = self.max_bounces.unwrap_or(6);
                check.range("scene.samples", samples.into(), 1.0, f64::from(1 << 20))?;
                check.range("scene.max_bounces", max_bounces.into(), 1.0, MAX_BOUNCES.into())?;
                if self.camera.is_some() && self.camera_file.is_some() {
                    return Err(check.fault(
                        "[scene] has both camera and camera_file",
                        "give the name of one of the scene's cameras, or a camera file with the poses of camera and projector",
                    ));
                }
                Ok(VirtualScene::File {
                    path: folder.join(file),
                    camera: self.camera,
                    camera_file: self.camera_file.map(|path| folder.join(path)),
                    size,
                    samples,
                    max_bounces,
                    seed: self.seed.unwrap_or(0),
                })
            }
            (None, Some(matrix)) => {
                let of_files = [
                    ("camera", self.camera.is_some()),
                    ("camera_file", self.camera_file.is_some()),
                    ("samples", self.samples.is_some()),
                    ("max_bounces", self.max_bounces.is_some()),
                    ("seed", self.seed.is_some()),
                ];
                if let Some((key, _)) = of_files.into_iter().find(|(_, given)| *given) {
                    return Err(check.fault(
                        format!("scene.{key} is an option of tracing, but scene.matrix needs no tracing"),
                        format!("leave out {key}, or give scene.file instead of scene.matrix"),
                    ));
                }
                Ok(VirtualScene::Matrix { path: folder.join(matrix), size })
            }
            _ => Err(check.fault(
                "[scene] needs either file or matrix",
                "give file = \"scene.glb\", or matrix = \"matrix.npz\" as `krylux matrix` writes it",
            )),
        }
    }
}
