//! Products on software Vulkan, compared with products on the processor.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::*;
use crate::image::{Image, Resolution};
use crate::operator::{Settling, Vectors};
use crate::render::TraceSummary;
use crate::transport::{Assembled, Bounces, Channels, CompressedRows};

/// Rows in three channels with `per_row` entries on average. Some are empty, and some are very long.
fn rows(random: &mut Pcg64, [rows, cols]: [usize; 2], per_row: usize) -> CompressedRows {
    let mut made = CompressedRows { row_start: vec![0], columns: Vec::new(), weights: vec![Vec::new(); 3] };
    for row in 0..rows {
        let share = match row % 7 {
            0 => 0.0,
            1 => (10 * per_row) as f64 / cols as f64,
            _ => per_row as f64 / cols as f64,
        };
        for column in (0..cols).filter(|_| random.random_range(0.0..1.0) < share).collect::<Vec<_>>() {
            made.columns.push(column as u32);
            made.weights.iter_mut().for_each(|plane| plane.push(random.random_range(0.0..1.0)));
        }
        made.row_start.push(made.columns.len());
    }
    made
}

/// The rows of a symmetric matrix above its diagonal.
fn upper(random: &mut Pcg64, pixels: usize, per_row: usize) -> CompressedRows {
    let half = rows(random, [pixels; 2], per_row / 2);
    let mut made = CompressedRows::with_room(3, pixels, 0);
    for row in 0..pixels {
        let entries = half.row(row);
        let below = half.columns[entries.clone()].partition_point(|&column| column as usize <= row);
        made.extend(&half, entries.start + below..entries.end);
        made.end_row();
    }
    made
}

/// A coaxial pinhole rig, whose direct light is a diagonal. Light of two bounces and light of more bounces are separate layers.
pub(in crate::transport) fn coaxial() -> Assembled {
    let random = &mut Pcg64::seed_from_u64(1);
    let resolution = Resolution::new(37, 29);
    let pixels = resolution.pixels();
    let layers = [(Bounces::Two, 60), (Bounces::Rest, 20)]
        .map(|(bounces, per_row)| Layer::symmetric(bounces, vec![upper(random, pixels, per_row)]));
    let plane = |_| (0..pixels).map(|_| random.random_range(0.0..9.0)).collect();
    let rig = RigShape { camera: resolution, projector: resolution, symmetric: true };
    let matrix = TransportMatrix::new(rig, Channels::Rgb, [0, 1, 2].map(plane).into(), layers.into());
    let ambient = Image::filled(resolution, 3, 0.0);
    Assembled { matrix, ambient, noise: None, summary: TraceSummary::default(), gpu_matrix: None }
}

/// A rig whose projector is beside the camera and has fewer pixels. Direct light is a layer.
fn apart() -> TransportMatrix {
    let random = &mut Pcg64::seed_from_u64(2);
    let rig =
        RigShape { camera: Resolution::new(33, 21), projector: Resolution::new(19, 23), symmetric: false };
    let shape = [rig.camera.pixels(), rig.projector.pixels()];
    let layers = [(Bounces::One, 2), (Bounces::Global, 50)]
        .map(|(bounces, per_row)| Layer::new(bounces, shape[1], vec![rows(random, shape, per_row)]));
    TransportMatrix::new(rig, Channels::Rgb, vec![Vec::new(); 3], layers.into())
}

fn signed(random: &mut Pcg64, length: usize) -> Vec<f64> {
    (0..length).map(|_| random.random_range(-1.0..1.0)).collect()
}

fn both(
    matrix: &TransportMatrix,
    gpu_matrix: &GpuMatrix,
    (part, channel): (Part, usize),
) -> [(Vec<f64>, Vec<f64>); 2] {
    let random = &mut Pcg64::seed_from_u64(3);
    let [rows, cols] = [matrix.rig.camera.pixels(), matrix.rig.projector.pixels()];
    let (x, y) = (signed(random, cols), signed(random, rows));
    let [mut ax, mut found_ax] = [vec![f64::NAN; rows], vec![f64::NAN; rows]];
    let [mut aty, mut found_aty] = [vec![f64::NAN; cols], vec![f64::NAN; cols]];
    matrix.apply(part, channel, &x, &mut ax);
    matrix.apply_transpose(part, channel, &y, &mut aty);
    let taken = gpu_matrix.apply(part, channel, &x, &mut found_ax).and_then(|()| {
        gpu_matrix.multiply(
            matrix,
            Product { direction: Direction::Adjoint, part, channel },
            &y,
            &mut found_aty,
        )
    });
    taken.unwrap_or_else(|error| unreachable!("{error}"));
    [(ax, found_ax), (aty, found_aty)]
}

