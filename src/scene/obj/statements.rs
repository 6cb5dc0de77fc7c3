//! Lines of `.obj` and `.mtl` files, and the geometry of an `.obj` file in double precision. Errors name the line.

use std::fmt;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use indexmap::IndexSet;

use crate::error::{Error, Result};
use crate::scene::source::SceneFile;
use crate::scene::triangle::{MAX_TRIANGLES, Triangle};

pub(super) const UNNAMED: &str = "unnamed";

/// A statement. Continuation lines are joined.
#[derive(Clone, Copy)]
pub(super) struct Line<'a> {
    pub path: &'a Path,
    number: usize,
    pub keyword: &'a str,
    pub rest: &'a str,
}

/// The largest number of numbers in a statement, plus one.
const MAX_NUMBERS: usize = 8;

pub(super) struct Arguments {
    first: [f32; MAX_NUMBERS],
    count: usize,
}

impl std::ops::Deref for Arguments {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.first[..self.count]
    }
}

pub(super) fn statements(
    path: &Path,
    text: &str,
    mut each: impl FnMut(&Line<'_>) -> Result<()>,
) -> Result<()> {
    let mut joined = String::new();
    for (index, line) in text.lines().enumerate() {
        if let Some(continued) = line.trim_end().strip_suffix('\\') {
            joined.push_str(continued);
            joined.push(' ');
            continue;
        }
        let statement = if joined.is_empty() {
            line.trim()
        } else {
            joined.push_str(line);
            joined.trim()
        };
        let (keyword, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
        if !keyword.is_empty() && !keyword.starts_with('#') {
            each(&Line { path, number: index + 1, keyword, rest: rest.trim() })?;
        }
        joined.clear();
    }
    Ok(())
}

impl<'a> Line<'a> {
    pub(super) fn fault(&self, what: impl fmt::Display) -> Error {
        Error::scene(self.path, format!("line {}: {what}", self.number))
            .help("correct the line, or export the scene again")
    }

    pub(super) fn place(&self) -> String {
        let file = self.path.file_name().unwrap_or_default();
        format!("line {} of {}", self.number, file.display())
    }

    /// The line without its first argument, if this argument is `word`.
    pub(super) fn after(&self, word: &str) -> Option<Self> {
        let rest = self.rest.strip_prefix(word)?;
        rest.starts_with(char::is_whitespace).then(|| Self { rest: rest.trim_start(), ..*self })
    }

    /// The arguments up to a comment.
    pub(super) fn words(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.rest.split_whitespace().take_while(|word| !word.starts_with('#'))
    }

    pub(super) fn numbers(&self) -> Result<Arguments> {
        let mut numbers = Arguments { first: [0.0; MAX_NUMBERS], count: 0 };
        for word in self.words() {
            let number = word.parse::<f32>().ok().filter(|number| number.is_finite());
            let number =
                number.ok_or_else(|| self.fault(format!("`{}` is not a finite number", shortened(word))))?;
            if numbers.count < MAX_NUMBERS {
                numbers.first[numbers.count] = number;
                numbers.count += 1;
            }
        }
        Ok(numbers)
    }

    pub(super) fn number(&self) -> Result<f32> {
        match *self.numbers()? {
            [number] => Ok(number),
            _ => Err(self.fault(format!("`{}` takes one number", shortened(self.keyword)))),
        }
    }
}

/// The beginning of a word, short enough for a one-line message.
pub(super) fn shortened(word: &str) -> String {
    match word.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &word[..end]),
        None => word.into(),
    }
}

// The geometry of an `.obj` file. The crate `tobj` is not used: it reads positions in single precision, which is too coarse far from the
// origin, accepts indices that do not exist, and reports errors without line numbers.

const MAX_UNKNOWN: usize = 16;

const ELEMENTS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// Consecutive faces of the same group and material.
#[derive(Clone, Copy)]
pub(super) struct FaceRun {
    pub faces: usize,
    /// Index into [`Checked::groups`].
    pub group: u32,
    /// Index into [`Checked::materials`], if a `usemtl` precedes the faces.
    pub material: Option<u32>,
}

#[derive(Default)]
pub(super) struct Checked {
    /// Positions in the file's coordinates, and their colours.
    pub vertices: Vec<(DVec3, [u16; 4])>,
    /// Texture coordinates with `v` pointing downwards, as pictures are stored.
    pub texcoords: Vec<Vec2>,
    /// Unit vectors; zero where the file's normal has no direction.
    pub normals: Vec<Vec3>,
    /// The vertex, texture coordinate and normal of each corner of the faces, counted from 1. A missing element is 0.
    pub corners: Vec<[u32; 3]>,
    /// The number of corners of each face.
    pub sizes: Vec<u32>,
    pub runs: Vec<FaceRun>,
    /// Names of the groups that have faces.
    pub groups: IndexSet<String>,
    /// Names of the materials that faces use.
    pub materials: IndexSet<String>,
    /// The arguments of each `mtllib`.
    pub libraries: IndexSet<String>,
    group: String,
    material: Option<u32>,
    triangles: usize,
    unknown: usize,
    pub has_points: bool,
}

