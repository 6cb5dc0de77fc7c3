//! The order in which processes merge the rows of a matrix.

use std::ops::Range;

use super::RigShape;

/// The steps in which the rows of a matrix are merged: in each of them, every process merges a group of its rows, at the same time as the others.
///
/// A contribution counts for the rows of the pixels at both ends of its path in a coaxial rig, and for the one of its camera pixel else. It is
/// needed in the first of the steps of its rows alone: later, the entry that it is part of is read from the rows that are finished, which have its
/// mirror image.
#[derive(Debug)]
pub(super) struct Steps {
    symmetric: bool,
    /// The groups of each process by rank, one for each step; some of the last ones are empty.
    groups: Vec<Vec<Range<usize>>>,
    /// The step of each pixel of the camera.
    of_pixel: Vec<u8>,
}

impl Steps {
    /// The steps of processes with these groups of rows. All rows together are those of the camera, and no process has more than 255 groups.
    pub(super) fn new(rig: RigShape, mut groups: Vec<Vec<Range<usize>>>) -> Self {
        let pixels = rig.camera.pixels();
        let count = groups.iter().map(Vec::len).max().unwrap_or(0).max(1);
        let mut of_pixel = vec![0; pixels];
        for groups in &mut groups {
            for (step, group) in groups.iter().enumerate() {
                of_pixel[group.clone()].fill(step as u8);
            }
            let end = groups.last().map_or(0, |last| last.end);
            groups.resize(count, end..end);
        }
        Self { symmetric: rig.symmetric, groups, of_pixel }
    }

    /// The number of steps.
    pub(super) fn count(&self) -> usize {
        self.groups.first().map_or(1, Vec::len)
    }

    /// The group of each process, by rank.
    pub(super) fn groups(&self, step: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        self.groups.iter().map(move |groups| groups[step].clone())
    }

    /// The rows of each process.
    pub(super) fn rows(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.groups.iter().map(|groups| groups[0].start..groups[groups.len() - 1].end)
    }

    /// The step of a pixel of the camera.
    pub(super) fn of_pixel(&self, pixel: usize) -> usize {
        usize::from(self.of_pixel[pixel])
    }

    /// The step in which a contribution is needed, of a path from `pixel` to the pixel `other`.
    pub(super) fn of(&self, pixel: u32, from_camera: bool, other: u32) -> usize {
        let of_pixel = |pixel: u32| self.of_pixel(pixel as usize);
        match (self.symmetric, from_camera) {
            (true, _) => of_pixel(pixel).min(of_pixel(other)),
            (false, true) => of_pixel(pixel),
            (false, false) => of_pixel(other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    #[test]
    fn a_contribution_is_needed_in_the_first_step_of_its_rows() {
        let size = Resolution::new(8, 1);
        // The second process has fewer rows, and the third has none.
        let groups = vec![vec![0..2, 2..4, 4..5], vec![5..7, 7..8], Vec::new()];
        let steps = |symmetric: bool| {
            let rig = RigShape { camera: size, projector: size, symmetric };
            Steps::new(rig, groups.clone())
        };
        let coaxial = steps(true);
        assert_eq!(coaxial.count(), 3);
        assert_eq!(coaxial.groups(1).collect::<Vec<_>>(), [2..4, 7..8, 0..0]);
        assert_eq!(coaxial.rows().collect::<Vec<_>>(), [0..5, 5..8, 0..0]);
        assert_eq!((0..8).map(|pixel| coaxial.of_pixel(pixel)).collect::<Vec<_>>(), [0, 0, 1, 1, 2, 0, 0, 1]);
        assert_eq!([(4, 7), (7, 4), (3, 6)].map(|(pixel, other)| coaxial.of(pixel, true, other)), [1, 1, 0]);
        let apart = steps(false);
        assert_eq!([(4, true, 0), (0, true, 4), (0, false, 4)].map(|(p, c, o)| apart.of(p, c, o)), [2, 0, 2]);
    }
}
