//! Loading Wavefront `.obj` with its `.mtl` libraries.
//!
//! | statement | here |
//! |---|---|
//! | `v`, `vt`, `vn`, `f` | triangles; faces of more corners become fans around their first one |
//! | `v` with three more numbers | vertex colours, linear |
//! | `o`, `g` | regions, by the name that was given last |
//! | `usemtl`, `mtllib` | see [`materials`] |
//! | `s` | no effect: normals come from `vn` alone |
//! | `l`, `p`, free-form surfaces, all else | ignored with a warning |
//!
//! The format knows no camera: it comes from a camera file. Lengths are metres, surfaces have two sides. Whatever the bytes,
//! loading ends with a scene or an [`enum@Error`].

mod line;
mod maps;
mod materials;
mod mesh;
mod mtl;

use std::path::Path;

use super::source::{ContentHash, Warnings, fault};
use super::triangle::{MAX_COORDINATE, Triangle};
use super::{LoadOptions, Scene, camera_file};
use crate::error::{Error, Result};
use mesh::{Face, Mesh, NONE};

/// Loads an `.obj` file; see [`crate::scene::load_with`].
///
/// # Errors
/// [`Error::Read`] when a file cannot be read, [`Error::Scene`] when its content cannot be used.
pub(super) fn load(path: &Path, options: &LoadOptions<'_>) -> Result<Scene> {
    let bytes = std::fs::read(path).map_err(Error::reading(path))?;
    let mut hash = ContentHash::default();
    hash.add(&bytes);
    let rig = find_rig(path, options, &mut hash)?;
    let mut warnings = Warnings::default();
    let mesh = Mesh::parse(path, &String::from_utf8_lossy(&bytes), &mut warnings)?;
    drop(bytes);
    let materials = materials::load(path, &mesh, &mut hash, &mut warnings)?;
    let triangles = triangles(path, &mesh, &materials, &mut warnings)?;
    Ok(Scene {
        path: path.to_path_buf(),
        triangles,
        materials: materials.list,
        textures: materials.textures,
        camera: rig.camera,
        projector: rig.projector,
        projector_resolution: rig.projector_resolution,
        regions: mesh.groups,
        regions_are_labels: false,
        hash: hash.finish(),
        warnings: warnings.list,
    })
}

fn find_rig(
    path: &Path,
    options: &LoadOptions<'_>,
    hash: &mut ContentHash,
) -> Result<camera_file::CameraPair> {
    if let Some(name) = options.camera {
        return Err(fault(
            path,
            format!("an .obj file has no cameras, and none called `{name}`"),
            "leave out --camera, and give a camera file by --camera-file",
        ));
    }
    let given = camera_file::find(path, options)?;
    let missing = || {
        let sidecar = path.with_extension("rig.toml");
        fault(
            path,
            "an .obj file has no camera, and no camera file gives one",
            format!(
                "write {} with [camera] position, look_at and vertical_fov_degrees, or name such a file by --camera-file",
                sidecar.display()
            ),
        )
    };
    let given = given.ok_or_else(missing)?;
    hash.add(&given.bytes);
    let camera = given.camera.ok_or_else(missing)?;
    Ok(camera_file::CameraPair::new(camera, given.projector, given.projector_resolution))
}

fn triangles(
    path: &Path,
    mesh: &Mesh,
    materials: &materials::Materials,
    warnings: &mut Warnings,
) -> Result<Vec<Triangle>> {
    let mut triangles = Vec::with_capacity(mesh.faces.len());
    let mut degenerate = 0_usize;
    for face in &mesh.faces {
        let triangle = triangle(path, mesh, face, materials)?;
        if triangle.has_area() {
            triangles.push(triangle.with_normals_in_front());
        } else {
            degenerate += 1;
        }
    }
    if degenerate > 0 {
        warnings.add(format!("{degenerate} triangles without area were dropped"));
    }
    if triangles.is_empty() {
        return Err(fault(path, "no triangles in the scene", "export meshes with faces"));
    }
    Ok(triangles)
}

fn triangle(path: &Path, mesh: &Mesh, face: &Face, materials: &materials::Materials) -> Result<Triangle> {
    let positions = face.corners.map(|corner| mesh.positions[corner.position as usize]);
    let mut triangle = Triangle::flat(positions, materials.of(face.material), face.group);
    if let Some(position) = positions.iter().find(|position| position.abs().max_element() > MAX_COORDINATE) {
        return Err(fault(
            path,
            format!("a vertex at {position} lies more than {MAX_COORDINATE:e} m from the origin"),
            "lengths are metres: scale the scene",
        ));
    }
    let textured = materials.list[triangle.material as usize].textures().next().is_some();
    for (slot, corner) in face.corners.into_iter().enumerate() {
        if corner.texcoord != NONE {
            triangle.texcoords[slot][0] = mesh.texcoords[corner.texcoord as usize];
        } else if textured {
            return Err(fault(
                path,
                format!(
                    "a face of material `{}` has no texture coordinates, but the material has a texture",
                    materials.list[triangle.material as usize].name
                ),
                "unwrap the mesh, or remove the texture from the material",
            ));
        }
        if corner.normal != NONE {
            triangle.normals[slot] = mesh.normals[corner.normal as usize];
        }
        if let Some(color) = mesh.colors.get(corner.position as usize) {
            triangle.colors[slot] = *color;
        }
    }
    Ok(triangle)
}
