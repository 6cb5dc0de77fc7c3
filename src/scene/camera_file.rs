//! Camera files: the poses and lenses of camera and projector, in TOML.
//!
//! ```toml
//! [camera]
//! position = [0.0, 0.2, 1.5]      # metres
//! look_at = [0.0, 0.0, 0.0]       # or `forward = [0.0, -0.1, -1.0]`
//! up = [0.0, 1.0, 0.0]            # the default
//! vertical_fov_degrees = 40.0
//! aperture_radius = 0.01          # metres; a pinhole by default
//! focus_distance = 1.5            # metres along the axis
//!
//! [projector]                     # by default the rig is coaxial: the projector is at the camera
//! position = [0.3, 0.2, 1.5]
//! look_at = [0.0, 0.0, 0.0]
//! vertical_fov_degrees = 30.0
//! resolution = [128, 96]          # the camera's by default
//! ```
//!
//! If `NAME.rig.toml` is next to the scene `NAME.EXT`, its poses replace the scene's poses.
//!
//! A camera file describes only geometry. Devices are described by a rig file, which [`crate::measure`] reads.

use std::path::Path;

use glam::{DVec3, Vec3};
use serde::Deserialize;

use super::camera::{Posed, axes, tan_half};
use super::triangle::MAX_COORDINATE;
use super::{Camera, Lens, LoadOptions};
use crate::error::{Error, Result};
use crate::file;
use crate::image::Resolution;

/// The cameras that the scene's files state.
#[derive(Default)]
pub(super) struct Cameras {
    /// The bytes of the camera file, which enter the scene's hash.
    pub bytes: Vec<u8>,
    pub camera: Option<Posed>,
    /// The projector. `None` in a coaxial rig, where it has the camera's geometry.
    pub projector: Option<Posed>,
    pub projector_resolution: Option<Resolution>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Tables {
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
    #[serde(alias = "vertical_fov")]
    vertical_fov_degrees: f64,
    aperture_radius: Option<f64>,
    focus_distance: Option<f64>,
    resolution: Option<[usize; 2]>,
}

/// Finds the camera file of a scene: the file given in the options, or the file next to the scene.
pub(super) fn find(scene: &Path, options: &LoadOptions<'_>) -> Result<Option<Cameras>> {
    if let Some(path) = options.camera_file {
        let file = read(path)?;
        if file.camera.is_some() && options.camera.is_some() {
            return Err(Error::scene(
                path,
                "the camera file has a [camera], but --camera names a camera of the scene",
            )
            .help("leave out --camera, or the [camera] of the camera file"));
        }
        return Ok(Some(file));
    }
    let neighbour = scene.with_extension("rig.toml");
    // If the options name a camera of the scene, the file next to the scene is ignored.
    if options.camera.is_some() || !neighbour.is_file() {
        return Ok(None);
    }
    read(&neighbour).map(Some)
}

fn read(path: &Path) -> Result<Cameras> {
    let bytes = file::read(path)?;
    let text = std::str::from_utf8(&bytes)
        .map_err(|_| Error::scene(path, "not UTF-8 text").help("give a camera file in TOML"))?;
    let tables: Tables = toml::from_str(text).map_err(|error| {
        Error::scene(path, format!("not a valid camera file: {}", error.to_string().trim_end())).help(
            "a camera file has [camera] and [projector], each with position, look_at (or forward), up, \
             vertical_fov_degrees, aperture_radius and focus_distance; the projector also resolution",
        )
    })?;
    let view = |table, view: Option<View>| match view {
        Some(view) => {
            let fault = |what: String| Error::scene(path, format!("[{table}] {what}"));
            view.posed(fault, table).map(|(camera, resolution)| (Some(camera), resolution))
        }
        None => Ok((None, None)),
    };
    let (camera, resolution) = view("camera", tables.camera)?;
    if resolution.is_some() {
        return Err(
            Error::scene(path, "[camera] has a resolution").help("give the camera's resolution by --size")
        );
    }
    let (projector, projector_resolution) = view("projector", tables.projector)?;
    Ok(Cameras { bytes, camera, projector, projector_resolution })
}

/// The camera or the projector that a JSON object with the keys of a table describes, and its resolution if stated.
pub(super) fn from_json(role: &str, json: &str) -> Result<(Camera, Option<Resolution>)> {
    let view: View = serde_json::from_str(json).map_err(|error| {
        Error::option(role, format!("it is no pose: {error}"))
            .help("give position, look_at (or forward), up, vertical_fov in degrees, aperture_radius and focus_distance")
    })?;
    if role == "camera" && view.resolution.is_some() {
        return Err(Error::option(role, "it has a resolution").help("give the camera's resolution by --size"));
    }
    let (posed, resolution) = view.posed(|what| Error::option(role, format!("it {what}")), role)?;
    Ok((posed.around(DVec3::ZERO), resolution))
}

impl View {
    /// The camera that a table describes, and its resolution if stated.
    fn posed(self, fault: impl Fn(String) -> Error, table: &str) -> Result<(Posed, Option<Resolution>)> {
        let [right, up, forward] = self.axes(&fault)?;
        let position = DVec3::from_array(self.position);
        if position.abs().max_element() > f64::from(MAX_COORDINATE) || !position.is_finite() {
            let what = format!("stands more than {MAX_COORDINATE:e} m from the origin");
            return Err(fault(what).help("lengths are metres"));
        }
        let field = self.vertical_fov_degrees;
        let Some(tan_half_fov) = tan_half(field.to_radians()) else {
            return Err(
                fault(format!("has a vertical_fov_degrees of {field}")).help("it must lie between 0 and 180")
            );
        };
        let lens = Lens::checked(self.aperture_radius, self.focus_distance)
            .map_err(|what| fault(what).help(Lens::HELP))?;
        let resolution = match self.resolution {
            None => None,
            Some([width @ 1..=16384, height @ 1..=16384]) => Some(Resolution::new(width, height)),
            Some([width, height]) => {
                let what = format!("has a resolution of {width}x{height}");
                return Err(fault(what).help("give 1 to 16384 pixels a side"));
            }
        };
        let (name, anywhere) = (table.into(), Vec3::ZERO);
        let camera =
            Camera { name, position: anywhere, right, up, forward, tan_half_fov, aspect: None, lens };
        Ok((Posed { camera, position }, resolution))
    }

    /// Right, up and forward as an orthonormal frame.
    fn axes(&self, fault: impl Fn(String) -> Error) -> Result<[Vec3; 3]> {
        let forward = match (self.look_at, self.forward) {
            (Some(point), None) => DVec3::from_array(point) - DVec3::from_array(self.position),
            (None, Some(forward)) => DVec3::from_array(forward),
            _ => {
                let help = "give either the point that it looks at, or the direction";
                return Err(fault("needs either look_at or forward".into()).help(help));
            }
        };
        let up = self.up.map_or(DVec3::Y, DVec3::from_array);
        let Some(axes) = axes(forward, up) else {
            return Err(fault("has no direction of view, or one that is parallel to up".into())
                .help("give a direction that is not zero, and an up that is not parallel to it"));
        };
        // Adding zero converts −0 to 0.
        Ok(axes.map(|axis| axis.as_vec3() + Vec3::ZERO))
    }
}
