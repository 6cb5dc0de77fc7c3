//! Rig files: where camera and projector stand, in TOML.
//!
//! ```toml
//! [camera]
//! position = [0.0, 0.2, 1.5]      # metres
//! look_at = [0.0, 0.0, 0.0]       # or `forward = [0.0, -0.1, -1.0]`
//! up = [0.0, 1.0, 0.0]            # what it is when left out
//! vertical_fov_degrees = 40.0
//! aperture_radius = 0.01          # metres; a pinhole when left out
//! focus_distance = 1.5            # metres along the axis
//!
//! [projector]                     # left out: the camera's twin behind a beam splitter
//! position = [0.3, 0.2, 1.5]
//! look_at = [0.0, 0.0, 0.0]
//! vertical_fov_degrees = 30.0
//! resolution = [128, 96]          # left out: the camera's
//! ```
//!
//! A scene `NAME.EXT` is seen by the rig in `NAME.rig.toml` next to it, where there is one, instead of its own cameras.

use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Deserialize;

use super::camera::tan_half;
use super::source::fault;
use super::triangle::MAX_COORDINATE;
use super::{Camera, Lens, LoadOptions};
use crate::error::{Error, Result};
use crate::image::Resolution;

/// Who sees and who lights a scene.
pub(super) struct CameraPair {
    pub camera: Camera,
    /// `None`: where the camera is.
    pub projector: Option<Camera>,
    pub projector_resolution: Option<Resolution>,
}

impl CameraPair {
    /// The rig of these two; a projector that coincides with the camera is none of its own.
    pub(super) fn new(
        camera: Camera,
        projector: Option<Camera>,
        projector_resolution: Option<Resolution>,
    ) -> Self {
        let projector = projector.filter(|projector| !projector.coincides(&camera));
        Self { camera, projector, projector_resolution }
    }
}

/// What a rig file says.
pub(super) struct CameraFile {
    /// Its bytes, for the scene's hash.
    pub bytes: Vec<u8>,
    pub camera: Option<Camera>,
    pub projector: Option<Camera>,
    pub projector_resolution: Option<Resolution>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Source {
    camera: Option<View>,
    projector: Option<View>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct View {
    position: [f64; 3],
    look_at: Option<[f64; 3]>,
    forward: Option<[f64; 3]>,
    up: Option<[f64; 3]>,
    vertical_fov_degrees: f64,
    aperture_radius: Option<f64>,
    focus_distance: Option<f64>,
    resolution: Option<[usize; 2]>,
}

/// The rig file for a scene: the one that the options name, or the one next to it.
pub(super) fn find(scene: &Path, options: &LoadOptions<'_>) -> Result<Option<CameraFile>> {
    if let Some(path) = options.rig {
        let file = read(path)?;
        if file.camera.is_some() && options.camera.is_some() {
            return Err(fault(
                path,
                "the rig file has a camera, but one of the scene's is asked for by name",
                "leave out --camera, or the [camera] of the rig file",
            ));
        }
        return Ok(Some(file));
    }
    let neighbour = scene.with_extension("rig.toml");
    // Whoever asks for one of the scene's own cameras does not want the neighbour's.
    if options.camera.is_some() || !neighbour.is_file() {
        return Ok(None);
    }
    read(&neighbour).map(Some)
}

/// Reads a rig file.
fn read(path: &Path) -> Result<CameraFile> {
    let metadata = std::fs::metadata(path).map_err(Error::reading(path))?;
    if !metadata.is_file() {
        return Err(fault(path, "not a file", "give a rig file in TOML"));
    }
    let bytes = std::fs::read(path).map_err(Error::reading(path))?;
    let text =
        std::str::from_utf8(&bytes).map_err(|_| fault(path, "not UTF-8 text", "give a rig file in TOML"))?;
    let source: Source = toml::from_str(text).map_err(|error| {
        fault(
            path,
            format!("not a valid rig file: {}", error.to_string().trim_end()),
            "a rig file has [camera] and [projector], each with position, look_at (or forward), up, \
             vertical_fov_degrees, aperture_radius and focus_distance; the projector also resolution",
        )
    })?;
    let reader = Reader { path: path.to_path_buf() };
    let (camera, resolution) = reader.view("camera", source.camera)?;
    if resolution.is_some() {
        return Err(fault(path, "[camera] has a resolution", "give the camera's resolution by --size"));
    }
    let (projector, projector_resolution) = reader.view("projector", source.projector)?;
    Ok(CameraFile { bytes, camera, projector, projector_resolution })
}

struct Reader {
    path: PathBuf,
}

impl Reader {
    fn fault(&self, name: &str, what: &str, help: &str) -> Error {
        fault(&self.path, format!("[{name}] {what}"), help)
    }

    fn view(&self, name: &str, view: Option<View>) -> Result<(Option<Camera>, Option<Resolution>)> {
        let Some(view) = view else { return Ok((None, None)) };
        let position = DVec3::from_array(view.position);
        let forward = match (view.look_at, view.forward) {
            (Some(target), None) => DVec3::from_array(target) - position,
            (None, Some(forward)) => DVec3::from_array(forward),
            _ => {
                let help = "give either the point that it looks at, or the direction";
                return Err(self.fault(name, "needs look_at or forward, one of them", help));
            }
        };
        let up = view.up.map_or(DVec3::Y, DVec3::from_array);
        let axes = forward.try_normalize().and_then(|forward| {
            let right = forward.cross(up.try_normalize()?);
            // Closer to parallel, rounding decides where up is.
            (right.length() > 1e-6).then(|| (right.normalize(), forward))
        });
        let Some((right, forward)) = axes else {
            return Err(self.fault(
                name,
                "looks nowhere, or along its own up",
                "give a direction that is not zero, and an up beside it",
            ));
        };
        if position.abs().max_element() > f64::from(MAX_COORDINATE) || !position.is_finite() {
            let what = format!("stands more than {MAX_COORDINATE:e} m from the origin");
            return Err(self.fault(name, &what, "lengths are metres"));
        }
        let field = view.vertical_fov_degrees;
        let Some(tan_half_fov) = tan_half(field.to_radians()) else {
            return Err(self.fault(
                name,
                &format!("has a vertical_fov_degrees of {field}"),
                "it must lie between 0 and 180",
            ));
        };
        let lens = Lens::checked(view.aperture_radius, view.focus_distance)
            .map_err(|what| self.fault(name, &what, Lens::HELP))?;
        let resolution = match view.resolution {
            None => None,
            Some([width @ 1..=16384, height @ 1..=16384]) => Some(Resolution::new(width, height)),
            Some([width, height]) => {
                let what = format!("has a resolution of {width}x{height}");
                return Err(self.fault(name, &what, "give 1 to 16384 pixels a side"));
            }
        };
        let camera = Camera {
            name: name.into(),
            position: position.as_vec3(),
            right: right.as_vec3() + glam::Vec3::ZERO,
            up: right.cross(forward).as_vec3() + glam::Vec3::ZERO,
            forward: forward.as_vec3() + glam::Vec3::ZERO,
            tan_half_fov,
            aspect: None,
            lens,
        };
        Ok((Some(camera), resolution))
    }
}
