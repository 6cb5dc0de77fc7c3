//! Light transport segmentation on matrices whose groups are known.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use std::ops::ControlFlow;

use faer::{Mat, Side};
use krylux::analysis::segment::segment;
use krylux::analysis::{
    Capture, Coordinates, Cut, CutMatrix, Graph, MASKED, SegmentOptions, Segmentation, adjusted_rand_index,
};
use krylux::krylov::dot;
use krylux::observer::{OnStep, Step};
use krylux::operator::{Observed, Operator, Symmetry};
use krylux::{Error, Result};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A dense symmetric transport matrix that counts its photos and fails at one of them if told to.
#[derive(Clone)]
struct Scene {
    n: usize,
    entries: Vec<f64>,
    truth: Vec<u8>,
    photos: usize,
    fail_at: Option<usize>,
}

impl Scene {
    fn new(truth: Vec<u8>, light: impl Fn(usize, usize) -> f64) -> Self {
        let n = truth.len();
        let entries = (0..n * n).map(|k| light((k / n).min(k % n), (k / n).max(k % n))).collect();
        Self { n, entries, truth, photos: 0, fail_at: None }
    }

    /// Regions that exchange light within themselves, at random, and `between` times as much with the others. Which
    /// pixel is in which is random.
    fn regions(sizes: &[usize], between: f64, seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut truth: Vec<u8> =
            sizes.iter().enumerate().flat_map(|(k, &size)| vec![k as u8; size]).collect();
        for i in (1..truth.len()).rev() {
            truth.swap(i, random.random_range(0..=i));
        }
        let n = truth.len();
        let noise: Vec<f64> = (0..n * n).map(|_| random.random::<f64>()).collect();
        let regions = truth.clone();
        Self::new(truth, |i, j| noise[i * n + j] * if regions[i] == regions[j] { 1.0 } else { between })
    }

    /// The same with `pairs` of pixels after the last, each pixel of a twentieth of `degree`, that exchange a `rest` of their light with
    /// others and all else with each other: what noise leaves where next to no light is.
    fn with_strays(self, pairs: usize, degree: f64, rest: f64) -> Self {
        let n = self.n;
        let truth = self.truth.iter().copied().chain(vec![MASKED; 2 * pairs]).collect();
        Self::new(truth, |i, j| match (i < n, j < n) {
            (true, true) => self.entries[i * n + j],
            (false, false) if i != j && (i - n) / 2 == (j - n) / 2 => 0.05 * degree * (1.0 - rest),
            (true, false) => 0.05 * degree * rest / n as f64,
            _ => 0.0,
        })
    }

    /// Two strips side by side, mirror images of each other that exchange no light: the top row of `zigzag`, in
    /// small.
    fn mirrored(width: usize) -> Self {
        let n = 2 * width;
        let folded = move |i: usize| if i < width { i } else { n - 1 - i };
        let truth = (0..n).map(|i| u8::from(i >= width)).collect();
        Self::new(truth, |i, j| {
            if (i < width) != (j < width) {
                return 0.0;
            }
            1.0 / (1.0 + 0.01 * folded(i).abs_diff(folded(j)).pow(2) as f64)
        })
    }
}

impl Operator for Scene {
    fn rows(&self) -> usize {
        self.n
    }
    fn cols(&self) -> usize {
        self.n
    }
    fn symmetry(&self) -> Symmetry {
        Symmetry::Symmetric
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.photos += 1;
        if self.fail_at == Some(self.photos) {
            return Err(Error::Interrupted);
        }
        for (y, row) in y.iter_mut().zip(self.entries.chunks(self.n)) {
            *y = dot(row, x);
        }
        Ok(())
    }
}

fn run(scene: &mut Scene, options: &SegmentOptions) -> Segmentation {
    scene.photos = 0;
    let found = segment(scene, options).unwrap();
    assert_eq!(found.photos, scene.photos, "the photos reported are those taken");
    assert!(found.photos <= options.photos, "the budget holds");
    found
}

