//! The rig's camera and projector, from the file's camera nodes or a camera file.

use glam::{DVec3, Vec3};
use gltf_json as json;
use gltf_json::validation::Checked;

use super::extensions::Extras;
use super::nodes::Placed;
use super::{Document, object_name};
use crate::error::Result;
use crate::scene::camera::{Posed, tan_half};
use crate::scene::camera_file::{CameraFile, CameraPair};
use crate::scene::triangle::MAX_COORDINATE;
use crate::scene::{Camera, LoadOptions};

/// The largest cosine of axes that count as perpendicular. It is well above the rounding of exporters, and well below a visible shear.
const MAX_SHEAR: f64 = 1e-4;

struct Candidate<'a> {
    name: String,
    camera: &'a json::Camera,
    placed: &'a Placed,
    extras: Extras,
}

/// The camera at which the rig stands, unless a camera file states one.
pub(super) enum Wanted {
    Named(String),
    Only,
    /// The first perspective camera.
    First,
    /// A camera that krylux places, since the scene has none.
    Placed,
}

/// The camera that the options want. If they allow a placed camera, the first perspective camera of the scene is taken, with a warning that
/// names the others. A camera is placed only if the scene has no perspective camera.
pub(super) fn wanted(
    document: &mut Document,
    placed: &[Placed],
    options: &LoadOptions<'_>,
    file: &Option<CameraFile>,
) -> Result<Wanted> {
    if let Some(name) = options.camera {
        return Ok(Wanted::Named(name.into()));
    }
    if !options.auto_camera || file.as_ref().is_some_and(|file| file.camera.is_some()) {
        return Ok(Wanted::Only);
    }
    let (cameras, _) = candidates(document, placed)?;
    let (usable, others): (Vec<_>, Vec<_>) =
        cameras.iter().partition(|candidate| candidate.camera.perspective.is_some());
    let warning = match (usable.as_slice(), others.as_slice()) {
        ([], []) => return Ok(Wanted::Placed),
        ([], _) => Some(format!("cameras without a perspective are not used: {}", names(&others))),
        ([_], _) => None,
        ([first, rest @ ..], _) => {
            let first = &first.name;
            Some(format!(
                "of several cameras the first, `{first}`, is used; --camera chooses another: {}",
                names(rest)
            ))
        }
    };
    let is_empty = usable.is_empty();
    warning.into_iter().for_each(|warning| document.warnings.add(warning));
    Ok(if is_empty { Wanted::Placed } else { Wanted::First })
}

fn names(candidates: &[&Candidate<'_>]) -> String {
    candidates.iter().map(|candidate| format!("`{}`", candidate.name)).collect::<Vec<_>>().join(", ")
}

/// The camera and the projector. Each is taken from the camera file, if that states it, and otherwise from the scene's camera nodes. The
/// camera is then the node that is `wanted`. The projector is the node that has `"krylux": "projector"` in its extras.
pub(super) fn pair(
    document: &Document,
    placed: &[Placed],
    wanted: &Wanted,
    file: Option<CameraFile>,
) -> Result<CameraPair> {
    let (camera, projector, mut resolution) = match file {
        None => (None, None, None),
        Some(file) => (file.camera, file.projector, file.projector_resolution),
    };
    let (cameras, projectors) = candidates(document, placed)?;
    let camera = match camera {
        Some(camera) => camera,
        None => build(document, choose(document, &cameras, wanted)?)?,
    };
    let projector = match (projector, projectors.as_slice()) {
        (Some(projector), _) => Some(projector),
        (None, []) => None,
        (None, [projector]) => {
            resolution = projector.extras.resolution(document, &projector.name)?;
            Some(build(document, projector)?)
        }
        (None, [first, second, ..]) => {
            return Err(document
                .fault(format!("two projectors, `{}` and `{}`", first.name, second.name))
                .help("keep \"krylux\": \"projector\" in the extras of one of them only"));
        }
    };
    Ok(CameraPair { camera, projector, projector_resolution: resolution })
}

/// The camera nodes of the scene: the cameras, and those that are marked as projectors.
fn candidates<'a>(
    document: &'a Document,
    placed: &'a [Placed],
) -> Result<(Vec<Candidate<'a>>, Vec<Candidate<'a>>)> {
    let mut cameras = Vec::new();
    let mut projectors = Vec::new();
    for placed in placed {
        let node = &document.root.nodes[placed.node];
        let extras = Extras::of(&node.extras);
        let what = || object_name("node", placed.node, node.name.as_ref());
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

fn choose<'a>(
    document: &Document,
    candidates: &'a [Candidate<'a>],
    wanted: &Wanted,
) -> Result<&'a Candidate<'a>> {
    let names = || names(&candidates.iter().collect::<Vec<_>>());
    let mut pinholes = candidates.iter().filter(|candidate| candidate.camera.perspective.is_some());
    if let (Wanted::First, Some(first)) = (wanted, pinholes.next()) {
        return Ok(first);
    }
    let wanted = match wanted {
        Wanted::Named(name) => Some(name.as_str()),
        _ => None,
    };
    let matching: Vec<_> =
        candidates.iter().filter(|candidate| wanted.is_none_or(|wanted| wanted == candidate.name)).collect();
    let (fault, help) = match (matching.as_slice(), wanted) {
        ([candidate], _) => return Ok(candidate),
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
    // glTF cameras look along −Z with +Y up. Adding zero turns −0 into 0.
    let forward = -z + DVec3::ZERO;
    let right = x.reject_from_normalized(forward).normalize() + DVec3::ZERO;
    let up = right.cross(forward) + DVec3::ZERO;
    Ok([right, up, forward])
}
