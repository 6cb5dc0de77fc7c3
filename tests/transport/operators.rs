//! Products by replay and by tracing anew, with the matrix and with its transpose.

use std::ops::ControlFlow;

use crate::common::{csr, keep_going, load, magnitudes, random_vector, settings, trace, tracer};
use krylux::image::Resolution;
use krylux::krylov::{EigsMethod, EigsOptions, eigs};
use krylux::operator::{Adjoint, Operator, Symmetry};
use krylux::render::{Progress, TraceSettings};
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
        let mut replayed = MatrixOperator::new(&matrix, part, channel);
        let retraced = Retraced { tracer: &mut tracer, settings, channels, progress: &mut keep_going };
        let mut retraced = RetracedOperator { retraced, part, channel, ahead: &mut Default::default() };
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
fn products_that_were_announced_are_taken_together_and_have_the_same_bits() {
    let projector = Resolution::new(13, 9);
    let settings = TraceSettings { projector: Some(projector), ..settings(16, 24, 6, 7) };
    let mut tracer = tracer(&load("corner"));
    let channels = Channels::Rgb;
    let matrix = trace(&mut tracer, settings, channels).matrix;
    let xs: Vec<Vec<f64>> = (0..6).map(|seed| random_vector(117, seed)).collect();
    let ys: Vec<Vec<f64>> = (0..6).map(|seed| random_vector(256, seed)).collect();
    let passes = std::cell::Cell::new(0);
    let mut progress = |at: Progress| {
        passes.set(passes.get() + usize::from(at.done == at.total));
        ControlFlow::Continue(())
    };
    let retraced = Retraced { tracer: &mut tracer, settings, channels, progress: &mut progress };
    let (part, channel) = (Part::Global, 1);
    let mut replayed = MatrixOperator::new(&matrix, part, channel);
    let mut retraced = RetracedOperator { retraced, part, channel, ahead: &mut Default::default() };
    for operator in [&mut replayed as &mut dyn Adjoint, &mut retraced] {
        let both = |operator: &mut dyn Adjoint| {
            let (mut products, mut adjoint) = (vec![vec![f64::NAN; 256]; 6], vec![vec![f64::NAN; 117]; 6]);
            for (x, y) in xs.iter().zip(&mut products) {
                operator.apply(x, y).expect("the sizes fit");
            }
            for (y, x) in ys.iter().zip(&mut adjoint) {
                operator.apply_adjoint(y, x).expect("the sizes fit");
            }
            (products, adjoint, passes.take())
        };
        let (products, adjoint, one_by_one) = both(operator);
        operator.announce(&xs);
        operator.announce_adjoint(&ys);
        let (announced, announced_adjoint, together) = both(operator);
        assert!(announced == products && announced_adjoint == adjoint);
        // Four and two instead of six, forwards and backwards; the matrix needs none.
        assert_eq!(together * 3, one_by_one);
    }
}

/// Hands on products, and no announcements.
struct Alone<'a>(&'a mut dyn Operator);

impl Operator for Alone<'_> {
    fn rows(&self) -> usize {
        self.0.rows()
    }

    fn cols(&self) -> usize {
        self.0.cols()
    }

    fn symmetry(&self) -> Symmetry {
        self.0.symmetry()
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> krylux::Result<()> {
        self.0.apply(x, y)
    }
}

#[test]
fn a_block_that_is_announced_finds_the_same_eigenpairs() {
    let mut tracer = tracer(&load("corner"));
    let matrix = trace(&mut tracer, settings(16, 24, 6, 7), Channels::Luma).matrix;
    let mut operator = MatrixOperator::new(&matrix, Part::Full, 0);
    let options = EigsOptions {
        method: EigsMethod::BlockLanczos { block: 3 },
        products: 20,
        max_basis: Some(14),
        ..EigsOptions::default()
    };
    let mut quiet = |_: &krylux::krylov::Progress<'_>| ControlFlow::Continue(());
    let alone = eigs(&mut Alone(&mut operator), &options, &mut quiet).expect("20 products");
    let announced = eigs(&mut operator, &options, &mut quiet).expect("20 products");
    assert_eq!(alone.stats.products, announced.stats.products);
    assert!(alone.values == announced.values && alone.vectors == announced.vectors);
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
        let mut replayed = MatrixOperator::new(&matrix, part, 0);
        let retraced = Retraced { tracer: &mut tracer, settings, channels, progress: &mut keep_going };
        let mut retraced = RetracedOperator { retraced, part, channel: 0, ahead: &mut Default::default() };
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