fn agreement(found: &Segmentation, truth: &[u8]) -> f64 {
    adjusted_rand_index(&found.labels[0].1, truth).unwrap()
}

fn options(groups: usize, photos: usize) -> SegmentOptions {
    SegmentOptions { photos, groups: vec![groups], ..SegmentOptions::default() }
}

#[test]
fn independent_regions_are_told_apart_in_a_few_photos() {
    for seed in 0..4 {
        let mut two = Scene::regions(&[90, 210], 0.0, seed);
        assert_eq!(agreement(&run(&mut two, &SegmentOptions { seed, ..options(2, 8) }), &two.truth), 1.0);
        // Eigenvalue 1 is threefold here: with the known copy deflated, Lanczos still sees only one vector of the
        // two-dimensional rest, and a random one has three different levels.
        let mut three = Scene::regions(&[60, 100, 140], 0.0, seed);
        assert_eq!(agreement(&run(&mut three, &SegmentOptions { seed, ..options(3, 8) }), &three.truth), 1.0);
    }
}

#[test]
fn average_cut_tells_weakly_coupled_regions_apart() {
    let mut scene = Scene::regions(&[150, 150], 0.05, 5);
    let found = run(&mut scene, &SegmentOptions { cut: Cut::Average, ..options(2, 15) });
    assert_eq!(agreement(&found, &scene.truth), 1.0);
    assert!(found.eigenvalues[0] == 0.0 && found.eigenvalues.windows(2).all(|pair| pair[0] <= pair[1]));
}

#[test]
fn mirror_symmetric_regions_are_told_apart_by_the_random_start() {
    let mut scene = Scene::mirrored(100);
    assert_eq!(agreement(&run(&mut scene, &options(2, 20)), &scene.truth), 1.0);
    // The best that an all-ones start could see: every vector that it reaches is symmetric, as its mirror image shows.
    let (mut pattern, mut photo) = (vec![1.0; 200], vec![0.0; 200]);
    for _ in 0..20 {
        scene.apply(&pattern, &mut photo).unwrap();
        pattern.clone_from(&photo);
    }
    assert!((0..100).all(|i| (pattern[i] / pattern[199 - i] - 1.0).abs() < 1e-12), "rounding of 20 products");
}

/// The eigenvalues wanted, from a dense eigensolver, for unmasked pixels `kept`.
fn dense_normalized(scene: &Scene, kept: &[usize], mu: f64) -> Vec<f64> {
    let weight = |i: usize, j: usize| scene.entries[i * scene.n + j] + mu;
    let degree: Vec<f64> = kept.iter().map(|&i| kept.iter().map(|&j| weight(i, j)).sum()).collect();
    let matrix = Mat::from_fn(kept.len(), kept.len(), |a, b| {
        weight(kept[a], kept[b]) / (degree[a] * degree[b]).sqrt()
    });
    let mut values = matrix.self_adjoint_eigenvalues(Side::Lower).unwrap();
    values.reverse();
    values
}

#[test]
fn eigenpairs_are_those_of_the_normalized_cut_with_mu_and_mask() {
    let mut scene = Scene::regions(&[30, 50], 0.2, 2);
    // Three pixels with next to no light: a second photo measures the degree under the mask.
    for dark in [0, 17, 40] {
        for k in 0..80 {
            scene.entries[dark * 80 + k] *= 1e-4;
            scene.entries[k * 80 + dark] *= 1e-4;
        }
    }
    let kept: Vec<usize> = (0..80).filter(|i| ![0, 17, 40].contains(i)).collect();
    for mu in [0.0, 0.3] {
        let found = run(&mut scene, &SegmentOptions { mu, photos: 79, ..options(2, 79) });
        assert!((0..80).all(|i| found.mask[i] != kept.contains(&i)));
        assert!(
            found.labels[0].1.iter().zip(&found.mask).all(|(&label, &masked)| (label == MASKED) == masked)
        );
        let truth = dense_normalized(&scene, &kept, mu);
        for (value, truth) in found.eigenvalues.iter().zip(&truth) {
            // Ritz values are as near as the square of the residuals (1e-6); then rounding, 80 terms.
            assert!((value - truth).abs() < 1e-11, "μ = {mu}: {value} {truth}");
        }
        assert_eq!(found.residuals[0], 0.0);
        for u in &found.eigenvectors {
            let length: f64 = u.iter().zip(&found.degree).map(|(u, d)| u * u * d).sum();
            assert!((length - 1.0).abs() < 1e-12, "uᵀ D u = 1 to rounding");
            assert!([0, 17, 40].iter().all(|&dark| u[dark] == 0.0));
        }
        // The degree matches: the first vector, all the same, is exactly an eigenvector.
        let first = &found.eigenvectors[0];
        assert!(kept.iter().all(|&i| (first[i] / first[kept[0]] - 1.0).abs() < 1e-14));
    }
}

