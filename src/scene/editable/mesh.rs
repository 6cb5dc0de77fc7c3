//! Indexed meshes in world space.

use glam::{DVec3, Vec2, Vec3};

use crate::error::{Error, Result};
use crate::scene::triangle::{MAX_COORDINATE, unit};
use crate::scene::{Material, Triangle};

/// Triangles of one material that share vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The name. No two meshes of a scene have the same.
    pub name: String,
    /// Index into [`EditableScene::materials`](super::EditableScene::materials).
    pub material: u32,
    /// Index into [`EditableScene::regions`](super::EditableScene::regions).
    pub region: u32,
    /// Vertices in metres.
    pub vertices: Vec<Vec3>,
    /// The vertices of each triangle, counter-clockwise as seen from its front.
    pub faces: Vec<[u32; 3]>,
    /// A unit shading normal for each vertex; empty for flat triangles.
    pub normals: Vec<Vec3>,
    /// Two sets of texture coordinates for each vertex, each of which may be empty. `v` points downwards, as pictures are stored.
    pub texcoords: [Vec<Vec2>; 2],
    /// Linear colour and opacity for each vertex, as [`Triangle::colors`]; empty for white.
    pub colors: Vec<[u16; 4]>,
}

impl Mesh {
    /// A mesh without vertices.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::default() }
    }

    /// Meshes without shared vertices: one for each run of triangles of one region and one material.
    pub(super) fn of_triangles(triangles: &[Triangle], regions: &[String]) -> Vec<Self> {
        let alike = |a: &Triangle, b: &Triangle| (a.region, a.material) == (b.region, b.material);
        let mesh = |run: &[Triangle]| {
            let Triangle { material, region, .. } = run[0];
            let every = |set: usize| run.iter().flat_map(move |of| of.texcoords.map(|sets| sets[set]));
            let last = 3 * run.len() as u32;
            Self {
                name: regions.get(region as usize).cloned().unwrap_or_default(),
                material,
                region,
                vertices: run.iter().flat_map(|of| of.positions).collect(),
                faces: (0..last).step_by(3).map(|first| [first, first + 1, first + 2]).collect(),
                normals: run.iter().flat_map(|of| of.normals).collect(),
                texcoords: [every(0).collect(), Vec::new()],
                colors: run.iter().flat_map(|of| of.colors).collect(),
            }
        };
        triangles.chunk_by(alike).map(mesh).collect()
    }

    /// The positions of all triangles' corners. The mesh has been checked.
    pub(super) fn corners(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.faces.iter().flatten().map(|&vertex| self.vertices[vertex as usize].as_dvec3())
    }

    /// Checks indices, lengths and positions. `material` is the mesh's material.
    pub(super) fn check(&self, material: &Material) -> Result<()> {
        let fault = |property: &str, what: String| Error::option(format!("{}.{property}", self.name), what);
        let count = self.vertices.len();
        if self.faces.is_empty() {
            return Err(fault("faces", "there is no triangle".into()).help("give an array of shape (m, 3)"));
        }
        let wrong = self.faces.iter().position(|face| face.iter().any(|&vertex| vertex as usize >= count));
        if let Some(face) = wrong {
            let what = format!("row {face} is {:?}, but there are {count} vertices", self.faces[face]);
            return Err(fault("faces", what).help("give indices of vertices, counted from 0"));
        }
        let is_far = |vertex: &Vec3| !vertex.is_finite() || vertex.abs().max_element() > MAX_COORDINATE;
        if let Some(vertex) = self.vertices.iter().position(is_far) {
            let what = format!("row {vertex} is {}", self.vertices[vertex]);
            let help =
                format!("give finite coordinates in metres, at most {MAX_COORDINATE:e} from the origin");
            return Err(fault("vertices", what).help(help));
        }
        let [first, second] = &self.texcoords;
        let finite = |sets: &Vec<Vec2>| sets.iter().all(|coordinate| coordinate.is_finite());
        let normals = self.normals.iter().all(|normal| normal.is_finite());
        for (property, length, is_finite) in [
            ("normals", self.normals.len(), normals),
            ("uv", first.len(), finite(first)),
            ("uv_2", second.len(), finite(second)),
            ("colors", self.colors.len(), true),
        ] {
            if length != 0 && length != count {
                let what = format!("it has {length} rows, but there are {count} vertices");
                return Err(fault(property, what).help("give one row for each vertex"));
            }
            if !is_finite {
                return Err(fault(property, "it is not finite".into()).help("give finite numbers"));
            }
        }
        match material.textures().find(|(_, texture)| self.texcoords[texture.set as usize & 1].is_empty()) {
            Some((role, texture)) => {
                let property = if texture.set == 0 { "uv" } else { "uv_2" };
                let what = format!("there is none, but the {role} texture of {} reads it", material.name);
                Err(fault(property, what).help("give texture coordinates of shape (n, 2)"))
            }
            None => Ok(()),
        }
    }

    /// The triangles that have an area, in coordinates with this origin, and the number of the others. The mesh has been checked.
    pub(super) fn triangles(&self, material: &Material, origin: DVec3) -> (Vec<Triangle>, usize) {
        // Coordinates that no texture reads are zero, as in a loaded scene.
        let reads = material.texture_sets();
        let triangle = |face: &[u32; 3]| {
            let corners = face.map(|vertex| vertex as usize);
            let mut triangle = Triangle::flat(
                corners.map(|vertex| (self.vertices[vertex].as_dvec3() - origin).as_vec3()),
                self.material,
                self.region,
            );
            if !self.normals.is_empty() {
                triangle.normals = corners.map(|vertex| unit(self.normals[vertex].as_dvec3()));
            }
            for set in (0..2).filter(|&set| reads[set]) {
                for (to, vertex) in triangle.texcoords.iter_mut().zip(corners) {
                    to[set] = self.texcoords[set][vertex];
                }
            }
            if !self.colors.is_empty() {
                triangle.colors = corners.map(|vertex| self.colors[vertex]);
            }
            triangle
        };
        let found: Vec<Triangle> = self.faces.iter().map(triangle).filter(Triangle::has_area).collect();
        let dropped = self.faces.len() - found.len();
        (found.into_iter().map(Triangle::with_normals_in_front).collect(), dropped)
    }
}
