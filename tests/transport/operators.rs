//! Products by replay and by tracing anew, with the matrix and with its transpose.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::common::{csr, load, magnitudes, random_vector, settings, trace, tracer};
use krylux::image::Resolution;
use krylux::krylov::{EigsMethod, EigsOptions, eigs};
use krylux::observer::{Observer, Step};
use krylux::operator::{Adjoint, Operator, Recorded, Symmetry};
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
        let mut replayed = MatrixOperator::new(&matrix, part, channel);
        let retraced = Retraced { tracer: &mut tracer, settings, channels };
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

/// Counts the scene's traces that came to their end.
#[derive(Default)]
struct Passes(AtomicUsize);

impl Observer for Passes {
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        self.0.fetch_add(usize::from(step.done == step.total), Ordering::Relaxed);
        ControlFlow::Continue(())
    }
}

#[test]
fn a_block_of_products_is_taken_together_and_has_the_same_bits() {
    let projector = Resolution::new(13, 9);
    let settings = TraceSettings { projector: Some(projector), ..settings(16, 24, 6, 7) };
    let mut tracer = tracer(&load("corner"));
    let channels = Channels::Rgb;
    let matrix = trace(&mut tracer, settings, channels).matrix;
    let xs: Vec<Vec<f64>> = (0..6).map(|seed| random_vector(117, seed)).collect();
    let ys: Vec<Vec<f64>> = (0..6).map(|seed| random_vector(256, seed)).collect();
    let passes = Arc::new(Passes::default());
    tracer.observe(Arc::clone(&passes) as Arc<_>);
    let retraced = Retraced { tracer: &mut tracer, settings, channels };
    let (part, channel) = (Part::Global, 1);
    let mut replayed = MatrixOperator::new(&matrix, part, channel);
    let mut retraced = RetracedOperator { retraced, part, channel };
    let (xs, ys): (Vec<&[f64]>, Vec<&[f64]>) =
        (xs.iter().map(Vec::as_slice).collect(), ys.iter().map(Vec::as_slice).collect());
    for operator in [&mut replayed as &mut dyn Adjoint, &mut retraced] {
        assert_eq!(operator.block_size(), 4);
        let zeros = || (vec![vec![f64::NAN; 256]; 6], vec![vec![f64::NAN; 117]; 6]);
        let (mut products, mut adjoint) = zeros();
        for (x, y) in xs.iter().zip(&mut products) {
            operator.apply(x, y).expect("the sizes fit");
        }
        for (y, x) in ys.iter().zip(&mut adjoint) {
            operator.apply_adjoint(y, x).expect("the sizes fit");
        }
        let one_by_one = passes.0.swap(0, Ordering::Relaxed);
        let (mut block, mut adjoint_block) = zeros();
        let mut to: Vec<&mut [f64]> = block.iter_mut().map(Vec::as_mut_slice).collect();
        operator.apply_block(&xs, &mut to).expect("the sizes fit");
        let mut to: Vec<&mut [f64]> = adjoint_block.iter_mut().map(Vec::as_mut_slice).collect();
        operator.apply_adjoint_block(&ys, &mut to).expect("the sizes fit");
        assert!(block == products && adjoint_block == adjoint);
        // Four and two instead of six, forwards and backwards; the matrix needs none.
        assert_eq!(passes.0.swap(0, Ordering::Relaxed) * 3, one_by_one);
    }
}

/// Takes blocks one product at a time.
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
fn block_lanczos_finds_the_same_eigenpairs_by_blocks_of_products() {
    let mut tracer = tracer(&load("corner"));
    let matrix = trace(&mut tracer, settings(16, 24, 6, 7), Channels::Luma).matrix;
    let mut operator = MatrixOperator::new(&matrix, Part::Full, 0);
    let options = EigsOptions {
        method: EigsMethod::BlockLanczos { block: 3 },
        products: 20,
        max_basis: Some(14),
        ..EigsOptions::default()
    };
    let alone = eigs(&mut Alone(&mut operator), &options).expect("20 products");
    let mut recorded = Recorded::new(&mut operator);
    let together = eigs(&mut recorded, &options).expect("20 products");
    assert_eq!(alone.stats.products, together.stats.products);
    assert_eq!(recorded.products.len(), together.stats.products, "no product is taken in vain");
    assert!(alone.values == together.values && alone.vectors == together.vectors);
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
        let retraced = Retraced { tracer: &mut tracer, settings, channels };
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
