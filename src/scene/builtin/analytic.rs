//! Scenes whose light transport is known in closed form.

use std::collections::HashMap;

use glam::{DVec3, Vec3, dvec3, vec3};

use super::model::{Model, Part, camera_along_z, matte};
use crate::scene::Scene;

/// A matte plane of this albedo at `distance` metres, square to the optical axis, and much larger than the view
/// (half a field of view of tangent 0.5). With an all-ones pattern each pixel reads `albedo/(π·distance²)`.
pub fn plane(distance: f32, albedo: f32) -> Scene {
    let mut part = Part::new("plane", None);
    let side = 10.0 * distance;
    part.quad(
        [(-side, -side), (side, -side), (side, side), (-side, side)].map(|(x, y)| vec3(x, y, -distance)),
    );
    matte_scene("plane", vec![part], albedo, 0.5)
}

/// Two matte square plates that face each other: `side` metres a side, `separation` metres apart, left and
/// right of the optical axis. The camera sees the inner faces of both; their near edges are one `separation`
/// away from it along the axis.
///
/// The form factor from one to the other, with `x = side/separation`, is
/// `2/(π x²)·(ln√((1+x²)²/(1+2x²)) + 2x√(1+x²)·atan(x/√(1+x²)) − 2x·atan x)`.
pub fn parallel_plates(side: f32, separation: f32, albedo: f32) -> Scene {
    let [x, y] = [separation / 2.0, side / 2.0];
    let [near, far] = [-separation, -separation - side];
    let mut left = Part::new("left", None);
    left.quad([vec3(-x, -y, near), vec3(-x, -y, far), vec3(-x, y, far), vec3(-x, y, near)]);
    let mut right = Part::new("right", None);
    right.quad([vec3(x, -y, far), vec3(x, -y, near), vec3(x, y, near), vec3(x, y, far)]);
    // Wide enough for the near edges, the highest and outermost points of the view.
    let tan_half_fov = 1.05 * x.max(y) / separation;
    matte_scene("parallel-plates", vec![left, right], albedo, tan_half_fov)
}

/// A matte sphere around the camera, `radius` metres, fronts inwards: an icosahedron of which each triangle is
/// split into four `subdivisions` times (`20·4^subdivisions` triangles; at most 8 times). The camera's field of
/// view is 90°.
///
/// In the limit of a true sphere every point sees every other alike: once the light has bounced, it is uniform.
pub fn inside_sphere(radius: f32, subdivisions: u32, albedo: f32) -> Scene {
    let (mut vertices, mut triangles) = icosahedron();
    for _ in 0..subdivisions.min(8) {
        triangles = split(&mut vertices, &triangles);
    }
    let mut part = Part::new("sphere", None);
    part.positions = vertices.iter().map(|vertex| (f64::from(radius) * *vertex).as_vec3()).collect();
    part.triangles = triangles;
    matte_scene("inside-sphere", vec![part], albedo, 1.0)
}

fn matte_scene(name: &'static str, parts: Vec<Part>, albedo: f32, tan_half_fov: f32) -> Scene {
    let materials = vec![matte("matte", Vec3::splat(albedo))];
    Model { name, parts, materials, camera: camera_along_z(Vec3::ZERO, tan_half_fov) }.to_scene()
}

/// Vertices on the unit sphere; triangles counter-clockwise as seen from inside.
fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for (one, long) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        vertices.extend([dvec3(0.0, one, long), dvec3(one, long, 0.0), dvec3(long, 0.0, one)]);
    }
    // Faces are the triples at the edge length, 2, of each other.
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

/// Splits each triangle at the middles of its edges, which move out to the sphere.
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
