//! `carton`, `carton-eggs`, `nine-cells` and `nine-cells-eggs`: egg cartons seen from above.

use glam::{DVec3, Vec3, dvec3};

use super::model::{Model, Part, square_camera, white_paper};

const COLUMNS: usize = 3;

/// Width of a cup from rim to rim, in metres.
const CUP_WIDTH: f64 = 0.20;
/// Depth of a cup below the rims, in metres.
const CUP_DEPTH: f64 = 0.09;
/// Length of all rows together, in metres.
const LENGTH: f64 = 0.60;

/// The fraction of a cup's half-width over which its floor is flat.
const FLOOR: f64 = 0.4;

/// Number of grid cells along each side of a cup.
const CUP_GRID: usize = 12;

/// Half-axes in metres of a lying egg. It lies along the cup's width and stays below the rims.
const LYING: DVec3 = dvec3(0.050, 0.036, 0.036);
/// Half-axes in metres of a standing egg, which fills most of its cup and rises 0.07 m above the rims.
const STANDING: DVec3 = dvec3(0.070, 0.080, 0.070);
const EGG_SEGMENTS: usize = 16;
const EGG_RINGS: usize = 12;

/// An egg carton of 3 × 4 cups, 0.6 m × 0.6 m, with its rims at height 0. The camera looks down from a height of 1 m, and the carton fills
/// the view. A cup is 0.20 m × 0.15 m wide and 0.09 m deep. All rims are equally high and no cup rises above them, so light is reflected
/// within a cup but never reaches another cup. Each cup is a region, numbered in rows of three from the top left of the photo.
pub fn carton() -> Model {
    model("carton", 4, LYING, |_| false)
}

/// The [`carton`] with an egg in every second cup, in a chessboard pattern. Each egg belongs to its cup's region and stays below the rims.
pub fn carton_eggs() -> Model {
    model("carton-eggs", 4, LYING, |cup| (cup % COLUMNS + cup / COLUMNS).is_multiple_of(2))
}

/// A carton for figure 8 of the paper: 3 × 3 cups of 0.20 m × 0.20 m, seen from the camera of [`carton`]. The text of the paper states
/// neither sizes nor the number of cups. With `eggs`, an egg stands in every cup. The egg hides most of the cup from the camera and rises
/// above the rims, so light passes from egg to egg.
pub fn nine_cells(eggs: bool) -> Model {
    let name = if eggs { "nine-cells-eggs" } else { "nine-cells" };
    model(name, 3, STANDING, |_| eggs)
}

/// A carton with `rows` rows of cups. Cups for which `has_egg` is true contain an egg with the half-axes `egg`.
fn model(name: &'static str, rows: usize, egg: DVec3, has_egg: impl Fn(usize) -> bool) -> Model {
    let mut parts = Vec::new();
    for index in 0..rows * COLUMNS {
        let cup = Cup::new(index, rows);
        parts.push(cup.shell());
        if has_egg(index) {
            parts.push(cup.egg(egg));
        }
    }
    let camera = square_camera(Vec3::Y, [Vec3::NEG_Z, Vec3::NEG_Y], 0.3);
    Model { name, parts, materials: white_paper(), camera }
}

struct Cup {
    index: usize,
    /// The centre of the cup's opening, at the height of the rims, in metres.
    center: DVec3,
    /// Length from rim to rim across the rows, in metres.
    length: f64,
}

impl Cup {
    fn new(index: usize, rows: usize) -> Self {
        let length = LENGTH / rows as f64;
        let offset = |position: usize, count: usize| position as f64 - (count as f64 - 1.0) / 2.0;
        let x = CUP_WIDTH * offset(index % COLUMNS, COLUMNS);
        let z = length * offset(index / COLUMNS, rows);
        Self { index, center: dvec3(x, 0.0, z), length }
    }

    fn shell(&self) -> Part {
        let mut part = Part::new(format!("cup {}", self.index), Some(self.index as u32));
        part.grid(CUP_GRID, CUP_GRID, |column, row| {
            let across = 2.0 * column as f64 / CUP_GRID as f64 - 1.0;
            // Rows of the grid run upwards from the lower edge of the photo, so the front faces up.
            let along = 1.0 - 2.0 * row as f64 / CUP_GRID as f64;
            let local = dvec3(across * CUP_WIDTH / 2.0, -depth(across, along), along * self.length / 2.0);
            (self.center + local).as_vec3()
        });
        part
    }

