//! Masks against `Π ∘ A` itself, on generated matrices of a camera and a projector with pixels of their own.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::{Mask, probe_masked};
use crate::error::Result;
use crate::image::Resolution;
use crate::krylov::norm;
use crate::sparse::{Csr, SparseOperator};

const SIZE: Resolution = Resolution { width: 8, height: 6 };
const CAMERA: usize = 35;

/// One pixel to the right and one down.
const MOVED: usize = SIZE.width + 1;

/// A name, a mask, and `(Π ∘ A) 1` by the definition.
type Case = (&'static str, Mask, Vec<f64>);

fn dense(rows: usize, values: Vec<f64>) -> Result<Csr> {
    let columns = values.len() / rows;
    let starts = (0..=rows).map(|row| row * columns).collect();
    Csr::new(columns, starts, (0..rows).flat_map(|_| 0..columns as u32).collect(), values)
}

/// A matrix, and masks that are moved by `shift` projector pixels.
fn cases(seed: u64, shift: usize) -> Result<(SparseOperator, Vec<Case>)> {
    let mut random = Pcg64::seed_from_u64(seed);
    let n = SIZE.pixels();
    let mut draw = |count: usize| -> Vec<f64> { (0..count).map(|_| random.random_range(0.0..1.0)).collect() };
    let (light, places, speckle) = (draw(CAMERA * n), draw(CAMERA), draw(CAMERA * n));
    let [m, p] = [CAMERA, n].map(|length| [(); 3].map(|()| draw(length)));
    // One in ten camera pixels has no home.
    let home = |place: f64| (place < 0.9).then(|| ((place * 1e6) as usize + shift) % n);
    let homes: Vec<_> = places.into_iter().map(home).collect();
    let [camera, projector] = [(CAMERA, shift), (n, 0)].map(|(count, shift)| -> Vec<Option<u32>> {
        (0..count).map(|pixel| (pixel + shift) % 7).map(|line| (line < 6).then_some(line as u32)).collect()
    });
    let before = |i: usize| (i + n - shift) % n;
    let all = |weight: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
        (0..CAMERA * n).map(|at| weight(at / n, at % n)).collect()
    };
    let truth = |weight: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
        let parts: Vec<f64> = all(weight).iter().zip(&light).map(|(weight, light)| weight * light).collect();
        parts.chunks(n).map(|row| row.iter().sum()).collect()
    };
    let place = |pixel: usize| [(pixel % SIZE.width) as f64, (pixel / SIZE.width) as f64];
    let by_place = |is_let: &dyn Fn(f64, f64) -> bool, homeless: f64| {
        truth(&|j, i| {
            homes[j]
                .map(place)
                .map_or(homeless, |[x, y]| f64::from(u8::from(is_let(place(i)[0] - x, place(i)[1] - y))))
        })
    };
    let speckled = |j: usize, i: usize| f64::from(u8::from(speckle[j * n + before(i)] < 0.4));
    let paired = |j: usize, i: usize| (0..3).map(|k| m[k][j] * p[k][before(i)]).sum::<f64>();
    let moved = p.iter().map(|pattern| (0..n).map(|i| pattern[before(i)]).collect()).collect();
    let of = Some(&homes[..]);
    let cases = vec![
        ("row", Mask::row(SIZE, of)?, by_place(&|_, y| y == 0.0, 0.0)),
        ("column", Mask::column(SIZE, of)?, by_place(&|x, _| x == 0.0, 0.0)),
        ("band", Mask::band(SIZE, of, [-1, 2])?, by_place(&|x, _| (-1.0..=2.0).contains(&x), 0.0)),
        ("beyond", Mask::beyond(SIZE, of, 2.5)?, by_place(&|x, y| x.hypot(y) > 2.5, 1.0)),
        (
            "lines",
            Mask::lines(&camera, &projector)?,
            truth(&|j, i| f64::from(u8::from(camera[j].is_some() && camera[j] == projector[i]))),
        ),
        ("speckle", Mask::given(&dense(CAMERA, all(&speckled))?)?, truth(&speckled)),
        ("of rank 3", Mask::given(&dense(CAMERA, all(&paired))?)?, truth(&paired)),
        ("pairs", Mask::pairs(&m, moved)?, truth(&paired)),
    ];
    Ok((SparseOperator::new(dense(CAMERA, light)?), cases))
}

fn off(found: &[f64], truth: &[f64]) -> f64 {
    norm(&found.iter().zip(truth).map(|(a, b)| a - b).collect::<Vec<_>>()) / norm(truth)
}

#[test]
fn each_mask_is_the_product_with_its_weights_and_a_shifted_one_is_not() -> Result<()> {
    for seed in 0..4 {
        let ((mut operator, right), (_, shifted)) = (cases(seed, 0)?, cases(seed, MOVED)?);
        for ((name, mask, truth), (_, shifted, _)) in right.into_iter().zip(shifted) {
            let found = probe_masked(&mut operator, &mask, SIZE.pixels(), seed)?;
            assert!(found.standard_errors.iter().all(|&error| error == 0.0), "{name}");
            let wrong = probe_masked(&mut operator, &shifted, SIZE.pixels(), seed)?.values;
            let exact = [&mask, &shifted].map(|mask| off(&mask.exact(operator.matrix()), &truth));
            for [right, wrong] in [exact, [found.values, wrong].map(|found| off(&found, &truth))] {
                println!("{name}: {} photos, within {right:.1e}, shifted {wrong:.3}", found.photos);
                assert!(right < 1e-6 && wrong > 1e-3, "{name}: {right} {wrong}");
            }
            let rank = probe_masked(&mut operator, &mask, 20, seed)?;
            assert!(rank.photos == 3 || !["of rank 3", "pairs"].contains(&name), "{name}: {}", rank.photos);
        }
    }
    Ok(())
}

#[test]
fn few_photos_are_as_far_off_as_their_standard_errors_say() -> Result<()> {
    const DRAWS: u64 = 1000;
    let ((mut operator, right), (_, shifted)) = (cases(7, 0)?, cases(7, MOVED)?);
    for ((name, mask, truth), (_, _, wrong)) in right.into_iter().zip(shifted).take(6) {
        // There are more parts than photos, so that random patterns are needed.
        let photos = if mask.parts() > 12 { 12 } else { 5 };
        let (mut squares, mut variances, mut mean) = (0.0, 0.0, vec![0.0; CAMERA]);
        for seed in 0..DRAWS {
            let found = probe_masked(&mut operator, &mask, photos, seed)?;
            for (pixel, value) in found.values.iter().enumerate() {
                squares += (value - truth[pixel]).powi(2);
                variances += found.standard_errors[pixel].powi(2);
                mean[pixel] += value / DRAWS as f64;
            }
        }
        let deviation = |truth: &[f64]| off(&mean, truth) * norm(truth) * DRAWS as f64 / variances.sqrt();
        let (ratio, [right, wrong]) = (squares / variances, [&truth, &wrong].map(|truth| deviation(truth)));
        println!(
            "{name}: squared errors {ratio:.3} of the variances, the mean off by {right:.2}, shifted by {wrong:.1}"
        );
        // All pixels of a draw share its signs. 1000 of them know a variance to about 7 %.
        assert!((0.8..1.2).contains(&ratio) && right < 2.0 && wrong > 3.0, "{name}: {ratio} {right} {wrong}");
    }
    Ok(())
}
