//! The rig's camera and projector, from the camera nodes of the scene or from a camera file.

use glam::{DVec3, Vec3};
use gltf_json as json;
use gltf_json::validation::Checked;
use serde::{Deserialize, Serialize};

use super::Document;
use super::extensions::Extras;
use super::nodes::Placed;
use crate::error::Result;
use crate::scene::camera::{Posed, tan_half};
use crate::scene::camera_file::Cameras;
use crate::scene::triangle::MAX_COORDINATE;
use crate::scene::{Camera, LoadOptions};

/// The largest cosine between axes that count as perpendicular: well above the rounding of exporters, and well below a visible shear.
const MAX_SHEAR: f64 = 1e-4;

struct Candidate<'a> {
    name: String,
    camera: &'a json::Camera,
    placed: &'a Placed,
    extras: Extras,
}

fn names(candidates: &[&Candidate<'_>]) -> String {
    candidates.iter().map(|candidate| format!("`{}`", candidate.name)).collect::<Vec<_>>().join(", ")
}

/// Completes the cameras of a camera file by the scene's camera nodes. The camera is the node that the options select, or `None` if krylux
/// is to place a camera. The projector is the node that has `"krylux": "projector"` in its extras.
pub(super) fn complete(
    document: &mut Document,
    placed: &[Placed],
    options: &LoadOptions<'_>,
    mut stated: Cameras,
) -> Result<Cameras> {
    let (cameras, projectors) = candidates(document, placed)?;
    let mut warning = None;
    if stated.camera.is_none() {
        let chosen;
        (chosen, warning) = choose(document, &cameras, options)?;
        stated.camera = chosen.map(|chosen| build(document, chosen)).transpose()?;
    }
    match (&stated.projector, projectors.as_slice()) {
        (Some(_), _) | (None, []) => {}
        (None, [projector]) => {
            stated.projector_resolution = projector.extras.resolution(document, &projector.name)?;
            stated.projector = Some(build(document, projector)?);
        }
        (None, [first, second, ..]) => {
            return Err(document
                .fault(format!("two projectors, `{}` and `{}`", first.name, second.name))
                .help("keep \"krylux\": \"projector\" in the extras of one of them only"));
        }
    }
    warning.into_iter().for_each(|warning: String| document.file.warn(warning));
    Ok(stated)
}

/// The camera nodes of the scene: first the cameras, then the nodes that are marked as projectors.
fn candidates<'a>(
    document: &'a Document,
    placed: &'a [Placed],
) -> Result<(Vec<Candidate<'a>>, Vec<Candidate<'a>>)> {
    let mut cameras = Vec::new();
    let mut projectors = Vec::new();
    for placed in placed {
        let node = &document.root.nodes[placed.node];
        let extras = Extras::of(&node.extras);
        let what = || document.node_name(placed.node);
        let is_projector = extras.is_projector(document, &what)?;
        let Some(index) = node.camera.map(|camera| camera.value()) else {
            if is_projector {
                return Err(document
                    .fault(format!("{} is marked as the projector, but is not a camera", what()))
                    .help("put \"krylux\": \"projector\" into the extras of a camera's node"));
            }
            continue;
        };
        let camera = document.referred(&document.root.cameras, &what(), "camera", index)?;
        let name = [&node.name, &camera.name].into_iter().flatten().find(|name| !name.is_empty());
        let name = name.cloned().unwrap_or_else(|| format!("camera {index}"));
        let extras = extras.or(Extras::of(&camera.extras));
        let list = if is_projector { &mut projectors } else { &mut cameras };
        list.push(Candidate { name, camera, placed, extras });
    }
    Ok((cameras, projectors))
}

/// The camera that the options select. If they allow a placed camera, the first perspective camera of the scene is selected, with a warning
/// that names the others. `None` if the scene has no perspective camera.
fn choose<'a>(
    document: &Document,
    candidates: &'a [Candidate<'a>],
    options: &LoadOptions<'_>,
) -> Result<(Option<&'a Candidate<'a>>, Option<String>)> {
    let wanted = options.camera;
    if options.auto_camera && wanted.is_none() {
        let (usable, others): (Vec<_>, Vec<_>) =
            candidates.iter().partition(|candidate| candidate.camera.perspective.is_some());
        let warning = match (usable.as_slice(), others.as_slice()) {
            ([], []) | ([_], _) => None,
            ([], _) => Some(format!("cameras without a perspective are not used: {}", names(&others))),
            ([first, rest @ ..], _) => Some(format!(
                "of several cameras the first, `{}`, is used; --camera chooses another: {}",
                first.name,
                names(rest)
            )),
        };
        return Ok((usable.first().copied(), warning));
    }
    let names = || names(&candidates.iter().collect::<Vec<_>>());
    let matching: Vec<_> =
        candidates.iter().filter(|candidate| wanted.is_none_or(|wanted| wanted == candidate.name)).collect();
    let (fault, help) = match (matching.as_slice(), wanted) {
        ([candidate], _) => return Ok((Some(candidate), None)),
        _ if candidates.is_empty() => (
            "no camera in the scene".into(),
            "add a perspective camera where the rig stands, and export the scene with cameras, give a camera file by \
             --camera-file, or let --auto-camera place one",
        ),
        ([], Some(wanted)) => (
            format!("no camera is called `{wanted}`; there are {}", names()),
            "give one of these names to --camera",
        ),
        (_, Some(wanted)) => {
            let fault = format!("{} cameras are called `{wanted}`", matching.len());
            (fault, "give the camera nodes different names")
        }
        (_, None) => (format!("{} cameras: {}", candidates.len(), names()), "choose one with --camera NAME"),
    };
    Err(document.fault(fault).help(help))
}

