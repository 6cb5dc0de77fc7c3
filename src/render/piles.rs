//! Why light paths end unfinished, as far as the scene says it: triangles piled up in one place.

use std::collections::HashMap;

use super::geometry::GpuScene;
use super::pairs::Pair;
use crate::error::Error;

/// The number of loop iterations after which software Vulkan ends an invocation without an error.
const MAX_ITERATIONS: usize = 65_535;

/// The least number of triangles in one place that may be the reason: a path of several bounces meets the place several times.
const PILE: usize = MAX_ITERATIONS / 16;

/// How many cells as wide as the difference of two places the scene's diagonal has.
const CELLS: f32 = 1000.0;

/// The error about light paths that never finished.
pub(super) fn unfinished(unfinished: u64, total: u64, scene: &GpuScene) -> Error {
    let (pile, size) = highest(&scene.pairs_in_order);
    let size = size * scene.unit.metres;
    let help = if pile >= PILE {
        format!(
            "{pile} triangles lie in one place, {size:.3} m wide, and a ray has to test all of them, but software Vulkan ends a path \
             after {MAX_ITERATIONS} tests: remove the objects that lie on one another, or trace on a GPU (--adapter)"
        )
    } else {
        "lower --max-bounces, or use another --adapter".into()
    };
    Error::UnfinishedPaths { unfinished, total, help }
}

/// The largest number of triangles whose boxes are equal but for a thousandth of the scene's size, and the diagonal of that box.
fn highest(pairs: &[Pair]) -> (usize, f64) {
    let all = pairs.iter().map(Pair::extent).reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]);
    let cell = all.map_or(1.0, |[low, high]| low.distance(high) / CELLS).max(f32::MIN_POSITIVE);
    let mut counts: HashMap<[[i64; 3]; 2], usize> = HashMap::new();
    let mut most = (0, 0.0);
    for pair in pairs {
        let [low, high] = pair.extent();
        let key =
            [low, high].map(|corner| corner.to_array().map(|coordinate| (coordinate / cell).round() as i64));
        let count = counts.entry(key).or_default();
        *count += pair.triangles().count();
        if *count > most.0 {
            most = (*count, f64::from(low.distance(high)));
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn the_highest_pile_is_found() {
        let corners = [Vec3::ZERO, 3.0 * Vec3::X, 4.0 * Vec3::Y];
        let aside = corners.map(|corner| corner + Vec3::Z);
        let pairs: Vec<Pair> =
            (0..7).map(|at| Pair::alone(at, if at % 3 == 0 { aside } else { corners })).collect();
        assert_eq!(highest(&pairs), (4, 5.0));
        let nearly = |at: usize| corners.map(|corner| corner + at as f32 * 1e-6 * Vec3::Z);
        let pairs: Vec<Pair> = (0..7).map(|at| Pair::alone(at, nearly(at))).collect();
        assert_eq!(highest(&pairs).0, 7);
        assert_eq!(highest(&[]), (0, 0.0));
    }
}
