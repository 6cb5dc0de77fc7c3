//! Goodness of fit by Pearson's χ² test, and a partition of the sphere of directions into bins.

use std::f64::consts::{PI, TAU};

/// The probability that at least one test of a family of tests rejects a correct program.
const SIGNIFICANCE: f64 = 0.01;

/// The p-value below which one of `tests` independent tests fails (Šidák). At least one of them then fails with the probability
/// `SIGNIFICANCE`.
pub(super) fn threshold(tests: usize) -> f64 {
    1.0 - (1.0 - SIGNIFICANCE).powf(1.0 / tests as f64)
}

/// The p-value of counts in bins, given their expectations. Bins with an expectation below 5, for which Pearson's statistic does not follow
/// the χ² distribution, are pooled into one bin. If this bin still has an expectation below 5, it is merged with the smallest other bin.
pub(super) fn chi_square_test(observed: &[f64], expected: &[f64]) -> f64 {
    const ENOUGH: f64 = 5.0;
    let mut bins: Vec<(f64, f64)> = expected.iter().copied().zip(observed.iter().copied()).collect();
    bins.sort_by(|a, b| a.0.total_cmp(&b.0));
    let small = bins.partition_point(|bin| bin.0 < ENOUGH);
    let mut pooled =
        bins.drain(..small).fold((0.0, 0.0), |sum: (f64, f64), bin| (sum.0 + bin.0, sum.1 + bin.1));
    if pooled.0 < ENOUGH && (pooled.0 > 0.0 || pooled.1 > 0.0) {
        let smallest = bins.remove(0);
        pooled = (pooled.0 + smallest.0, pooled.1 + smallest.1);
    }
    if pooled.0 > 0.0 {
        bins.push(pooled);
    }
    let statistic: f64 = bins.iter().map(|(e, o)| (o - e).powi(2) / e).sum();
    chi_square_survival(statistic, (bins.len() - 1) as f64)
}

/// `P(χ²_freedom > statistic) = Q(freedom/2, statistic/2)`.
fn chi_square_survival(statistic: f64, freedom: f64) -> f64 {
    upper_incomplete_gamma(freedom / 2.0, statistic / 2.0)
}

/// The regularized `Q(a, x)`. For `x` below `a + 1`, it is computed from the series of `P = 1 − Q`. Above, it is computed from Legendre's
/// continued fraction, evaluated by Lentz's method (Abramowitz and Stegun 6.5.29 and 6.5.31).
fn upper_incomplete_gamma(a: f64, x: f64) -> f64 {
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x <= 0.0 {
        return 1.0;
    }
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > 1e-16 * sum {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return 1.0 - front * sum;
    }
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut fraction = d;
    for i in 1..10_000 {
        let factor = f64::from(i) * (a - f64::from(i));
        b += 2.0;
        d = 1.0 / (factor * d + b);
        c = b + factor / c;
        fraction *= c * d;
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * fraction
}

/// `ln Γ(a)` by Stirling's series, whose error is below 1e-15 for `a ≥ 15`. A smaller `a` is increased by `Γ(a+1) = a Γ(a)` first.
fn ln_gamma(a: f64) -> f64 {
    if a < 15.0 {
        return ln_gamma(a + 1.0) - a.ln();
    }
    let square = a * a;
    let series =
        (1.0 / 12.0 - (1.0 / 360.0 - (1.0 / 1260.0 - 1.0 / (1680.0 * square)) / square) / square) / a;
    (a - 0.5) * a.ln() - a + 0.5 * TAU.ln() + series
}

#[test]
fn survival_has_its_closed_forms() {
    // With two degrees of freedom, the result is exp(−x/2); with four, it is exp(−x/2)(1 + x/2). Both branches are tested.
    for x in [0.1, 1.0, 3.0, 10.0, 40.0] {
        let two = (-x / 2.0_f64).exp();
        assert!((chi_square_survival(x, 2.0) / two - 1.0).abs() < 1e-13, "{x}");
        assert!((chi_square_survival(x, 4.0) / (two * (1.0 + x / 2.0)) - 1.0).abs() < 1e-13, "{x}");
    }
    // These statistics are tabulated 5 % points.
    assert!((chi_square_survival(3.841_458_820_694_124, 1.0) - 0.05).abs() < 1e-13);
    assert!((chi_square_survival(124.342_113_404_004_1, 100.0) - 0.05).abs() < 1e-12);
}

#[test]
fn counts_that_fit_too_badly_fail() {
    let expected = [100.0; 50];
    let fair: Vec<f64> = (0..50).map(|bin| 100.0 + if bin % 2 == 0 { 10.0 } else { -10.0 }).collect();
    // χ² is 50 with 49 degrees of freedom, and then 200.
    assert!(chi_square_test(&fair, &expected) > 0.4);
    let unfair: Vec<f64> = fair.iter().map(|count| 100.0 + 2.0 * (count - 100.0)).collect();
    assert!(chi_square_test(&unfair, &expected) < 1e-15);
}

/// The azimuth of all outgoing directions. Its value is arbitrary, because no result may depend on it.
const AZIMUTH: f64 = 2.2;

/// Bins by `(hemisphere, ring, sector)`. They are small in directions in which a glossy lobe may be narrow.
///
/// Rings are equally spaced in `t = √(1 − |cosθ|)`, which is linear in `θ` around the normal. Sectors are equally spaced in `s = ∛(φ/π)`
/// from −1 to 1. The azimuth `φ` is measured from the mirror direction, which is also the azimuth of transmitted light. At grazing
/// incidence, a lobe is narrower in azimuth than in height, by the factor of the cosine. The solid angle is `dω = 2t dt · 3πs² ds`.
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
        // The formula is 1 − |z| without cancellation.
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

pub(super) fn outgoing(cos: f64) -> [f32; 4] {
    let sin = (1.0 - cos * cos).sqrt();
    [(sin * AZIMUTH.cos()) as f32, (sin * AZIMUTH.sin()) as f32, cos as f32, 0.0]
}

#[test]
fn the_cells_make_up_the_sphere_and_lie_in_their_bins() {
    let sphere = Sphere { rings: 5, sectors: 8 };
    let (points, solid_angles) = sphere.midpoints(3);
    // Midpoints integrate the linear 2t exactly, and 3s² up to an error of ds²/4, with ds = 2/24.
    let solid_angle = solid_angles.iter().sum::<f64>();
    assert!((solid_angle / (2.0 * TAU) - (1.0 - 1.0 / 576.0)).abs() < 1e-12, "{solid_angle}");
    for (index, [x, y, z, _]) in points.iter().map(|point| point.map(f64::from)).enumerate() {
        assert_eq!(sphere.bin([x, y, z]), index / 9);
    }
    assert!(points[..points.len() / 2].iter().all(|point| point[2] > 0.0));
}