/// For each row of `P` or of its transpose: `Σ |a|`, which bounds `Σ |a||x|`, and the number of terms.
fn magnitudes(
    matrix: &TransportMatrix,
    (part, channel): (Part, usize),
    is_transposed: bool,
) -> Vec<(f64, usize)> {
    let csr = matrix.to_csr(part, channel).unwrap_or_else(|error| unreachable!("{error}"));
    let mut sums = vec![(0.0, 0); if is_transposed { csr.cols() } else { csr.rows() }];
    csr.entries().for_each(|(row, column, weight)| {
        let sum = &mut sums[if is_transposed { column } else { row }];
        // Up to three entries of the diagonal and the layers have the same position, and are a single entry here. It is counted as three
        // terms.
        *sum = (sum.0 + weight.abs(), sum.1 + 3);
    });
    sums
}

const PARTS: [Part; 3] = [Part::Full, Part::Direct, Part::Global];

#[test]
fn products_agree_with_the_processor_to_rounding_for_any_bands() {
    let gpu = Gpu::for_tests();
    // A discrete GPU has separate memory that the host cannot read.
    let far = Gpu { shares_memory: false, ..gpu.clone() };
    for matrix in [coaxial().matrix, apart()] {
        let whole = GpuMatrix::on(&gpu, &matrix).unwrap_or_else(|error| unreachable!("{error}"));
        let cut = GpuMatrix::within(&far, &matrix, Limits { entries: 700, rows: 100 })
            .unwrap_or_else(|error| unreachable!("{error}"));
        assert!(whole.dispatches() == 2 && cut.dispatches() > 20, "{} bands", cut.dispatches());
        let mut compared = 0.0_f64;
        for (part, channel) in PARTS.into_iter().flat_map(|part| [0, 1, 2].map(|channel| (part, channel))) {
            let products = both(&matrix, &whole, (part, channel));
            for (is_transposed, (expected, found)) in [false, true].into_iter().zip(&products) {
                let magnitudes = magnitudes(&matrix, (part, channel), is_transposed);
                for (row, (magnitude, terms)) in magnitudes.into_iter().enumerate() {
                    let error = (expected[row] - found[row]).abs();
                    // Each sum has an error of at most ε/2 of Σ|a||x| per product (Higham 2002, section 3.1), and here |x| < 1. Entries at
                    // the same position are summed and rounded to `f32`, which changes Σ|a| by less than a half.
                    let bound = 1.5 * (terms + 2) as f64 * f64::EPSILON * magnitude;
                    assert!(error <= bound, "{part:?} {channel}, row {row}: {error:e} above {bound:e}");
                    compared += expected[row].abs();
                }
            }
            let again = both(&matrix, &whole, (part, channel));
            assert!(products == again, "{part:?} {channel}: the same bits again");
            let in_bands = both(&matrix, &cut, (part, channel));
            assert!(products == in_bands, "{part:?} {channel}: bands make no difference");
        }
        assert!(compared > 1000.0, "there is light to be compared: {compared}");
    }
}

#[test]
fn vectors_that_do_not_fit_are_refused() {
    let matrix = apart();
    let gpu_matrix =
        GpuMatrix::on(&Gpu::for_tests(), &matrix).unwrap_or_else(|error| unreachable!("{error}"));
    let [rows, cols] = [matrix.rig.camera.pixels(), matrix.rig.projector.pixels()];
    let apply = |x: usize, y: usize| gpu_matrix.apply(Part::Full, 0, &vec![1.0; x], &mut vec![0.0; y]);
    assert!(apply(cols, rows).is_ok() && apply(rows, cols).is_err() && apply(cols, rows - 1).is_err());
}

