//! Products by replay and by tracing anew, with the matrix and with its transpose.

mod common;

use common::{csr, keep_going, load, magnitudes, random_vector, settings, trace, tracer};
use krylux::image::Resolution;
use krylux::operator::{Adjoint, Operator, Symmetry};
use krylux::render::TraceSettings;
use krylux::transport::{Channels, MatrixOperator, Part, Retraced, RetracedOperator};

#[test]
fn retraced_products_are_the_replayed_ones_and_coaxial_rigs_their_own_duals() {
    let settings = settings(20, 24, 6, 7);
    let mut tracer = tracer(&load("cornell"));
    let channels = Channels::Rgb;
    let matrix = trace(&mut tracer, settings, channels).matrix;
    assert!(matrix.is_symmetric() && matrix.projector_resolution() == matrix.resolution());
    let x = random_vector(400, 8);
    for (part, channel) in [(Part::Full, 0), (Part::Direct, 1), (Part::Global, 2)] {
        let mut replayed = MatrixOperator { matrix: &matrix, part, channel };
        let retraced = Retraced { tracer: &mut tracer, settings, channels, progress: &mut keep_going };
        let mut retraced = RetracedOperator { retraced, part, channel };
        assert_eq!((retraced.rows(), retraced.cols(), retraced.symmetry()), (400, 400, replayed.symmetry()));
        let magnitudes = magnitudes(&csr(&matrix, part, channel), &x);
        let [mut y, mut yt, mut z, mut zt] = [const { Vec::new() }; 4];
        for (operator, forward, backward) in
            [(&mut replayed as &mut dyn Adjoint, &mut y, &mut yt), (&mut retraced, &mut z, &mut zt)]
        {
            (*forward, *backward) = (vec![f64::NAN; 400], vec![f64::NAN; 400]);
            operator.apply(&x, forward).expect("the sizes fit");
            operator.apply_adjoint(&x, backward).expect("the sizes fit");
        }
        assert_eq!(y, yt, "the same matrix, read the same way");
        for row in 0..400 {
            // Rounded to f32 pixel by pixel, and where mirror images meet.
            let bound = 2.0 * f64::from(f32::EPSILON) * magnitudes[row];
            let errors = [(y[row] - z[row]).abs(), (y[row] - zt[row]).abs()];
            assert!(
                errors.iter().all(|&error| error <= bound),
                "{part:?}, row {row}: {errors:?} above {bound:e}"
            );
        }
    }
}

#[test]
fn a_projector_of_its_own_size_makes_a_rectangular_matrix_with_the_dual_rig_for_its_transpose() {
    let projector = Resolution::new(13, 9);
    let settings = TraceSettings { projector: Some(projector), ..settings(16, 24, 6, 7) };
    let mut tracer = tracer(&load("corner"));
    let channels = Channels::Luma;
    let matrix = trace(&mut tracer, settings, channels).matrix;
    assert!(!matrix.is_symmetric() && matrix.projector_resolution() == projector);
    let (u, v) = (random_vector(256, 1), random_vector(117, 2));
    for part in [Part::Full, Part::Direct, Part::Global] {
        let csr = csr(&matrix, part, 0);
        assert_eq!((csr.rows(), csr.cols()), (256, 117));
        let mut replayed = MatrixOperator { matrix: &matrix, part, channel: 0 };
        let retraced = Retraced { tracer: &mut tracer, settings, channels, progress: &mut keep_going };
        let mut retraced = RetracedOperator { retraced, part, channel: 0 };
        let magnitude: f64 = csr.entries().map(|(row, column, a)| (u[row] * a * v[column]).abs()).sum();
        let mut products = Vec::new();
        for operator in [&mut replayed as &mut dyn Adjoint, &mut retraced] {
            assert_eq!(operator.symmetry(), Symmetry::General);
            let (mut y, mut x) = (vec![f64::NAN; 256], vec![f64::NAN; 117]);
            operator.apply(&v, &mut y).expect("the sizes fit");
            operator.apply_adjoint(&u, &mut x).expect("the sizes fit");
            let [uav, atuv] =
                [(&u, &y), (&x, &v)].map(|(a, b)| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>());
            // Sums of at most 256·117 terms, on either side, that may cancel (Higham 2002, eq. 3.5); in practice, far less.
            let bound = 2.0 * 373.0 * f64::EPSILON * magnitude;
            assert!((uav - atuv).abs() <= bound, "{part:?}: {uav} and {atuv}");
            products.push(y);
        }
        let magnitudes = magnitudes(&csr, &v);
        for row in 0..256 {
            // Rounded to f32 pixel by pixel, and where rows meet columns.
            let error = (products[0][row] - products[1][row]).abs();
            assert!(
                error <= 2.0 * f64::from(f32::EPSILON) * magnitudes[row],
                "{part:?}, row {row}: {error:e}"
            );
        }
    }
}
