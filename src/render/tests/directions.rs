//! The sphere of directions, divided into bins, and points for integrals over it.

use std::f64::consts::{PI, TAU};

/// Azimuth of all outgoing directions. Its value is arbitrary, since no result may depend on it.
const AZIMUTH: f64 = 2.2;

/// Bins by `(hemisphere, ring, sector)`, which are fine where a glossy lobe may be narrow.
///
/// Rings are equally spaced in `t = √(1 − |cosθ|)`, which is linear in `θ` around the normal. Sectors are
/// equally spaced in `s = ∛(φ/π)` from −1 to 1, with the azimuth `φ` measured from the mirror direction,
/// which is also that of transmitted light: at grazing incidence a lobe is narrower in azimuth than in
/// height, by the cosine. The solid angle is `dω = 2t dt · 3πs² ds`.
pub(super) struct Sphere {
    pub(super) rings: usize,
    pub(super) sectors: usize,
}

impl Sphere {
    pub(super) fn bins(&self) -> usize {
        2 * self.rings * self.sectors
    }

    /// The bin of a direction. The bins above the horizon come first.
    pub(super) fn bin(&self, [x, y, z]: [f64; 3]) -> usize {
        // 1 − |z| without cancellation.
        let t = ((x * x + y * y) / (1.0 + z.abs())).sqrt();
        let phi = (y.atan2(x) - AZIMUTH).rem_euclid(TAU) - PI;
        let ring = ((t * self.rings as f64) as usize).min(self.rings - 1);
        let sector = ((phi / PI).cbrt() + 1.0) / 2.0 * self.sectors as f64;
        let below = if z < 0.0 { self.rings } else { 0 };
        (below + ring) * self.sectors + (sector as usize).min(self.sectors - 1)
    }

    /// The midpoints of `per_side²` cells of each bin, bin by bin, and the solid angle of each cell.
    pub(super) fn midpoints(&self, per_side: usize) -> (Vec<[f32; 4]>, Vec<f64>) {
        let (dt, ds) = (1.0 / (self.rings * per_side) as f64, 2.0 / (self.sectors * per_side) as f64);
        let cells = per_side * per_side;
        let point = |index: usize| {
            let (bin, cell) = (index / cells, index % cells);
            let (ring, sector) = (bin / self.sectors, bin % self.sectors);
            let t = ((ring % self.rings * per_side + cell / per_side) as f64 + 0.5) * dt;
            let s = ((sector * per_side + cell % per_side) as f64 + 0.5) * ds - 1.0;
            let phi = AZIMUTH + PI + PI * s.powi(3);
            let cos = 1.0 - t * t;
            let sin = (t * t * (1.0 + cos)).sqrt();
            let z = if ring < self.rings { cos } else { -cos };
            let direction = [(sin * phi.cos()) as f32, (sin * phi.sin()) as f32, z as f32, 0.0];
            (direction, 2.0 * t * dt * 3.0 * PI * s * s * ds)
        };
        (0..self.bins() * cells).map(point).unzip()
    }
}

/// The unit vector at this cosine to the normal.
pub(super) fn outgoing(cos: f64) -> [f32; 4] {
    let sin = (1.0 - cos * cos).sqrt();
    [(sin * AZIMUTH.cos()) as f32, (sin * AZIMUTH.sin()) as f32, cos as f32, 0.0]
}

#[test]
fn the_cells_make_up_the_sphere_and_lie_in_their_bins() {
    let sphere = Sphere { rings: 5, sectors: 8 };
    let (points, solid_angles) = sphere.midpoints(3);
    // Midpoints integrate the linear 2t exactly, and 3s² but for ds²/4, with ds = 2/24.
    let solid_angle = solid_angles.iter().sum::<f64>();
    assert!((solid_angle / (2.0 * TAU) - (1.0 - 1.0 / 576.0)).abs() < 1e-12, "{solid_angle}");
    for (index, [x, y, z, _]) in points.iter().map(|point| point.map(f64::from)).enumerate() {
        assert_eq!(sphere.bin([x, y, z]), index / 9);
    }
    assert!(points[..points.len() / 2].iter().all(|point| point[2] > 0.0));
}