    /// An ellipsoid with these half-axes that rests on the cup's floor.
    fn egg(&self, half_axes: DVec3) -> Part {
        let mut part = Part::new(format!("egg {}", self.index), Some(self.index as u32));
        let center = self.center + dvec3(0.0, half_axes.y - CUP_DEPTH, 0.0);
        let point = |longitude: f64, latitude: f64| {
            let on_sphere =
                dvec3(latitude.sin(), latitude.cos() * longitude.sin(), latitude.cos() * longitude.cos());
            (center + half_axes * on_sphere).as_vec3()
        };
        let turn = std::f64::consts::TAU / EGG_SEGMENTS as f64;
        let step = std::f64::consts::PI / EGG_RINGS as f64;
        // The vertices are first the rings between the poles, then the two poles.
        for ring in 1..EGG_RINGS {
            let latitude = step * ring as f64 - std::f64::consts::FRAC_PI_2;
            part.positions.extend((0..EGG_SEGMENTS).map(|segment| point(turn * segment as f64, latitude)));
        }
        part.positions.push((center - dvec3(half_axes.x, 0.0, 0.0)).as_vec3());
        part.positions.push((center + dvec3(half_axes.x, 0.0, 0.0)).as_vec3());
        let vertex = |ring: usize, segment: usize| (ring * EGG_SEGMENTS + segment % EGG_SEGMENTS) as u32;
        let last = EGG_RINGS - 2;
        let south = ((last + 1) * EGG_SEGMENTS) as u32;
        for segment in 0..EGG_SEGMENTS {
            part.triangles.push([south, vertex(0, segment), vertex(0, segment + 1)]);
            for ring in 0..last {
                let [a, b] = [vertex(ring, segment), vertex(ring, segment + 1)];
                let [c, d] = [vertex(ring + 1, segment + 1), vertex(ring + 1, segment)];
                part.triangles.extend([[a, d, c], [a, c, b]]);
            }
            part.triangles.push([south + 1, vertex(last, segment + 1), vertex(last, segment)]);
        }
        part
    }
}

/// The depth of a cup in metres at `across` and `along`, both in [−1, 1]. The depth is smooth, constant on the floor and exactly 0 on the
/// rim. Its contours are rounded rectangles.
fn depth(across: f64, along: f64) -> f64 {
    let radius = (across.powi(4) + along.powi(4)).sqrt().sqrt();
    let rise = ((radius - FLOOR) / (1.0 - FLOOR)).clamp(0.0, 1.0);
    CUP_DEPTH * (1.0 - rise * rise * (3.0 - 2.0 * rise))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The smallest height of an egg's surface above the cup's surface, and the egg's largest height above the rims.
    fn clearance(rows: usize, half_axes: DVec3) -> (f64, f64) {
        let cup = Cup::new(0, rows);
        let heights = cup.egg(half_axes).positions.into_iter().map(|position| {
            let local = position.as_dvec3() - cup.center;
            let wall = -depth(local.x / (CUP_WIDTH / 2.0), local.z / (cup.length / 2.0));
            (local.y - wall, local.y)
        });
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (above, height)| {
            (low.min(above), high.max(height))
        })
    }

    #[test]
    fn lying_eggs_touch_neither_the_walls_nor_the_plane_of_the_rims() {
        let (above, height) = clearance(4, LYING);
        // The tolerance allows for the rounding of the point where the egg touches the floor.
        assert!(above > -1e-6, "{above} m below the wall");
        assert!(height < -0.01, "{height} m is close to the rim");
    }

    #[test]
    fn standing_eggs_do_not_touch_the_walls_and_rise_above_the_rims() {
        let (above, height) = clearance(3, STANDING);
        assert!(above > -1e-6, "{above} m below the wall");
        assert!((height - 0.07).abs() < 1e-6, "{height} m above the rims, to single precision");
    }
}
