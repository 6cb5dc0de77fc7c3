//! Scenes for tests and benchmarks: scenes with a closed-form light transport, and a box of many triangles.

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::{DVec3, Vec3, dvec3, vec3};

use super::TAN_20_DEGREES;
use super::model::{Model, Part, matte, white_paper};
use crate::scene::Scene;

/// A fronto-parallel matte plane with albedo `albedo` at `distance` metres, much larger than the view. The tangent of half the field of
/// view is 0.5. Under an all-ones pattern, each pixel of the photo has the value `albedo/(π·distance²)`.
pub fn plane(distance: f32, albedo: f32) -> Scene {
    let mut part = Part::new("plane", None);
    let side = 10.0 * distance;
    part.quad(
        [(-side, -side), (side, -side), (side, side), (-side, side)].map(|(x, y)| vec3(x, y, -distance)),
    );
    matte_scene("plane", vec![part], albedo, 0.5)
}

/// Two square matte plates that face each other, left and right of the optical axis. Their sides are `side` metres long, and they are
/// `separation` metres apart. The camera sees the inner faces of both. The near edges are `separation` metres in front of the camera.
///
/// With `x = side/separation`, the form factor from one plate to the other is
/// `2/(π x²)·(ln√((1+x²)²/(1+2x²)) + 2x√(1+x²)·atan(x/√(1+x²)) − 2x·atan x)`.
pub fn parallel_plates(side: f32, separation: f32, albedo: f32) -> Scene {
    let [x, y] = [separation / 2.0, side / 2.0];
    let [near, far] = [-separation, -separation - side];
    let mut left = Part::new("left", None);
    left.quad([vec3(-x, -y, near), vec3(-x, -y, far), vec3(-x, y, far), vec3(-x, y, near)]);
    let mut right = Part::new("right", None);
    right.quad([vec3(x, -y, far), vec3(x, -y, near), vec3(x, y, near), vec3(x, y, far)]);
    // The field of view contains the near edges, which are the outermost points in the view.
    let tan_half_fov = 1.05 * x.max(y) / separation;
    matte_scene("parallel-plates", vec![left, right], albedo, tan_half_fov)
}

/// A matte sphere of `radius` metres around the camera, whose front faces inwards. The sphere is an icosahedron. Each of its triangles is
/// split into four, `subdivisions` times (at most 8 times), which gives `20·4^subdivisions` triangles. The camera's field of view is 90°.
///
/// In the limit of a true sphere, the form factor between any two points is the same, so the light of two or more bounces is uniform.
pub fn inside_sphere(radius: f32, subdivisions: u32, albedo: f32) -> Scene {
    let (vertices, triangles) = icosphere(subdivisions);
    let mut part = Part::new("sphere", None);
    part.positions = vertices.iter().map(|vertex| (f64::from(radius) * *vertex).as_vec3()).collect();
    part.triangles = triangles;
    matte_scene("inside-sphere", vec![part], albedo, 1.0)
}

/// A scene with a single matte material and the camera at the origin.
fn matte_scene(name: &'static str, parts: Vec<Part>, albedo: f32, tan_half_fov: f32) -> Scene {
    let materials = vec![matte("matte", Vec3::splat(albedo))];
    Model::along_z(name, parts, materials, (0.0, tan_half_fov)).to_scene()
}

/// Height of the bumps, in metres.
const BUMP: f64 = 0.01;
/// Number of bumps along a wall.
const BUMPS: f64 = 6.0;

/// A white box of 1 m that is open towards the camera, 1.3 m in front of the opening. Its five walls are slightly bumpy, and each has a
/// grid of `n × n` cells. The box has `10·n²` triangles, where `n` is `√(target_triangles / 10)` rounded, but at least 1. Each wall is a
/// region.
pub fn tessellated_box(target_triangles: usize) -> Scene {
    let cells = ((target_triangles as f64 / 10.0).sqrt().round() as usize).max(1);
    // Each wall has an origin, the direction of its columns, and the direction of its rows. The cross product of these directions points
    // inwards.
    let walls = [
        ("floor", dvec3(-0.5, -0.5, 0.0), DVec3::X, DVec3::NEG_Z),
        ("ceiling", dvec3(-0.5, 0.5, -1.0), DVec3::X, DVec3::Z),
        ("back", dvec3(-0.5, -0.5, -1.0), DVec3::X, DVec3::Y),
        ("left", dvec3(-0.5, -0.5, 0.0), DVec3::NEG_Z, DVec3::Y),
        ("right", dvec3(0.5, -0.5, -1.0), DVec3::Z, DVec3::Y),
    ];
    let parts = walls.map(|(name, origin, along, up)| {
        let mut part = Part::new(name, None);
        let inwards = along.cross(up);
        part.grid(cells, cells, |column, row| -> Vec3 {
            let [s, t] = [column, row].map(|index| index as f64 / cells as f64);
            // The edges have no bumps, so that the walls meet.
            let edge = column == 0 || column == cells || row == 0 || row == cells;
            let bump =
                if edge { 0.0 } else { BUMP * ((BUMPS * PI * s).sin() * (BUMPS * PI * t).sin()).powi(2) };
            (origin + s * along + t * up + bump * inwards).as_vec3()
        });
        part
    });
    Model::along_z("tessellated-box", parts.into(), white_paper(), (1.3, TAN_20_DEGREES)).to_scene()
}

/// An icosahedron whose triangles are each split into four, `subdivisions` times (at most 8 times). Returns the vertices, on the unit
/// sphere, and the triangles, counter-clockwise as seen from inside. The result is the same on every machine: no function but the square
/// root is used.
pub(super) fn icosphere(subdivisions: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut triangles) = icosahedron();
    for _ in 0..subdivisions.min(8) {
        triangles = split(&mut vertices, &triangles);
    }
    (vertices, triangles)
}

/// The vertices of an icosahedron, on the unit sphere, and its triangles, counter-clockwise as seen from inside.
fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for (one, long) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        vertices.extend([dvec3(0.0, one, long), dvec3(one, long, 0.0), dvec3(long, 0.0, one)]);
    }
    // Three vertices form a face if all their distances equal the edge length, 2.
    let adjacent = |a: usize, b: usize| (vertices[a].distance(vertices[b]) - 2.0).abs() < 1e-9;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if adjacent(a, b) && adjacent(b, c) && adjacent(c, a) {
                    let outwards =
                        (vertices[b] - vertices[a]).cross(vertices[c] - vertices[a]).dot(vertices[a]) > 0.0;
                    let [a, b, c] = [a as u32, b as u32, c as u32];
                    triangles.push(if outwards { [a, c, b] } else { [a, b, c] });
                }
            }
        }
    }
    (vertices.into_iter().map(DVec3::normalize).collect(), triangles)
}

/// Splits each triangle into four at the midpoints of its edges. The midpoints are projected to the sphere.
fn split(vertices: &mut Vec<DVec3>, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
            vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
            vertices.len() as u32 - 1
        })
    };
    let mut finer = Vec::with_capacity(4 * triangles.len());
    for &[a, b, c] in triangles {
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    finer
}