#[test]
fn wrapped_operators_equal_their_dense_matrices() {
    let mut scene = Scene::regions(&[12, 9], 0.5, 3);
    let mu = 0.7;
    let white: Vec<f64> = (0..21).map(|i| scene.entries[i * 21..(i + 1) * 21].iter().sum()).collect();
    let graph = Graph::measure(&white, 0.0, mu, |_| Err(Error::Interrupted)).unwrap();
    let weight = |i: usize, j: usize| scene.entries[i * 21 + j] + mu;
    let degree: Vec<f64> = (0..21).map(|i| (0..21).map(|j| weight(i, j)).sum()).collect();
    let normalized: Vec<f64> =
        (0..441).map(|k| weight(k / 21, k % 21) / (degree[k / 21] * degree[k % 21]).sqrt()).collect();
    let laplacian: Vec<f64> = (0..441)
        .map(|k| weight(k / 21, k % 21) - if k / 21 == k % 21 { degree[k / 21] } else { 0.0 })
        .collect();
    let mut copy = scene.clone();
    for (dense, operator) in [
        (normalized, &mut CutMatrix::new(&mut copy, &graph, Cut::Normalized) as &mut dyn Operator),
        (laplacian, &mut CutMatrix::new(&mut scene, &graph, Cut::Average)),
    ] {
        for column in 0..21 {
            let mut unit = vec![0.0; 21];
            unit[column] = 1.0;
            let mut product = vec![0.0; 21];
            operator.apply(&unit, &mut product).unwrap();
            for (row, value) in product.iter().enumerate() {
                // Some roundings of numbers below 20.
                assert!((value - dense[row * 21 + column]).abs() < 1e-14 * 20.0);
            }
        }
    }
}

#[test]
fn residual_of_the_known_vector_is_within_its_bound_where_the_degree_lacks_a_photo() {
    // Pixel 2 is bright by the light of 3 and 4, which are masked; it is masked then too, and 0 still counts its light.
    let light = [(0, 1, 5.0), (0, 2, 0.1), (2, 3, 0.3), (2, 4, 0.3)];
    let mut scene = Scene::new(vec![0; 5], |i, j| {
        light.iter().find(|edge| (edge.0, edge.1) == (i, j)).map_or(0.0, |edge| edge.2)
    });
    let mut white = vec![0.0; 5];
    scene.apply(&[1.0; 5], &mut white).unwrap();
    let mut again = scene.clone();
    let graph = Graph::measure(&white, 0.1, 0.0, |pattern| {
        let mut photo = vec![0.0; 5];
        again.apply(pattern, &mut photo)?;
        Ok(photo)
    })
    .unwrap();
    assert_eq!(graph.pixels(), [0, 1]);
    assert_eq!(graph.leak(), 0.1);
    let residual = |operator: &mut dyn Operator, known: Vec<f64>, value: f64| {
        let mut product = vec![0.0; 2];
        operator.apply(&known, &mut product).unwrap();
        let rest: Vec<f64> = product.iter().zip(&known).map(|(p, k)| p - value * k).collect();
        (dot(&rest, &rest) / dot(&known, &known)).sqrt()
    };
    let normalized = Cut::Normalized.known_vector(&graph);
    let truth = residual(&mut CutMatrix::new(&mut scene, &graph, Cut::Normalized), normalized, 1.0);
    assert!(truth > 0.01 && truth <= Cut::Normalized.known_residual(&graph), "{truth}");
    let average = Cut::Average.known_vector(&graph);
    let truth = residual(&mut CutMatrix::new(&mut scene, &graph, Cut::Average), average, 0.0);
    // Here the bound is attained, up to rounding.
    assert!(truth > 0.01 && truth <= Cut::Average.known_residual(&graph) * (1.0 + 1e-12), "{truth}");
}

