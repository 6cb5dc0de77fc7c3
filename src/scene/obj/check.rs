//! Validation of an `.obj` file, statement by statement, before `tobj` reads its geometry.
//!
//! `tobj` reports errors without line numbers, accepts numbers that are not finite and indices that do not exist, invents texture
//! coordinates and normals for corners without them, and mixes up colours if only some vertices have one. Therefore valid
//! statements are copied, word by word, into unambiguous text for `tobj`: `v x y z r g b`, `vt u v`, `vn x y z` and `f`. Groups and
//! materials are recorded here, because `tobj` ignores materials that no library defines.

use std::borrow::Cow;

use indexmap::IndexSet;

use super::line::{Line, shortened};
use crate::error::Result;
use crate::scene::source::{Warnings, fault};
use crate::scene::triangle::MAX_TRIANGLES;

/// Maximum number of unknown statement kinds that warnings name.
const MAX_UNKNOWN: usize = 16;

/// What the indices of a corner refer to, in order.
const ELEMENTS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// Consecutive faces of the same group and material.
#[derive(Clone, Copy)]
pub(super) struct Run {
    pub faces: usize,
    /// Index into [`Checked::groups`].
    pub group: u32,
    /// Index into [`Checked::materials`], if a `usemtl` precedes the faces.
    pub material: Option<u32>,
}

/// The content of the statements read so far.
#[derive(Default)]
pub(super) struct Checked {
    /// The geometry as plain text for `tobj`.
    pub plain: String,
    /// Whether each corner has a texture coordinate and a normal.
    pub given: Vec<[bool; 2]>,
    pub runs: Vec<Run>,
    /// Names of the groups that have faces.
    pub groups: IndexSet<String>,
    /// Names of the materials that faces use.
    pub materials: IndexSet<String>,
    /// The arguments of each `mtllib`.
    pub libraries: IndexSet<String>,
    group: String,
    material: Option<u32>,
    /// Number of elements of each kind so far.
    counts: [usize; 3],
    triangles: usize,
    unknown: usize,
    /// Whether there are points or lines.
    pub has_points: bool,
}

impl Checked {
    pub(super) fn statement(&mut self, line: &Line<'_>, warnings: &mut Warnings) -> Result<()> {
        match line.keyword {
            "v" => self.vertex(line, warnings)?,
            "vt" => match *line.numbers()? {
                [_] => self.element(1, line, 1, " 0"),
                [_, _] | [_, _, _] => self.element(1, line, 2, ""),
                _ => return Err(line.fault("`vt` takes one to three numbers")),
            },
            "vn" => match *line.numbers()? {
                [_, _, _] => self.element(2, line, 3, ""),
                _ => return Err(line.fault("`vn` takes three numbers")),
            },
            "f" => self.face(line, warnings)?,
            "o" | "g" => self.group = line.rest.into(),
            "usemtl" => {
                let name = if line.rest.is_empty() { super::mtl::UNNAMED } else { line.rest };
                self.material = Some(index_of(&mut self.materials, name));
            }
            "mtllib" => {
                index_of(&mut self.libraries, line.rest);
            }
            "s" => {}
            "l" | "p" => {
                self.has_points = true;
                warnings.add("points and lines have no area: ignored");
            }
            other => {
                if self.unknown < MAX_UNKNOWN {
                    warnings.add(format!("`{}` is not supported and ignored", shortened(other)));
                }
                self.unknown += 1;
            }
        }
        Ok(())
    }

    fn vertex(&mut self, line: &Line<'_>, warnings: &mut Warnings) -> Result<()> {
        let (words, color) = match *line.numbers()? {
            [_, _, _] | [_, _, _, 1.0] => (3, " 1 1 1"),
            [_, _, _, _] => {
                warnings.add("weights of vertices are ignored: only free-form surfaces have a use for them");
                (3, " 1 1 1")
            }
            [_, _, _, _, _, _] | [_, _, _, _, _, _, _] => (6, ""),
            [] | [_] | [_, _] => return Err(line.fault("`v` takes at least three numbers")),
            _ => return Err(line.fault("`v` takes three numbers, or six with a colour")),
        };
        self.element(0, line, words, color);
        Ok(())
    }

