//! From counts to products, against an explicit dense matrix. The rigs are out of `measure_support`.

mod measure_support;

use krylux::image::Resolution;
use krylux::measure::{DirectBy, MeasureOptions, SignedBy};
use krylux::transport::Part;
use measure_support::{Dense, Rig, dot, error, product, vector};

fn scene() -> Dense {
    Dense::new(Resolution::new(12, 8), 1000.0, 5)
}

fn plain() -> MeasureOptions {
    MeasureOptions { sentinel_every: 0, direct: DirectBy::None, ..MeasureOptions::default() }
}

#[test]
fn a_rig_without_fault_is_its_matrix() {
    let rig = Rig::new(scene());
    let n = rig.matrix.resolution.pixels();
    for signed in [SignedBy::Affine, SignedBy::Split, SignedBy::Auto] {
        let mut measurement = rig.measure(&MeasureOptions { signed, ..plain() });
        let [u, v] = [vector(n, 1), vector(n, 2)];
        let (left, right) =
            (product(&mut measurement, Part::Full, &v), product(&mut measurement, Part::Full, &u));
        // 16 bits of projector and camera round by 2^-17 of the range, about 1e-5 of a typical product.
        assert!(error(&left, &rig.matrix.apply(Part::Full, &v)) < 1e-4, "{signed:?}");
        let dots = [dot(&u, &left), dot(&right, &v)];
        assert!((dots[0] - dots[1]).abs() < 1e-4 * dot(&left, &left).sqrt() * dot(&u, &u).sqrt(), "{dots:?}");
    }
}

#[test]
fn the_direct_light_is_found_and_removed() {
    let rig = Rig::new(scene());
    let n = rig.matrix.resolution.pixels();
    let options = MeasureOptions { direct: DirectBy::Patterns, ..plain() };
    let mut measurement = rig.measure(&options);
    let direct = measurement.direct().expect("a dense rig never fails");
    println!("direct: relative error {:.4}", error(&direct.planes[0].values, &rig.matrix.direct));
    let x = vector(n, 3);
    let found = product(&mut measurement, Part::Global, &x);
    println!("global: relative error {:.4}", error(&found, &rig.matrix.apply(Part::Global, &x)));
    println!("patterns {}", measurement.patterns());
}
