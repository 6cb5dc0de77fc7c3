//! The geometry of an `.obj` file.

use std::collections::HashMap;
use std::path::Path;

use glam::{Vec2, Vec3};

use super::line::{Line, shortened, statements};
use crate::error::Result;
use crate::scene::source::{Warnings, fault};
use crate::scene::triangle::{MAX_TRIANGLES, Triangle};

/// The index of what a corner does not have.
pub(super) const NONE: u32 = u32::MAX;

/// Kinds of statements that are named in warnings, at most.
const MAX_UNKNOWN: usize = 16;

/// Indices of what a face's corner refers to.
#[derive(Clone, Copy)]
pub(super) struct Corner {
    pub position: u32,
    /// Or [`NONE`].
    pub texcoord: u32,
    /// Or [`NONE`].
    pub normal: u32,
}

/// A triangle of the file.
pub(super) struct Face {
    pub corners: [Corner; 3],
    /// Index into [`Mesh::groups`].
    pub group: u32,
    /// Index into [`Mesh::materials`], or [`NONE`].
    pub material: u32,
}

/// Everything in the file.
#[derive(Default)]
pub(super) struct Mesh {
    pub positions: Vec<Vec3>,
    /// One for each position, or none at all.
    pub colors: Vec<[u16; 4]>,
    /// With `v` downwards, as pictures are stored.
    pub texcoords: Vec<Vec2>,
    /// Unit vectors; zero for what has no direction.
    pub normals: Vec<Vec3>,
    pub faces: Vec<Face>,
    /// Names of the groups that have faces.
    pub groups: Vec<String>,
    /// Names of the materials that faces ask for.
    pub materials: Vec<String>,
    /// What follows each `mtllib`.
    pub libraries: Vec<String>,
}

/// Names in the order met.
#[derive(Default)]
struct Names {
    list: Vec<String>,
    index_of: HashMap<String, u32>,
}

impl Names {
    fn index_of(&mut self, name: &str) -> u32 {
        if let Some(&index) = self.index_of.get(name) {
            return index;
        }
        let index = self.list.len() as u32;
        self.list.push(name.into());
        self.index_of.insert(name.into(), index);
        index
    }
}

struct Parser<'a> {
    mesh: Mesh,
    groups: Names,
    materials: Names,
    group: String,
    /// The index of `group`, once it has a face.
    group_index: Option<u32>,
    material: u32,
    unknown: usize,
    warnings: &'a mut Warnings,
    path: &'a Path,
}

impl Mesh {
    pub(super) fn parse(path: &Path, text: &str, warnings: &mut Warnings) -> Result<Self> {
        let mut parser = Parser {
            mesh: Self::default(),
            groups: Names::default(),
            materials: Names::default(),
            group: "unnamed".into(),
            group_index: None,
            material: NONE,
            unknown: 0,
            warnings,
            path,
        };
        statements(path, text, |line| parser.statement(line))?;
        let Parser { mut mesh, groups, materials, .. } = parser;
        // Vertices after the last coloured one are white.
        if !mesh.colors.is_empty() {
            mesh.colors.resize(mesh.positions.len(), Triangle::WHITE);
        }
        mesh.groups = groups.list;
        mesh.materials = materials.list;
        Ok(mesh)
    }
}

