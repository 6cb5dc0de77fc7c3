//! Triangle meshes of the unit sphere by subdivision of an icosahedron.

use std::collections::HashMap;

use glam::{DVec3, dvec3};

/// An icosahedron whose triangles are split into four `subdivisions` times, at most 8 times. Returns the
/// vertices, on the unit sphere, and the triangles, counter-clockwise as seen from inside. The result is the
/// same on every machine, because square roots are the only functions used.
pub(super) fn icosphere(subdivisions: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut triangles) = icosahedron();
    for _ in 0..subdivisions.min(8) {
        triangles = split(&mut vertices, &triangles);
    }
    (vertices, triangles)
}

/// The vertices of an icosahedron, on the unit sphere, and its triangles, counter-clockwise as seen from
/// inside.
fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for (one, long) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        vertices.extend([dvec3(0.0, one, long), dvec3(one, long, 0.0), dvec3(long, 0.0, one)]);
    }
    // Three vertices form a face if each two of them are at the distance of the edge length, 2.
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

/// Splits each triangle into four at the midpoints of its edges, which are projected to the sphere.
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
