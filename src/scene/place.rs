//! The position of a scene in the coordinates of its file, and the distance of its surfaces from the camera.
//!
//! Single precision resolves a coordinate to one part in 2²⁴. With survey coordinates, a scene of one metre may lie 500 km from the file's
//! origin, and its corners would be known only to 3 cm. A loader therefore first notes all corners in double precision. It then moves the
//! origin of a distant scene to its camera, and rounds the coordinates to single precision last.

use std::path::Path;

use glam::DVec3;

use crate::error::{Error, Result};

/// The scene is moved if a coordinate of the camera exceeds the distance between camera and surfaces times this factor. At this ratio,
/// single precision resolves coordinates to a millionth of that distance, which is less than the tracer's offsets. Other scenes keep their
/// coordinates exactly.
const FAR: f64 = 8.0;

/// Numbers of a file are coarse if their resolution, relative to the distance from the camera, exceeds this: several times the tracer's
/// offsets.
const COARSE: f64 = 1.0 / 16384.0;

/// The smallest distance between camera and surfaces, in metres. If it were a few powers of two smaller, radiance would overflow single
/// precision.
const NEAREST: f64 = 1e-12;

/// A histogram of distances, as the sum of weights for each power of two.
pub(crate) struct Distances(Vec<f64>);

impl Distances {
    pub(crate) fn new() -> Self {
        Self(vec![0.0; 2048])
    }

    /// Adds a distance with a weight. Zero and NaN are ignored.
    pub(crate) fn add(&mut self, distance: f64, weight: f64) {
        if distance > 0.0 && weight > 0.0 {
            // The index is the biased exponent of the distance.
            self.0[(distance.to_bits() >> 52) as usize] += weight;
        }
    }

    /// The exponent of the power of two at which the cumulative weight, from near to far, reaches this fraction of the total; 0 without
    /// distances. If all distances are multiplied by `2^k`, the result grows by `k`.
    pub(crate) fn power(&self, share: f64) -> i32 {
        let wanted = share * self.0.iter().sum::<f64>();
        let mut below = 0.0;
        let reaches = |weight: &f64| {
            below += weight;
            below >= wanted
        };
        let found = self.0.iter().position(reaches).filter(|_| wanted > 0.0);
        found.map_or(0, |exponent| exponent as i32 - 1023)
    }
}

/// The position of a scene, as found from its corners in the file's coordinates.
pub(super) struct Place {
    /// The position of the camera, or of the first corner if there is no camera.
    anchor: Option<DVec3>,
    /// The origin of the scene's coordinates, in the file's coordinates. It is the file's origin until [`Place::settle`] moves it.
    pub(super) origin: DVec3,
    distances: Distances,
    is_settled: bool,
    /// Four counts: coordinates; coordinates with a coarse step in single precision; coarse coordinates that are single-precision numbers;
    /// and coarse single-precision coordinates that are odd multiples of the step.
    numbers: [u64; 4],
    /// The largest coarse step, in metres.
    step: f64,
}

impl Place {
    /// Starts with a camera at this position. `None` stands for a camera that will be placed in front of the scene.
    pub(super) fn of(camera: Option<DVec3>) -> Self {
        let (origin, distances) = (DVec3::ZERO, Distances::new());
        Self { anchor: camera, origin, distances, is_settled: false, numbers: [0; 4], step: 0.0 }
    }

    /// Notes a corner at `at`. In the file, the corner has the coordinates `stated`, in units of `unit` metres.
    pub(super) fn note(&mut self, at: DVec3, stated: DVec3, unit: f64) {
        if self.is_settled {
            return;
        }
        let distance = at.distance(*self.anchor.get_or_insert(at));
        self.distances.add(distance, 1.0);
        for number in stated.to_array() {
            let single = number as f32;
            let step = unit * f64::from(single.abs().next_up() - single.abs());
            self.numbers[0] += 1;
            if distance > 0.0 && step > COARSE * distance {
                let is_single = f64::from(single) == number;
                self.numbers[1] += 1;
                self.numbers[2] += u64::from(is_single);
                self.numbers[3] += u64::from(is_single && single.to_bits() & 1 == 1);
                self.step = self.step.max(step);
            }
        }
    }

    /// A power of two near the median distance between camera and surfaces, in metres.
    pub(super) fn distance(&self) -> f64 {
        2_f64.powi(self.distances.power(0.5))
    }

    /// Chooses the origin after all corners of the file at `path` have been noted. Returns whether the scene moves.
    pub(super) fn settle(&mut self, path: &Path) -> Result<bool> {
        self.is_settled = true;
        if self.distance() < NEAREST {
            let what = format!("its surfaces lie {:.1e} m from the camera", self.distance());
            return Err(Error::scene(path, what).help("lengths are metres: scale the scene"));
        }
        let anchor = self.anchor.unwrap_or_default();
        let moves = anchor.abs().max_element() > FAR * self.distance();
        self.origin = if moves { anchor } else { DVec3::ZERO };
        Ok(moves)
    }

    /// A warning if the file's numbers are too coarse. Three conditions must hold: more than an eighth of the numbers have a coarse step,
    /// all coarse numbers are single precision, and more than an eighth of the coarse numbers are odd multiples of their step (rounded
    /// numbers).
    pub(super) fn warning(&self) -> Option<String> {
        let [all, coarse, single, odd] = self.numbers;
        (8 * coarse > all && single == coarse && 8 * odd > coarse).then(|| {
            format!(
                "the file's coordinates are single precision, in steps of {} m where the scene lies, and its surfaces are rounded to them: move the \
                 scene near the origin before it is exported",
                short(self.step)
            )
        })
    }
}

/// A length in metres with two digits.
fn short(length: f64) -> String {
    if length < 0.01 { format!("{length:.1e}") } else { format!("{length:.2}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_power_goes_with_the_scale() {
        let power = |scale: f64| {
            let mut distances = Distances::new();
            for distance in [0.0, 0.3, 1.2, 1.9, 1e9, f64::NAN, 0.1, 1.0] {
                distances.add(scale * distance, 1.0);
            }
            distances.power(0.5)
        };
        // Zero and NaN are ignored. The third of the other six distances, in ascending order, is 1 and lies in [1, 2).
        assert_eq!(power(1.0), 0);
        for k in [-300, -20, -1, 1, 7, 300] {
            assert_eq!(power(2_f64.powi(k)), k);
        }
        assert_eq!(Distances::new().power(0.5), 0);
    }

    #[test]
    fn many_distances_of_little_weight_do_not_decide() {
        let mut distances = Distances::new();
        distances.add(1.5, 1.0);
        (0..600).for_each(|_| distances.add(1e4, 1e-4));
        assert_eq!([0.25, 0.5].map(|share| distances.power(share)), [0, 0]);
        assert_eq!(distances.power(0.99), 13, "2¹³ is 8192");
    }
}
