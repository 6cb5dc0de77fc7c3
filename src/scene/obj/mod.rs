//! Loads Wavefront `.obj` files with `.mtl` libraries.
//!
//! | statement | treatment |
//! |---|---|
//! | `v`, `vt`, `vn`, `f` | triangles; faces with more corners, convex or not, are split in the plane that fits them best |
//! | `v` with three more numbers | linear vertex colours |
//! | `o`, `g` | regions, named by the latest such statement |
//! | `usemtl`, `mtllib` | see [`materials`] |
//! | `s` | ignored: normals come from `vn` only |
//! | `l`, `p`, free-form surfaces, all others | ignored with a warning |
//!
//! The format has no camera; the camera file provides it. Lengths are in metres, and surfaces are two-sided. For any input bytes,
//! loading returns a scene or an [`enum@crate::Error`].

mod maps;
mod materials;
mod polygon;
mod statements;

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use super::camera::Posed;
use super::camera_file::{self, Cameras};
use super::place::Place;
use super::source::{self, SceneFile};
use super::triangle::{MAX_COORDINATE, Triangle};
use super::{LoadOptions, Scene, Watcher};
use crate::error::{Error, Result};
use polygon::Triangulator;
use statements::Checked;

/// The estimated fraction of the loading time that is spent on reading the file.
const READING: f32 = 0.5;

/// Loads an `.obj` file; see [`crate::scene::load_with`].
pub(super) fn load(path: &Path, options: &LoadOptions<'_>) -> Result<Scene> {
    let (mut file, bytes) = SceneFile::read(path, options.strict)?;
    let mut checked = Checked::default();
    let (watcher, mut lines, mut read) = (options.watcher, 0_usize, 0_usize);
    statements::statements(path, &source::text(&bytes), |line| {
        lines += 1;
        // The sum includes a blank after the keyword and the end of the line.
        read += line.keyword.len() + line.rest.len() + 2;
        watcher.count(lines, || READING * (read as f32 / bytes.len() as f32).min(1.0))?;
        checked.statement(line, &mut file)
    })?;
    drop(bytes);
    let mut materials = materials::load(&checked, &mut file)?;
    let given = camera_file::find(path, options)?;
    let place = place(path, &checked, given.as_ref().and_then(|given| given.camera.as_ref()))?;
    let triangles = triangles(&checked, &mut materials, (watcher, place.origin), &mut file)?;
    let cameras = cameras(options, given, &mut file)?;
    file.warnings.extend(place.warning());
    let regions = checked.groups.into_iter().collect();
    Ok(file.scene(&place, cameras, triangles, (materials.list, materials.textures), (regions, false)))
}

fn place(path: &Path, checked: &Checked, camera: Option<&Posed>) -> Result<Place> {
    let mut place = Place::of(camera.map(|camera| camera.position));
    for [vertex, ..] in &checked.corners {
        let (position, _) = checked.vertices[*vertex as usize - 1];
        if position.abs().max_element() > f64::from(MAX_COORDINATE) {
            return Err(Error::scene(
                path,
                format!("a vertex at {position} lies more than {MAX_COORDINATE:e} m from the origin"),
            )
            .help("lengths are metres: scale the scene"));
        }
        place.note(position, position, 1.0);
    }
    place.settle(path)?;
    Ok(place)
}

/// The cameras that the camera file states. If it states no camera, krylux may place one, depending on the options.
fn cameras(options: &LoadOptions<'_>, given: Option<Cameras>, file: &mut SceneFile) -> Result<Cameras> {
    if let Some(name) = options.camera {
        return Err(file
            .fault(format!("an .obj file has no cameras, and none called `{name}`"))
            .help("leave out --camera, and give a camera file by --camera-file"));
    }
    if let Some(given) = &given {
        file.hash.add(&given.bytes);
    }
    let given = given.unwrap_or_default();
    if given.camera.is_none() && !options.auto_camera {
        let sidecar = file.path.with_extension("rig.toml");
        let help = format!(
            "write {} with [camera] position, look_at and vertical_fov_degrees, name such a file by --camera-file, or let --auto-camera place one",
            sidecar.display()
        );
        return Err(file.fault("an .obj file has no camera, and no camera file gives one").help(help));
    }
    Ok(given)
}