#[test]
fn figures_of_the_device_are_those_of_the_matrix() {
    let gpu = Gpu::for_tests();
    for matrix in [coaxial().matrix, apart()] {
        let on_device = GpuMatrix::within(&gpu, &matrix, Limits { entries: 7000, rows: 400 });
        let on_device = on_device.unwrap_or_else(|error| unreachable!("{error}"));
        let bands = on_device.dispatches();
        assert!(bands > 4 && bands == on_device.layers.iter().map(|layer| layer.bands.len()).sum::<usize>());
        let [rows, cols] = [matrix.rig.camera.pixels(), matrix.rig.projector.pixels()];
        // Each band has the offsets of its rows and one more offset. An entry has a column and a weight. Vectors are double precision.
        let offsets = 4 * (2 * rows + bands);
        let diagonal = if matrix.is_symmetric() { 4 * rows } else { 0 };
        let bytes = offsets + 8 * matrix.nonzeros() + diagonal + 8 * (rows + cols);
        assert_eq!(on_device.bytes_of_product(), bytes as u64);
        let took = [on_device.time_products(2), on_device.time_copies(1001, 2)];
        assert!(took.iter().all(|took| took.as_ref().is_ok_and(|took| !took.is_zero())), "{took:?}");
        assert!(format!("{on_device:?}").starts_with("GpuMatrix"));
    }
}

#[test]
fn only_a_rig_apart_has_its_transpose_on_the_device() {
    let gpu = Gpu::for_tests();
    for matrix in [coaxial().matrix, apart()] {
        let on_device = GpuMatrix::on(&gpu, &matrix).unwrap_or_else(|error| unreachable!("{error}"));
        both(&matrix, &on_device, (Part::Global, 0));
        let state = on_device.state.lock().unwrap_or_else(PoisonError::into_inner);
        assert_eq!(state.transposed.is_some(), !matrix.is_symmetric());
    }
}

/// `Vᵀ w` over the columns from `first`, and `‖w‖`. Numbers are below 1, so a sum of `n` of their products has an error of at most `n² ε/2`
/// in any order. Two such sums differ by at most `n² ε`.
fn plain_sums(columns: &[Vec<f64>], first: usize, w: &[f64]) -> (Vec<f64>, f64) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    (columns[first..].iter().map(|column| dot(column, w)).collect(), dot(w, w).sqrt())
}

fn assert_near(found: &[f64], expected: &[f64], bound: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= bound, "{what}: {found} {expected}, above {bound:e}");
    }
}

#[test]
fn vectors_on_the_device_are_changed_as_on_the_host() -> Result<()> {
    let gpu = Gpu::for_tests();
    let random = &mut Pcg64::seed_from_u64(4);
    // One block and several; chunks of one, two and all columns.
    for (rows, chunk) in [(37, 1), (2600, 2 * 8 * 2600), (2600, 1 << 20)] {
        let count = 5;
        let mut vectors = DeviceVectors::in_chunks(&gpu, rows, count, chunk)?;
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut w = signed(random, rows);
        for divisor in [2.0, 3.0, 5.0, 7.0, 11.0] {
            let column = signed(random, rows);
            vectors.load(&column)?;
            vectors.push(divisor)?;
            columns.push(column.iter().map(|value| value / divisor).collect());
        }
        assert!(vectors.push(1.0).is_err(), "there is no room for a sixth column");
        // Vulkan promises no rounding of divisions in double precision. Any sensible one is within a few ε.
        assert_near(&vectors.column(3)?, &columns[3], 4.0 * f64::EPSILON, "a column");
        vectors.load(&w)?;
        let bound = rows as f64 * rows as f64 * f64::EPSILON;
        // `n` terms below 1 are removed one after the other.
        let few = 2.0 * (count as f64 + 1.0) * f64::EPSILON;
        for first in 0..=count {
            let (dots, length) = vectors.dots_and_norm(first)?;
            let (expected, norm) = plain_sums(&columns, first, &w);
            assert_near(&dots, &expected, bound, "inner products");
            assert!((length / norm - 1.0).abs() < rows as f64 * f64::EPSILON);
            assert_eq!(vectors.dots_and_norm(first)?, (dots, length), "the same bits again");
        }
        let take = |w: &mut [f64], columns: &[Vec<f64>], h: &[f64]| {
            for (column, h) in columns.iter().zip(h) {
                w.iter_mut().zip(column).for_each(|(w, entry)| *w -= h * entry);
            }
        };
        vectors.remove(&[0.5, -0.25])?;
        take(&mut w, &columns, &[0.5, -0.25]);
        assert_near(&vectors.work()?, &w, few, "first columns");
        let h = [0.1, -0.2, 0.3, -0.4, 0.5];
        let (dots, _) = vectors.remove_and_dot(&h)?;
        take(&mut w, &columns, &h);
        assert_near(&vectors.work()?, &w, few, "all columns");
        assert_near(&dots, &plain_sums(&columns, 0, &w).0, 2.0 * bound, "what is left along them");

        let settling =
            Settling { late: &[0.1, 0.2, 0.3, 0.4], along: &[0.7, -0.6], ahead: &[0.5, 0.4, 0.3, 0.0] };
        let (dots, _) = vectors.settle_and_dot(&settling)?;
        take(&mut w, &columns, &[0.5, 0.4, 0.3, 0.7, -0.6]);
        let (before, last) = columns.split_at_mut(4);
        take(&mut last[0], before, settling.late);
        assert_near(&vectors.column(4)?, &columns[4], few, "the last column");
        assert_near(&vectors.work()?, &w, few, "w after settling");
        assert_near(&dots, &plain_sums(&columns, 0, &w).0, 2.0 * bound, "with the new last column");
        assert_eq!((vectors.rows(), vectors.columns()), (rows, count));

        // Without recent columns, and without late parts, which leave `ahead` out.
        let ahead = [0.5, 0.4, 0.3, 0.2];
        for (late, along) in [(&[0.1, 0.2, 0.3, 0.4][..], &[][..]), (&[], &[0.7, -0.6])] {
            let w = signed(random, rows);
            vectors.load(&w)?;
            let before: Vec<Vec<f64>> =
                (0..count).map(|index| Ok(vectors.column(index)?.into_owned())).collect::<Result<_>>()?;
            vectors.settle_and_dot(&Settling { late, along, ahead: &ahead })?;
            let mut expected = w;
            if !late.is_empty() {
                take(&mut expected, &before, &ahead);
            }
            take(&mut expected, &before[count - along.len()..], along);
            assert_near(&vectors.work()?, &expected, few, "w without some of the parts");
        }
    }
    Ok(())
}