    /// Copies the first words of an element's line, which are numbers, and appends what the file leaves out.
    fn element(&mut self, kind: usize, line: &Line<'_>, words: usize, rest: &str) {
        self.counts[kind] += 1;
        self.plain.push_str(line.keyword);
        for word in line.words().take(words) {
            self.plain.push(' ');
            self.plain.push_str(word);
        }
        self.plain.push_str(rest);
        self.plain.push('\n');
    }

    fn face(&mut self, line: &Line<'_>, warnings: &mut Warnings) -> Result<()> {
        self.plain.push('f');
        let mut corners = 0_usize;
        for word in line.words() {
            let (given, plain) = self.corner(line, word, warnings)?;
            self.given.push(given);
            self.plain.push(' ');
            self.plain.push_str(&plain);
            corners += 1;
        }
        self.plain.push('\n');
        if corners < 3 {
            return Err(line.fault("a face has fewer than three corners"));
        }
        self.triangles += corners - 2;
        if self.triangles > MAX_TRIANGLES {
            return Err(fault(
                line.path,
                format!("more than {MAX_TRIANGLES} triangles"),
                "simplify the meshes",
            ));
        }
        let group = if self.group.is_empty() { "unnamed" } else { &self.group };
        let group = index_of(&mut self.groups, group);
        match self.runs.last_mut() {
            Some(run) if (run.group, run.material) == (group, self.material) => run.faces += 1,
            _ => self.runs.push(Run { faces: 1, group, material: self.material }),
        }
        Ok(())
    }

    /// Checks a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`. Returns whether it has a texture coordinate and a normal, and the corner without those
    /// that the file does not have: exporters that leave them out may still count them.
    fn corner<'b>(
        &self,
        line: &Line<'_>,
        word: &'b str,
        warnings: &mut Warnings,
    ) -> Result<([bool; 2], Cow<'b, str>)> {
        let mut kept = [""; 3];
        let mut is_whole = true;
        let mut indices = word.split('/');
        for ((kept, count), element) in kept.iter_mut().zip(self.counts).zip(ELEMENTS) {
            let index = indices.next().unwrap_or("");
            if index.is_empty() || exists(index, count) {
                *kept = index;
            } else if element != ELEMENTS[0] && index.parse::<i64>().is_ok_and(|at| at != 0) {
                let consequence =
                    if element == ELEMENTS[2] { "they are flat" } else { "they show no texture" };
                warnings.add(format!("faces refer to {element}s that the file does not have: {consequence}"));
                is_whole = false;
            } else {
                let word = shortened(word);
                return Err(line.fault(&format!("`{word}`: there is no such {element}; there are {count}")));
            }
        }
        let [vertex, texcoord, normal] = kept;
        if vertex.is_empty() || indices.next().is_some() {
            return Err(line.fault(&format!("`{}` is no corner of a face", shortened(word))));
        }
        let plain = match (is_whole, normal) {
            (true, _) => Cow::Borrowed(word),
            (false, "") => Cow::Owned(format!("{vertex}/{texcoord}").trim_end_matches('/').to_owned()),
            (false, normal) => Cow::Owned(format!("{vertex}/{texcoord}/{normal}")),
        };
        Ok(([!texcoord.is_empty(), !normal.is_empty()], plain))
    }
}

/// Whether an index, counted from 1 or backwards from −1, refers to one of `count` elements.
fn exists(index: &str, count: usize) -> bool {
    index.parse::<i64>().is_ok_and(|index| (1..=count as u64).contains(&index.unsigned_abs()))
}

/// The index of a name in `names`; a new name is added.
fn index_of(names: &mut IndexSet<String>, name: &str) -> u32 {
    names.get_index_of(name).unwrap_or_else(|| names.insert_full(name.into()).0) as u32
}
