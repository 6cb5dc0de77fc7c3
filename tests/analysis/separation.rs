//! Low-rank relighting, separation and probing on shipped scenes, against what the simulator knows exactly.

use crate::common::{csr, rms, settings, traced};
use krylux::analysis::Probing;
use krylux::analysis::low_rank::{LowRankCapture, capture, error_curve, optimal_errors};
use krylux::analysis::probe::probe;
use krylux::analysis::separate::{SeparateBy, from_capture, random_patterns};
use krylux::image::Resolution;
use krylux::krylov::Start;
use krylux::operator::Operator;
use krylux::sparse::{Csr, SparseOperator};
use krylux::transport::{Channels, Part};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const SIDE: usize = 64;

/// `(A, G, direct)` of a shipped scene at 64×64.
fn scene(name: &'static str) -> (Csr, Csr, Vec<f64>) {
    let traced = &traced(name, settings(SIDE, 64, 6, 0), Channels::Luma).matrix;
    let direct = csr(traced, Part::Direct, 0);
    let mut diagonal = vec![0.0; SIDE * SIDE];
    direct.entries().for_each(|(row, column, weight)| {
        assert_eq!(row, column, "direct light of coaxial pinholes is a diagonal");
        diagonal[row] += weight;
    });
    (csr(traced, Part::Full, 0), csr(traced, Part::Global, 0), diagonal)
}

fn symmetric(csr: &Csr) -> SparseOperator {
    SparseOperator::new(csr.clone())
}

fn relative(found: &[f64], truth: &[f64]) -> f64 {
    let error: Vec<f64> = found.iter().zip(truth).map(|(found, truth)| found - truth).collect();
    rms(&error) / rms(truth)
}

/// Dead leaves: discs of random gray in front of one another, their radii by an inverse cube. Such pictures have the
/// statistics of natural ones (Lee, Mumford and Huang, doi:10.1023/A:1011109015675).
fn dead_leaves(seed: u64) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut picture = vec![f64::NAN; SIDE * SIDE];
    while picture.iter().any(|value| value.is_nan()) {
        let radius = 1.5 / random.random_range(0.05_f64..1.0).sqrt() * SIDE as f64 / 32.0;
        let side = SIDE as f64;
        let [x, y] = [0, 1].map(|_| random.random_range(-8.0..side + 8.0));
        let gray: f64 = random.random_range(0.0..1.0);
        for (pixel, value) in picture.iter_mut().enumerate() {
            let [dx, dy] = [(pixel % SIDE) as f64 + 0.5 - x, (pixel / SIDE) as f64 + 0.5 - y];
            // Later leaves lie behind.
            if value.is_nan() && dx * dx + dy * dy < radius * radius {
                *value = gray;
            }
        }
    }
    picture
}

#[test]
fn forty_photos_relight_natural_patterns() {
    for name in ["carton", "cornell"] {
        let (full, global, direct) = scene(name);
        let mut operator = symmetric(&global);
        let model = capture(&mut operator, &direct, &LowRankCapture::default()).expect("photos");
        assert_eq!(model.rank(), 40);
        let mut truth = vec![0.0; direct.len()];
        for seed in 0..4 {
            let pattern = dead_leaves(seed);
            symmetric(&full).apply(&pattern, &mut truth).expect("a product");
            let error = relative(&model.relight(&pattern), &truth);
            println!("{name}, pattern {seed}: relit within {error:.4}");
            assert!(error < 0.05, "{name}, pattern {seed}: {error}");
        }
        let frobenius = global.entries().map(|(_, _, weight)| weight * weight).sum::<f64>().sqrt();
        let curve = error_curve(&model, frobenius);
        let best = optimal_errors(&mut operator, frobenius, 40, 200).expect("eigenvalues");
        for k in [1, 5, 10, 20, 40] {
            let (row, best) = (curve[k - 1], best[k - 1]);
            println!(
                "{name}, {k} photos: {:.4} ({:.4} by W Qᵀ), the best of rank {k} {best:.4}",
                row.error, row.one_sided
            );
            assert!(row.error <= row.one_sided, "symmetry can only add knowledge");
            // W Qᵀ has rank k; G_k up to 2k, and so might be better than the best of rank k, but not here.
            assert!(row.one_sided >= best);
        }
        // The frozen matrix's own noise has no low rank, so all of these are far from 0; what counts is the ratio.
        assert!(curve[39].error < 1.1 * best[39], "{name}: {} to {}", curve[39].error, best[39]);
    }
}