#[test]
fn vectors_on_the_device_are_combined_scaled_and_clipped() -> Result<()> {
    let random = &mut Pcg64::seed_from_u64(5);
    let rows = 2600;
    let mut vectors = DeviceVectors::in_chunks(&Gpu::for_tests(), rows, 4, 3 * 8 * rows as u64)?;
    let [a, b, c, w] = [(); 4].map(|()| signed(random, rows));
    for column in [&a, &b, &c, &a] {
        vectors.load(column)?;
        vectors.push(1.0)?;
    }
    let of = |entry: &dyn Fn(usize) -> f64| (0..rows).map(entry).collect::<Vec<f64>>();
    // A few operations with numbers below 8.
    let few = 32.0 * f64::EPSILON;
    let terms = [(2.0, None), (-3.0, Some(0)), (0.5, Some(2))];
    for (count, third) in [(3, 0.5), (2, 0.0)] {
        vectors.load(&w)?;
        vectors.combine(Some(1), &terms[..count], 3.0)?;
        let expected = of(&|i| (2.0 * w[i] - 3.0 * a[i] + third * c[i]) / 3.0);
        assert_near(&vectors.column(1)?, &expected, few, "a combination");
    }
    vectors.load(&w)?;
    vectors.combine(None, &[(-1.0, Some(2)), (1.0, None)], 1.0)?;
    vectors.keep(1)?;
    assert_near(&vectors.column(1)?, &of(&|i| w[i] - c[i]), few, "a kept vector");
    assert_eq!(vectors.work()?, vectors.column(1)?, "w stays");
    vectors.scale_by(0)?;
    assert_near(&vectors.work()?, &of(&|i| (w[i] - c[i]) * a[i]), few, "a scaled vector");
    let size = of(&|i| a[i].abs());
    vectors.load(&size)?;
    vectors.keep(0)?;
    for (lower, upper) in [(-0.25, 0.5), (f64::NEG_INFINITY, 0.0)] {
        vectors.load(&w)?;
        vectors.clip_by(0, (lower, upper))?;
        let expected = of(&|i| w[i].max(lower * size[i]).min(upper * size[i]));
        assert_near(&vectors.work()?, &expected, few, "a clipped vector");
    }
    // The last column is in another buffer.
    assert!(vectors.combine(None, &[(1.0, Some(3))], 1.0).is_err() && vectors.scale_by(3).is_err());
    vectors.load(&w)?;
    vectors.combine(Some(3), &[(1.0, None)], 2.0)?;
    assert_near(&vectors.column(3)?, &of(&|i| w[i] / 2.0), few, "only terms must be in the first one");
    Ok(())
}