impl Parser<'_> {
    fn statement(&mut self, line: &Line<'_>) -> Result<()> {
        match line.keyword {
            "v" => self.vertex(line)?,
            "vt" => match line.numbers()?.as_slice() {
                [u] => self.mesh.texcoords.push(Vec2::new(*u, 1.0)),
                [u, v] | [u, v, _] => self.mesh.texcoords.push(Vec2::new(*u, 1.0 - v)),
                _ => return Err(line.fault("`vt` takes one to three numbers")),
            },
            "vn" => match line.numbers()?.as_slice() {
                [x, y, z] => {
                    let normal = Vec3::new(*x, *y, *z).as_dvec3().normalize_or_zero().as_vec3();
                    self.mesh.normals.push(normal);
                }
                _ => return Err(line.fault("`vn` takes three numbers")),
            },
            "f" => self.face(line)?,
            "o" | "g" => {
                self.group = if line.rest.is_empty() { "unnamed".into() } else { line.rest.into() };
                self.group_index = None;
            }
            "usemtl" => self.material = self.materials.index_of(line.rest),
            "mtllib" => {
                if !self.mesh.libraries.iter().any(|known| known == line.rest) {
                    self.mesh.libraries.push(line.rest.into());
                }
            }
            "s" => {}
            "l" | "p" => self.warnings.add("points and lines have no area: ignored"),
            other => {
                if self.unknown < MAX_UNKNOWN {
                    self.warnings.add(format!("`{}` is not supported and ignored", shortened(other)));
                }
                self.unknown += 1;
            }
        }
        Ok(())
    }

    fn vertex(&mut self, line: &Line<'_>) -> Result<()> {
        let numbers = line.numbers()?;
        let [x, y, z, rest @ ..] = numbers.as_slice() else {
            return Err(line.fault("`v` takes at least three numbers"));
        };
        match rest {
            [] | [1.0] => {}
            [_] => return Err(line.fault("a vertex has a weight, which only free-form surfaces have")),
            [red, green, blue] | [red, green, blue, _] => {
                let color = [*red, *green, *blue, 1.0];
                self.mesh.colors.resize(self.mesh.positions.len(), Triangle::WHITE);
                self.mesh.colors.push(Triangle::quantized(color));
            }
            _ => return Err(line.fault("`v` takes three numbers, or six with a colour")),
        }
        self.mesh.positions.push(Vec3::new(*x, *y, *z));
        Ok(())
    }

    fn face(&mut self, line: &Line<'_>) -> Result<()> {
        let words = line.rest.split_whitespace().take_while(|word| !word.starts_with('#'));
        let mut corners = words.map(|word| self.corner(line, word));
        let (Some(first), Some(second)) = (corners.next().transpose()?, corners.next().transpose()?) else {
            return Err(line.fault("a face has fewer than three corners"));
        };
        let rest = corners.collect::<Result<Vec<Corner>>>()?;
        if rest.is_empty() {
            return Err(line.fault("a face has fewer than three corners"));
        }
        if self.mesh.faces.len() + rest.len() > MAX_TRIANGLES {
            return Err(fault(
                self.path,
                format!("more than {MAX_TRIANGLES} triangles"),
                "simplify the meshes",
            ));
        }
        let group = *self.group_index.get_or_insert_with(|| self.groups.index_of(&self.group));
        let mut last = second;
        for next in rest {
            let corners = [first, last, next];
            self.mesh.faces.push(Face { corners, group, material: self.material });
            last = next;
        }
        Ok(())
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&self, line: &Line<'_>, word: &str) -> Result<Corner> {
        let Mesh { positions, texcoords, normals, .. } = &self.mesh;
        let mut parts = word.split('/');
        let mut index = |what: &str, count: usize| match parts.next() {
            None | Some("") => Ok(NONE),
            Some(text) => resolve(text, count).ok_or_else(|| {
                line.fault(&format!("`{}`: there is no such {what}; there are {count}", shortened(word)))
            }),
        };
        let corner = Corner {
            position: index("vertex", positions.len())?,
            texcoord: index("texture coordinate", texcoords.len())?,
            normal: index("normal", normals.len())?,
        };
        if corner.position == NONE || parts.next().is_some() {
            return Err(line.fault(&format!("`{}` is no corner of a face", shortened(word))));
        }
        Ok(corner)
    }
}

/// An index that counts from 1, or backwards from −1, among `count` elements.
fn resolve(text: &str, count: usize) -> Option<u32> {
    let count = i64::try_from(count).ok()?;
    let index = match text.parse::<i64>().ok()? {
        0 => return None,
        index if index > 0 => index - 1,
        index => count.checked_add(index)?,
    };
    (0..count).contains(&index).then(|| u32::try_from(index).ok()).flatten()
}