#[test]
fn each_separation_is_as_near_the_first_bounce_as_its_page_says() {
    let resolution = Resolution::new(SIDE, SIDE);
    println!("| scene | checkerboards, 16 photos | sinusoids, 6 | random, 41 | capture, 41 |");
    for name in ["zigzag", "carton", "cornell", "mirror"] {
        let (full, _, direct) = scene(name);
        let mut operator = symmetric(&full);
        let mut white = vec![0.0; SIDE * SIDE];
        operator.apply(&vec![1.0; SIDE * SIDE], &mut white).expect("photo");
        let start = Some(Start::Rademacher { seed: 1 });
        let model =
            capture(&mut operator, &[], &LowRankCapture { photos: 40, start, ..LowRankCapture::default() })
                .expect("photos");
        let found = [
            SeparateBy::Checkerboards { square: 2, shifts: 4 }
                .measure(&mut operator, resolution, 0)
                .expect("photos"),
            SeparateBy::Sinusoids { period: 4.0, phases: 3 }
                .measure(&mut operator, resolution, 0)
                .expect("photos"),
            random_patterns(&mut operator, 40, 0).expect("photos"),
            from_capture(&model, &white).expect("white"),
        ];
        assert_eq!(found.each_ref().map(|found| found.photos), [16, 6, 41, 41]);
        let errors = found.each_ref().map(|found| relative(&found.direct, &direct));
        println!("| {name} | {} |", errors.map(|error| format!("{:.1} %", 100.0 * error)).join(" | "));
        if name == "mirror" {
            // The known failure: a mirror shows the squares as sharp as the wall itself, and they count as direct light.
            assert!(errors[0] > 2.0 * errors[2] && errors[1] > 2.0 * errors[2]);
        } else {
            // Light that comes back to its own pixel or its neighbours counts as direct everywhere: a few per cent.
            assert!(errors.iter().all(|&error| error < 0.06), "{name}: {errors:?}");
        }
        // Random patterns tell their own error: of the diagonal of A, which is the direct light and what returns to its pixel.
        let mut diagonal = vec![0.0; SIDE * SIDE];
        full.entries()
            .filter(|(row, column, _)| row == column)
            .for_each(|(row, _, weight)| diagonal[row] += weight);
        let errors = found[2].standard_error.as_ref().expect("random patterns tell their error");
        let z: Vec<f64> = (0..SIDE * SIDE)
            .filter(|&i| errors[i] > 0.0)
            .map(|i| (found[2].direct[i] - diagonal[i]) / errors[i])
            .collect();
        // Student's t of 39 degrees of freedom has a standard deviation of 1.027; the spread over a few thousand
        // pixels, of which neighbours share their light, is a few per cent.
        assert!((0.9..1.15).contains(&rms(&z)), "{name}: {}", rms(&z));
    }
}

#[test]
fn probing_lets_the_paths_through_that_it_says() {
    let resolution = Resolution::new(SIDE, SIDE);
    let (full, _, _) = scene("cornell");
    let mut operator = symmetric(&full);
    for (probing, photos) in [
        (Probing::Direct, 100),
        (Probing::Indirect, 101),
        (Probing::Near { sigma: 3.0 }, 100),
        (Probing::Far { sigma: 3.0 }, 101),
        (Probing::NearIndirect { sigma: 3.0 }, 200),
    ] {
        let mut truth = vec![0.0; SIDE * SIDE];
        full.entries().for_each(|(row, column, weight)| {
            let apart = |a: usize, b: usize| a as f64 - b as f64;
            let distance = apart(row % SIDE, column % SIDE).hypot(apart(row / SIDE, column / SIDE));
            truth[row] += probing.weight(distance) * weight;
        });
        let found = probe(&mut operator, (resolution, None), probing, 100, 3).expect("photos");
        assert_eq!(found.photos, photos);
        let z: Vec<f64> =
            (0..SIDE * SIDE).map(|i| (found.values[i] - truth[i]) / found.standard_errors[i]).collect();
        let error = relative(&found.values, &truth);
        println!("{probing:?}, {photos} photos: within {error:.4}, rms z {:.3}", rms(&z));
        // A wide band's patterns are alike over some 60 pixels, so there are about 70 independent values: 8 % each way, twice.
        assert!((0.83..1.17).contains(&rms(&z)), "{probing:?}: {}", rms(&z));
    }
}
