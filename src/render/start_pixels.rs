//! The pixels that light paths start from, so that several processes can each trace a part of them.

use std::ops::Range;

/// Consecutive pixels of each endpoint of the rig that light paths start from. In a coaxial rig all paths start from the camera, and the range
/// of the projector is empty.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct StartPixels {
    /// Pixels of the camera.
    pub camera: Range<usize>,
    /// Pixels of a projector that stands apart.
    pub projector: Range<usize>,
}

impl StartPixels {
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.camera.is_empty() && self.projector.is_empty()
    }

    /// These pixels cut into `parts` ranges of each endpoint, whose lengths differ by one pixel at most. The parts are in the order of the pixels,
    /// and cover each pixel once; some are empty where there are fewer pixels than parts.
    pub fn split(&self, parts: usize) -> Vec<Self> {
        let [camera, projector] = [&self.camera, &self.projector].map(|pixels| cut(pixels, parts));
        camera.into_iter().zip(projector).map(|(camera, projector)| Self { camera, projector }).collect()
    }
}

/// A range cut into `parts` ranges of about equal length.
fn cut(pixels: &Range<usize>, parts: usize) -> Vec<Range<usize>> {
    let at = |part: usize| pixels.start + (pixels.len() as u128 * part as u128 / parts as u128) as usize;
    (0..parts).map(|part| at(part)..at(part + 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_each_pixel_once_and_in_order() {
        let all = StartPixels { camera: 3..20, projector: 0..2 };
        for parts in 1..8 {
            let found = all.split(parts);
            assert_eq!(found.len(), parts);
            let chained: Vec<usize> = found.iter().flat_map(|part| part.camera.clone()).collect();
            assert_eq!(chained, (3..20).collect::<Vec<_>>());
            let chained: Vec<usize> = found.iter().flat_map(|part| part.projector.clone()).collect();
            assert_eq!(chained, [0, 1]);
            let lengths = found.iter().map(|part| part.camera.len());
            assert!(lengths.clone().max() <= lengths.min().map(|least| least + 1));
        }
    }
}