#[test]
fn capture_goes_on_after_a_failure_and_gives_the_same_bits() {
    let scene = Scene::regions(&[40, 60], 0.1, 4);
    let unfailed = run(&mut scene.clone(), &options(2, 20));
    for fault in [1, 2, 9] {
        let mut failing = Scene { fail_at: Some(fault), ..scene.clone() };
        let mut capture = Capture::new(options(2, 20)).unwrap();
        capture.run(&mut failing).unwrap_err();
        assert_eq!(capture.photos(), fault - 1);
        if fault == 9 {
            let sofar = capture.segmentation().unwrap();
            assert_eq!(sofar.photos, 8);
            assert!(sofar.status.contains("broke off"), "{}", sofar.status);
        } else {
            assert!(capture.segmentation().is_err());
        }
        capture.run(&mut failing).unwrap();
        let resumed = capture.segmentation().unwrap();
        assert_eq!((resumed.photos, failing.photos), (20, 21), "no photo was taken twice but the failed one");
        assert_eq!(resumed.eigenvectors, unfailed.eigenvectors);
        assert_eq!(resumed.labels, unfailed.labels);
        assert_eq!(resumed.history, unfailed.history);
    }
}

#[test]
fn one_capture_serves_any_number_of_groups_numbered_by_appearance() {
    let mut scene = Scene::regions(&[50, 50, 50], 0.02, 6);
    let found = run(&mut scene, &SegmentOptions { groups: vec![2, 3, 7], ..options(2, 30) });
    assert_eq!(found.photos, scene.photos);
    for (groups, labels) in &found.labels {
        let mut next = 0;
        for &label in labels {
            assert!(label <= next, "a new label is the next one");
            next = next.max(label + 1);
        }
        assert_eq!(usize::from(next), *groups);
    }
    assert_eq!(adjusted_rand_index(&found.labels[1].1, &scene.truth).unwrap(), 1.0);
}

#[test]
fn a_few_pixels_that_exchange_light_with_each_other_only_are_no_group() {
    for seed in 0..4 {
        // Nearly alone: each pair has an eigenvector of its own, before that of the regions. A row's mean degree is 75 or so.
        let regions = Scene::regions(&[150, 150], 0.005, seed);
        let plain = run(&mut regions.clone(), &SegmentOptions { seed, ..options(2, 40) });
        let mut scene = regions.with_strays(3, 75.0, 1e-3);
        let found = run(&mut scene, &SegmentOptions { seed, ..options(2, 40) });
        assert_eq!(
            found.mask.iter().filter(|&&masked| masked).count(),
            0,
            "they are bright enough to be seen"
        );
        assert_eq!(agreement(&found, &scene.truth), 1.0, "seed {seed}");
        let local: Vec<usize> = (0..10).filter(|&index| found.embedding.is_local(index)).collect();
        assert_eq!(local, [1, 2, 3], "{:?}", found.embedding.within);
        assert!(found.status.contains("3 are localized"), "{}", found.status);
        assert_eq!((found.regions.count, found.regions.at_one), (2, 2), "{:?}", found.regions);
        assert_eq!(plain.embedding.local(), 0);

        // Wholly alone, as are the regions: Lanczos sees one mixture of all.
        let mut scene = Scene::regions(&[150, 150], 0.0, seed).with_strays(3, 75.0, 0.0);
        let found = run(&mut scene, &SegmentOptions { seed, ..options(2, 8) });
        assert_eq!(agreement(&found, &scene.truth), 1.0, "seed {seed}, one eigenvalue for all");
    }
}