impl Checked {
    pub(super) fn statement(&mut self, line: &Line<'_>, file: &mut SceneFile) -> Result<()> {
        match line.keyword {
            "v" => self.vertex(line, file)?,
            "vt" => match *line.numbers()? {
                [u] => self.texcoords.push(Vec2::new(u, 1.0)),
                [u, v] | [u, v, _] => self.texcoords.push(Vec2::new(u, 1.0 - v)),
                _ => return Err(line.fault("`vt` takes one to three numbers")),
            },
            "vn" => match *line.numbers()? {
                [x, y, z] => {
                    let normal = DVec3::new(x.into(), y.into(), z.into());
                    self.normals.push(normal.normalize_or_zero().as_vec3());
                }
                _ => return Err(line.fault("`vn` takes three numbers")),
            },
            "f" => self.face(line, file)?,
            "o" | "g" => self.group = line.rest.into(),
            "usemtl" => {
                let name = if line.rest.is_empty() { UNNAMED } else { line.rest };
                self.material = Some(index_of(&mut self.materials, name));
            }
            "mtllib" => {
                index_of(&mut self.libraries, line.rest);
            }
            "s" => {}
            "l" | "p" => {
                self.has_points = true;
                file.warn("points and lines have no area: ignored");
            }
            other => {
                if self.unknown < MAX_UNKNOWN {
                    file.warn(format!("`{}` is not supported and ignored", shortened(other)));
                }
                self.unknown += 1;
            }
        }
        Ok(())
    }

    fn vertex(&mut self, line: &Line<'_>, file: &mut SceneFile) -> Result<()> {
        let color = match *line.numbers()? {
            [_, _, _] | [_, _, _, 1.0] => Triangle::WHITE,
            [_, _, _, _] => {
                file.warn("weights of vertices are ignored: only free-form surfaces have a use for them");
                Triangle::WHITE
            }
            [_, _, _, red, green, blue] | [_, _, _, red, green, blue, _] => {
                Triangle::quantized([red, green, blue, 1.0])
            }
            [] | [_] | [_, _] => return Err(line.fault("`v` takes at least three numbers")),
            _ => return Err(line.fault("`v` takes three numbers, or six with a colour")),
        };
        let mut position = DVec3::ZERO;
        for (axis, word) in line.words().take(3).enumerate() {
            // The words have been checked above to be numbers.
            position[axis] = word.parse().unwrap_or_default();
        }
        self.vertices.push((position, color));
        Ok(())
    }

    fn face(&mut self, line: &Line<'_>, file: &mut SceneFile) -> Result<()> {
        let before = self.corners.len();
        for word in line.words() {
            let corner = self.corner(line, word, file)?;
            self.corners.push(corner);
        }
        let corners = self.corners.len() - before;
        if corners < 3 {
            return Err(line.fault("a face has fewer than three corners"));
        }
        self.sizes.push(corners as u32);
        self.triangles += corners - 2;
        if self.triangles > MAX_TRIANGLES {
            return Err(Error::scene(line.path, format!("more than {MAX_TRIANGLES} triangles"))
                .help("simplify the meshes"));
        }
        let group = if self.group.is_empty() { "unnamed" } else { &self.group };
        let group = index_of(&mut self.groups, group);
        match self.runs.last_mut() {
            Some(run) if (run.group, run.material) == (group, self.material) => run.faces += 1,
            _ => self.runs.push(FaceRun { faces: 1, group, material: self.material }),
        }
        Ok(())
    }

    /// Reads a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`, as indices counted from 1. Some exporters omit texture coordinates and normals but
    /// still refer to them. Such references are dropped with a warning.
    fn corner(&self, line: &Line<'_>, word: &str, file: &mut SceneFile) -> Result<[u32; 3]> {
        let counts = [self.vertices.len(), self.texcoords.len(), self.normals.len()];
        let mut found = [0; 3];
        let mut indices = word.split('/');
        for ((found, count), element) in found.iter_mut().zip(counts).zip(ELEMENTS) {
            let index = indices.next().unwrap_or("");
            if index.is_empty() {
                continue;
            }
            let number = index.parse::<i64>().ok();
            if let Some(existing) = number.and_then(|number| existing(number, count)) {
                *found = existing;
            } else if element != ELEMENTS[0] && number.is_some_and(|number| number != 0) {
                let consequence =
                    if element == ELEMENTS[2] { "they are flat" } else { "they show no texture" };
                file.warn(format!("faces refer to {element}s that the file does not have: {consequence}"));
            } else {
                let word = shortened(word);
                return Err(line.fault(format!("`{word}`: there is no such {element}; there are {count}")));
            }
        }
        if found[0] == 0 || indices.next().is_some() {
            return Err(line.fault(format!("`{}` is no corner of a face", shortened(word))));
        }
        Ok(found)
    }
}

/// Converts an index to the number of the element, counted from 1. The index counts from 1, or backwards from −1.
fn existing(index: i64, count: usize) -> Option<u32> {
    let count = i64::try_from(count).ok()?;
    let index = if index < 0 { count + 1 + index } else { index };
    (1..=count).contains(&index).then(|| u32::try_from(index).ok())?
}

fn index_of(names: &mut IndexSet<String>, name: &str) -> u32 {
    names.get_index_of(name).unwrap_or_else(|| names.insert_full(name.into()).0) as u32
}
