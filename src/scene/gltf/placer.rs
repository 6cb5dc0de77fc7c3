//! Transformation of a primitive's vertices to triangle corners in world space.

use glam::Vec3;

use super::Document;
use super::pose::Pose;
use super::vertices::Vertices;
use crate::error::{Error, Result};
use crate::scene::place::Place;
use crate::scene::triangle::{MAX_COORDINATE, Triangle};

/// Makes world-space triangles of a primitive at one pose.
pub(super) struct Placer<'a> {
    pub document: &'a Document,
    /// The primitive's name in messages.
    pub what: &'a str,
    pub vertices: &'a Vertices<'a>,
    pub pose: &'a Pose<'a>,
    pub material: u32,
}

impl Placer<'_> {
    /// The triangle whose corners are the vertices `indices`, in the coordinates of a scene at `place`, which notes them.
    pub(super) fn triangle(&self, indices: [u32; 3], place: &mut Place) -> Result<Triangle> {
        let mut triangle = Triangle::flat([Vec3::ZERO; 3], self.material, 0);
        let mut mirrors = false;
        for (corner, index) in indices.into_iter().enumerate() {
            mirrors = self.place(index, corner, &mut triangle, place)?;
        }
        // A mirroring transform reverses the order of the corners. Exchanging two of them keeps the front
        // where it was.
        Ok(if mirrors { triangle.flipped() } else { triangle })
    }

    /// Sets corner number `corner` of `triangle` to the vertex `index`. Returns whether the vertex's
    /// transform mirrors.
    fn place(&self, index: u32, corner: usize, triangle: &mut Triangle, place: &mut Place) -> Result<bool> {
        let Self { document, what, vertices, .. } = self;
        let vertex = vertices.vertex(index as usize).ok_or_else(|| {
            document.fault(
                format!("{what}: an index asks for vertex {index}, but there are {}", vertices.count),
                "the mesh is damaged: export it again",
            )
        })?;
        let transform = self.pose.of(index as usize).ok_or_else(|| {
            document.fault(
                format!("{what}: vertex {index} is bound to no joint, or to one that the skin does not have"),
                "the mesh is damaged: export it again",
            )
        })?;
        let world = transform.point(vertex.position);
        if !world.is_finite() || world.abs().max_element() > f64::from(MAX_COORDINATE) {
            return Err(bad_position(document, what, index, vertex.position));
        }
        if !vertex.texcoords.iter().all(|coordinates| coordinates.is_finite()) {
            return Err(document.fault(
                format!("{what}: texture coordinate of vertex {index} is not finite"),
                "correct the mesh's texture coordinates",
            ));
        }
        place.note(world, vertex.position.as_dvec3(), transform.stretch());
        triangle.positions[corner] = (world - place.origin).as_vec3();
        triangle.normals[corner] = transform.normal(vertex.normal);
        triangle.texcoords[corner] = vertex.texcoords;
        triangle.colors[corner] = vertex.color;
        Ok(transform.mirrors)
    }
}

/// The error about a vertex whose world position is not usable. `local` is its position in the mesh's frame.
fn bad_position(document: &Document, what: &str, vertex: u32, local: Vec3) -> Error {
    if local.is_finite() {
        document.fault(
            format!("{what}: vertex {vertex} lies more than {MAX_COORDINATE:e} m from the origin"),
            "glTF lengths are metres: scale the scene",
        )
    } else {
        document.fault(
            format!("{what}: vertex {vertex} has a position that is not finite: {local}"),
            "correct the mesh: look for a division by zero where it was made",
        )
    }
}