fn triangles(
    checked: &Checked,
    materials: &mut materials::ObjMaterials,
    (watcher, origin): (Watcher<'_>, DVec3),
    file: &mut SceneFile,
) -> Result<Vec<Triangle>> {
    let mut triangles = Vec::new();
    let mut degenerate = 0_usize;
    let mut polygons = Triangulator::default();
    let count: usize = checked.runs.iter().map(|run| run.faces).sum();
    for (index, face) in faces(checked, origin).enumerate() {
        watcher.count(index, || READING + (1.0 - READING) * index as f32 / count as f32)?;
        let is_bare = face.corners.iter().any(|corner| corner.texcoord.is_none());
        let material = materials.of(face.material);
        let material = match is_bare && materials.list[material as usize].textures().next().is_some() {
            true => materials.without_textures(material, file)?,
            false => material,
        };
        for corners in polygons.split(face.corners.iter().map(|corner| corner.position)) {
            let triangle = triangle(&corners.map(|at| face.corners[at]), material, face.group);
            if triangle.has_area() {
                triangles.push(triangle.with_normals_in_front());
            } else {
                degenerate += 1;
            }
        }
    }
    if polygons.unclear > 0 {
        file.warn(format!(
            "{} faces cross themselves or have no area: their triangles may not cover them",
            polygons.unclear
        ));
    }
    if degenerate > 0 {
        file.warn(format!("{degenerate} triangles without area were dropped"));
    }
    if triangles.is_empty() {
        let what = match checked.has_points {
            true => "no triangles in the scene, but points or lines, which have no area and show nothing",
            false => "no triangles in the scene",
        };
        return Err(file.fault(what).help("export meshes with faces"));
    }
    Ok(triangles)
}

fn triangle(corners: &[Corner; 3], material: u32, group: u32) -> Triangle {
    let mut triangle = Triangle::flat(corners.map(|corner| corner.position), material, group);
    triangle.texcoords = corners.map(|corner| [corner.texcoord.unwrap_or(Vec2::ZERO), Vec2::ZERO]);
    triangle.normals = corners.map(|corner| corner.normal.unwrap_or(Vec3::ZERO));
    triangle.colors = corners.map(|corner| corner.color);
    triangle
}

#[derive(Clone, Copy)]
struct Corner {
    /// The position in the scene's coordinates.
    pub position: Vec3,
    pub color: [u16; 4],
    /// Texture coordinate with `v` pointing downwards, as pictures are stored.
    pub texcoord: Option<Vec2>,
    /// A unit vector; zero if the file's normal has no direction.
    pub normal: Option<Vec3>,
}

struct Face {
    pub corners: Vec<Corner>,
    /// Index into [`Checked::groups`].
    pub group: u32,
    /// Index into [`Checked::materials`], if the face has a material.
    pub material: Option<u32>,
}

/// Iterates over the faces in the order of the file. The coordinates have their origin at `origin`.
fn faces(checked: &Checked, origin: DVec3) -> impl Iterator<Item = Face> + '_ {
    let runs = checked.runs.iter().flat_map(|run| std::iter::repeat_n(run, run.faces));
    let mut first = 0;
    runs.zip(&checked.sizes).map(move |(run, &size)| {
        let corners = &checked.corners[first..first + size as usize];
        first += size as usize;
        let corners = corners.iter().map(|&corner| self::corner(checked, corner, origin)).collect();
        Face { corners, group: run.group, material: run.material }
    })
}

fn corner(checked: &Checked, indices: [u32; 3], origin: DVec3) -> Corner {
    let [vertex, texcoord, normal] = indices.map(|index| (index as usize).wrapping_sub(1));
    let (position, color) = checked.vertices[vertex];
    Corner {
        position: (position - origin).as_vec3(),
        color,
        texcoord: checked.texcoords.get(texcoord).copied(),
        normal: checked.normals.get(normal).copied(),
    }
}