#[test]
fn a_capture_asked_at_every_photo_answers_as_one_of_so_many_photos() {
    let scene = Scene::regions(&[40, 60, 30], 0.1, 11);
    let mut live = scene.clone();
    let mut capture = Capture::new(SegmentOptions { tolerance: 0.0, ..options(3, 20) }).unwrap();
    for photos in 3..=20 {
        let observer = OnStep::new(|step: &Step<'_>| {
            if step.done >= photos as u64 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        capture.run(&mut Observed::new(&mut live, &observer)).unwrap();
        assert_eq!((capture.photos(), live.photos), (photos, photos), "no photo is taken twice");
        let asked = capture.segmentation().unwrap();
        let of_so_many = SegmentOptions { tolerance: 0.0, ..options(3, photos) };
        let alone = segment(&mut scene.clone(), &of_so_many).unwrap();
        assert_eq!(asked.labels, alone.labels, "{photos} photos");
        assert_eq!(asked.eigenvalues, alone.eigenvalues, "{photos} photos");
        assert_eq!(asked.eigenvectors, alone.eigenvectors, "{photos} photos");
        assert_eq!(asked.residuals, alone.residuals, "{photos} photos");
        assert_eq!(asked.history, alone.history, "{photos} photos");
        // Other numbers of groups equal the groups of a capture that was made for them.
        let two = SegmentOptions { groups: vec![2], ..of_so_many };
        let alone = segment(&mut scene.clone(), &two).unwrap();
        assert_eq!(
            capture.regrouped(&[2], Coordinates::Commute).unwrap().labels,
            alone.labels,
            "{photos} photos"
        );
    }
    let error = capture.regrouped(&[131], Coordinates::Commute).unwrap_err().to_string();
    assert!(error.starts_with("--groups"), "{error}");
}

#[test]
fn fewer_photos_than_eigenvectors_give_those_there_are() {
    let mut scene = Scene::regions(&[50, 50], 0.0, 7);
    let found = run(&mut scene, &options(2, 5));
    assert_eq!((found.photos, found.eigenvalues.len(), found.eigenvectors.len()), (5, 5, 5));
    assert!(found.status.contains("more photos may resolve others"), "{}", found.status);
}

#[test]
fn the_observer_counts_photos_and_can_stop() {
    let mut scene = Scene::regions(&[50, 50], 0.1, 8);
    let mut seen = Vec::new();
    let observer = OnStep::new(|step: &Step<'_>| {
        assert_eq!(step.total, 40);
        seen.push(step.done);
        if step.done == 6 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    let found = segment(&mut Observed::new(&mut scene, &observer), &options(2, 40)).unwrap();
    assert_eq!(seen, [2, 3, 4, 5, 6], "the first photo is the degree's");
    assert_eq!((found.photos, scene.photos), (6, 6));
    assert!(found.status.contains("stopped"), "{}", found.status);
}

#[test]
fn unusable_options_name_themselves() {
    let mut scene = Scene::regions(&[3, 3], 0.0, 9);
    let default = SegmentOptions::default();
    for (options, name) in [
        (SegmentOptions { photos: 2, ..default.clone() }, "--photos"),
        (SegmentOptions { groups: vec![2, 1], ..default.clone() }, "--groups"),
        (SegmentOptions { groups: vec![255], ..default.clone() }, "--groups"),
        (SegmentOptions { groups: vec![7], ..default.clone() }, "--groups"),
        (SegmentOptions { eigenvectors: 1, ..default.clone() }, "--eigenvectors"),
        (SegmentOptions { mu: -1.0, ..default.clone() }, "--mu"),
        (SegmentOptions { mask_below: f64::NAN, ..default }, "--mask-below"),
    ] {
        let error = segment(&mut scene, &options).unwrap_err();
        assert!(error.to_string().starts_with(name), "{error}");
    }
    let mut dark = Scene::new(vec![0; 8], |_, _| 0.0);
    assert!(segment(&mut dark, &options(2, 10)).unwrap_err().to_string().contains("no pixel"));
}