fn build(document: &Document, candidate: &Candidate<'_>) -> Result<Posed> {
    let Candidate { name, camera, placed, extras } = candidate;
    let Some(perspective) = &camera.perspective else {
        let fault = match camera.type_ {
            Checked::Valid(json::camera::Type::Orthographic) => "is orthographic",
            _ => "has no perspective",
        };
        return Err(document
            .fault(format!("camera `{name}` {fault}"))
            .help("make it a perspective camera: the rig's projector and camera are pinholes"));
    };
    let field = f64::from(perspective.yfov);
    let Some(tan_half_fov) = tan_half(field) else {
        return Err(document
            .fault(format!("camera `{name}` has a vertical field of view of {field} rad"))
            .help("it must lie between 0 and π"));
    };
    if perspective.aspect_ratio.is_some_and(|aspect| !(aspect.is_finite() && aspect > 0.0)) {
        return Err(document
            .fault(format!("camera `{name}` has an aspect ratio that is not positive"))
            .help("correct aspectRatio, or leave it out"));
    }
    let [right, up, forward] = axes(document, name, placed)?;
    let position = placed.transform.translation;
    if !position.is_finite() || position.abs().max_element() > f64::from(MAX_COORDINATE) {
        return Err(document
            .fault(format!("camera `{name}` stands more than {MAX_COORDINATE:e} m from the origin"))
            .help("glTF lengths are metres: scale the scene"));
    }
    let camera = Camera {
        name: name.clone(),
        position: Vec3::ZERO,
        right: right.as_vec3(),
        up: up.as_vec3(),
        forward: forward.as_vec3(),
        tan_half_fov,
        aspect: perspective.aspect_ratio,
        lens: extras.lens(document, name)?,
    };
    let camera = match extras.exact() {
        Some(exact) => exact.applied(camera),
        None => camera,
    };
    Ok(Posed { camera, position })
}

/// Right, up and forward of a camera node as an orthonormal frame. The node's scale is ignored.
fn axes(document: &Document, name: &str, placed: &Placed) -> Result<[DVec3; 3]> {
    let linear = placed.transform.matrix3;
    let normalized = [linear.x_axis, linear.y_axis, linear.z_axis].map(|axis| axis.try_normalize());
    let [Some(x), Some(y), Some(z)] = normalized else {
        return Err(document
            .fault(format!("camera `{name}` is scaled to nothing"))
            .help("set the scale of the camera's node and its parents to 1"));
    };
    if x.dot(y).abs().max(y.dot(z).abs()).max(z.dot(x).abs()) > MAX_SHEAR {
        return Err(document
            .fault(format!("camera `{name}` is sheared by its node's transform"))
            .help("set the scale of the camera's parents to 1"));
    }
    if x.cross(y).dot(z) < 0.0 {
        return Err(document
            .fault(format!("camera `{name}` is mirrored by its node's transform"))
            .help("remove the negative scale from the camera's node or its parents"));
    }
    Ok(frame(x, z))
}

/// Right, up and forward of a camera whose node has these unit vectors as its first and its third axis.
pub(super) fn frame(x: DVec3, z: DVec3) -> [DVec3; 3] {
    // glTF cameras look along −Z with +Y up. Adding zero converts −0 to 0.
    let forward = -z + DVec3::ZERO;
    let right = x.reject_from_normalized(forward).normalize() + DVec3::ZERO;
    let up = right.cross(forward) + DVec3::ZERO;
    [right, up, forward]
}

/// A camera's axes and the tangent of half its field of view, in the extras of a file that krylux wrote.
#[derive(Serialize, Deserialize)]
pub(super) struct Exact {
    pub axes: [Vec3; 3],
    pub tan_half_fov: f32,
}

impl Exact {
    /// The camera with the exact numbers, unless another program has changed it, and left the extras.
    fn applied(self, camera: Camera) -> Camera {
        let [right, up, forward] = self.axes;
        let exact = Camera { right, up, forward, tan_half_fov: self.tan_half_fov, ..camera.clone() };
        if exact.coincides(&camera, 1.0) { exact } else { camera }
    }
}