#[test]
fn a_column_is_an_exact_copy_if_nothing_divides_it() -> Result<()> {
    let mut vectors = DeviceVectors::new(&Gpu::for_tests(), 3, 1)?;
    let column = [f64::MIN_POSITIVE / 8.0, 1.0 / 3.0, -0.0];
    vectors.load(&column)?;
    vectors.push(1.0)?;
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&vectors.column(0)?), bits(&column));
    Ok(())
}

#[test]
fn norms_beyond_the_squares_of_floats_are_found_on_the_device() -> Result<()> {
    let mut vectors = DeviceVectors::new(&Gpu::for_tests(), 2, 1)?;
    for scale in [1e200, 1e-200] {
        vectors.load(&[3.0 * scale, 4.0 * scale])?;
        let (_, length) = vectors.dots_and_norm(0)?;
        assert!((length / (5.0 * scale) - 1.0).abs() < 5.0 * f64::EPSILON, "{length:e}");
    }
    vectors.load(&[f64::NAN, 1.0])?;
    assert!(vectors.dots_and_norm(0)?.1.is_nan());
    Ok(())
}

#[test]
fn products_within_the_device_are_those_with_the_host() -> Result<()> {
    let (gpu, assembled) = (Gpu::for_tests(), coaxial());
    let on_device = GpuMatrix::on(&gpu, &assembled.matrix)?;
    let x = signed(&mut Pcg64::seed_from_u64(5), 37 * 29);
    let Some(mut vectors) = on_device.vectors(3, None)? else {
        unreachable!("there is room for three vectors")
    };
    for _ in 0..2 {
        vectors.load(&x)?;
        vectors.push(1.0)?;
    }
    for (part, channel) in PARTS.into_iter().zip(0..) {
        let mut expected = vec![0.0; x.len()];
        on_device.apply(part, channel, &x, &mut expected)?;
        for direction in [Direction::Forward, Direction::Adjoint] {
            // The matrix is symmetric.
            on_device.multiply_within(
                &assembled.matrix,
                Product { part, channel, direction },
                &mut vectors,
                1,
            )?;
            assert_eq!(vectors.work()?, expected, "{part:?}: the same bits");
        }
    }
    let product = |part| Product { part, channel: 0, direction: Direction::Forward };
    // S P Sᵀ v, with a part of the pixels and their factors.
    let entries: Vec<usize> = (0..x.len()).filter(|entry| entry % 7 < 3).collect();
    let factors = signed(&mut Pcg64::seed_from_u64(6), entries.len());
    let selection = Selection { entries: &entries, factors: &factors };
    let Some(mut vectors) = on_device.vectors(2, Some(selection))? else { unreachable!("there is room") };
    let v = signed(&mut Pcg64::seed_from_u64(7), entries.len());
    vectors.load(&v)?;
    vectors.push(1.0)?;
    let (mut pattern, mut photo) = (vec![0.0; x.len()], vec![0.0; x.len()]);
    entries.iter().zip(&factors).zip(&v).for_each(|((&entry, s), v)| pattern[entry] = s * v);
    on_device.apply(Part::Global, 0, &pattern, &mut photo)?;
    // Another product leaves its pattern.
    on_device.apply(Part::Full, 0, &x, &mut vec![0.0; x.len()])?;
    on_device.multiply_within(&assembled.matrix, product(Part::Global), &mut vectors, 0)?;
    let expected: Vec<f64> = entries.iter().zip(&factors).map(|(&entry, s)| s * photo[entry]).collect();
    assert_eq!(vectors.work()?, expected, "the same bits");
    assert_eq!(vectors.product()?, crate::operator::Product { from: pattern, to: photo });
    let beyond = Selection { entries: &[x.len()], factors: &[1.0] };
    assert!(
        on_device.vectors(1, Some(beyond)).is_err()
            && on_device.vectors(1, Some(Selection { factors: &[], ..beyond })).is_err()
    );
    let twice = Selection { entries: &[3, 3], factors: &[1.0; 2] };
    assert!(on_device.vectors(1, Some(twice)).is_err(), "two factors of one entry");
    let mut unrelated = DeviceVectors::new(&gpu, x.len(), 1)?;
    assert!(on_device.multiply_within(&assembled.matrix, product(Part::Full), &mut unrelated, 0).is_err());
    assert!(GpuMatrix::on(&gpu, &apart())?.vectors(3, None)?.is_none(), "the rig's matrix is not square");
    Ok(())
}
