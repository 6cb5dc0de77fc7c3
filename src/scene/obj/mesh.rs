//! Faces of an `.obj` file.

use glam::{DVec3, Vec2, Vec3};

use super::check::Checked;

/// A corner of a face.
#[derive(Clone, Copy)]
pub(super) struct Corner {
    /// In the scene's coordinates.
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

/// Iterates over the faces in the order of the file, in coordinates whose origin lies at `origin`.
pub(super) fn faces(checked: &Checked, origin: DVec3) -> impl Iterator<Item = Face> + '_ {
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
