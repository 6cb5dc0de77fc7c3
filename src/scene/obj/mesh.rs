//! Faces of an `.obj` file, read by `tobj`.

use std::path::Path;

use glam::{Vec2, Vec3};

use super::check::Checked;
use crate::error::Result;
use crate::scene::source::fault;
use crate::scene::triangle::Triangle;

/// A corner of a face.
#[derive(Clone, Copy)]
pub(super) struct Corner {
    pub position: Vec3,
    pub color: [u16; 4],
    /// Texture coordinate with `v` pointing downwards, as pictures are stored.
    pub texcoord: Option<Vec2>,
    /// A unit vector; zero if the file's normal has no direction.
    pub normal: Option<Vec3>,
}

/// A polygon of the file.
pub(super) struct Face {
    /// Three or more corners.
    pub corners: Vec<Corner>,
    /// Index into [`Checked::groups`].
    pub group: u32,
    /// Index into [`Checked::materials`], if the face has a material.
    pub material: Option<u32>,
}

/// Iterates over the faces in the order of the file.
pub(super) fn faces<'a>(path: &Path, checked: &'a Checked) -> Result<impl Iterator<Item = Face> + 'a> {
    let options = tobj::LoadOptions::default();
    let (models, _) = tobj::load_obj_buf(&mut checked.plain.as_bytes(), &options, |_| Ok(Default::default()))
        .map_err(|error| fault(path, error.to_string(), "export the scene again"))?;
    // Without groups and materials the whole file is one model.
    let mesh = models.into_iter().next().map(|model| model.mesh).unwrap_or_default();
    let mut first = 0;
    let runs = checked.runs.iter().flat_map(|run| std::iter::repeat_n(run, run.faces));
    Ok(runs.enumerate().map(move |(index, run)| {
        // `face_arities` is empty if all faces are triangles.
        let count = mesh.face_arities.get(index).map_or(3, |&count| count as usize);
        let corners = (first..first + count).map(|at| corner(&mesh, at, checked.given[at])).collect();
        first += count;
        Face { corners, group: run.group, material: run.material }
    }))
}

fn corner(mesh: &tobj::Mesh, at: usize, [has_texcoord, has_normal]: [bool; 2]) -> Corner {
    let triple = |values: &[f32], index: u32| Vec3::from_slice(&values[3 * index as usize..]);
    Corner {
        position: triple(&mesh.positions, mesh.indices[at]),
        color: Triangle::quantized(triple(&mesh.vertex_color, mesh.indices[at]).extend(1.0).to_array()),
        texcoord: has_texcoord.then(|| {
            let [u, v] = [0, 1].map(|axis| mesh.texcoords[2 * mesh.texcoord_indices[at] as usize + axis]);
            Vec2::new(u, 1.0 - v)
        }),
        normal: has_normal.then(|| {
            let normal = triple(&mesh.normals, mesh.normal_indices[at]);
            normal.as_dvec3().normalize_or_zero().as_vec3()
        }),
    }
}
