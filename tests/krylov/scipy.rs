//! Against SciPy, on exported matrices of three scenes: residual histories, eigenvalues, and how many products they take.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use crate::common::root;
use krylux::Result;
use krylux::analysis::SegmentOptions;
use krylux::analysis::segment::segment;
use krylux::io::sparse;
use krylux::krylov::{EigsOptions, Method, PairStatus, SolveOptions, Start, Status, eigs, norm, solve};
use krylux::operator::{Operator, Symmetry};
use krylux::sparse::SparseOperator;
use serde_json::Value;

const SCENES: [&str; 3] = ["corner", "zigzag", "cornell"];
const N: usize = 256;

/// `A = direct + global`, which counts its products, or the global part alone.
struct Exported {
    parts: Vec<SparseOperator>,
    products: usize,
}

impl Exported {
    fn new(scene: &str, parts: &[&str]) -> Self {
        let folder = root().join("tests/reference");
        let part = |part: &&str| {
            SparseOperator::new(sparse::read(&folder.join(format!("{scene}_16_{part}.npz"))).unwrap())
        };
        Self { parts: parts.iter().map(part).collect(), products: 0 }
    }

    fn full(scene: &str) -> Self {
        Self::new(scene, &["global", "direct"])
    }
}

impl Operator for Exported {
    fn rows(&self) -> usize {
        N
    }
    fn cols(&self) -> usize {
        N
    }
    fn symmetry(&self) -> Symmetry {
        if self.parts.iter().all(|part| part.symmetry() == Symmetry::Symmetric) {
            Symmetry::Symmetric
        } else {
            Symmetry::General
        }
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.products += 1;
        y.fill(0.0);
        let mut part = vec![0.0; N];
        for operator in &mut self.parts {
            operator.apply(x, &mut part)?;
            y.iter_mut().zip(&part).for_each(|(y, part)| *y += part);
        }
        Ok(())
    }
}

/// SciPy's results for a scene.
fn theirs(scene: &str) -> Value {
    let path = root().join("tests/reference/scipy_16.json");
    let mut all: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    all["scenes"][scene].take()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn residual_histories_lie_on_scipys() {
    let b: Vec<f64> = (0..N).map(|i| (7919 * i % 1009) as f64 / 1009.0).collect();
    for scene in SCENES {
        let expected = theirs(scene);
        for (method, name) in [(Method::Minres, "minres"), (Method::Gmres, "gmres"), (Method::Cg, "cg")] {
            let expected = numbers(&expected["histories"][name]);
            let options = SolveOptions { products: expected.len(), rtol: 0.0, ..SolveOptions::default() };
            let found = solve(method, &mut Exported::full(scene), &b, &options).unwrap();
            let mut worst = 0.0_f64;
            let mut compared = 0;
            for (row, theirs) in found.history.iter().zip(&expected) {
                // Residuals near 1e-16, of the size of rounding in b − A x, are each program's own.
                if *theirs > 1e-12 {
                    worst = worst.max((row.residual / theirs - 1.0).abs());
                    compared += 1;
                }
            }
            println!(
                "{scene}, {name}: {compared} residuals, down to {:.1e}, within {worst:.1e}",
                expected[compared - 1]
            );
            assert!(compared >= 15, "{scene}, {name}: {compared}");
            // A line in a plot of six decades, 500 pixels high, is as thick as 2.8 %. Rounding at 1e-12 is 1e-4 of a residual.
            assert!(worst < 1e-3, "{scene}, {name}: {worst:e}");
        }
    }
}

#[test]
fn eigenvalues_are_lapacks_from_fewer_products_than_arpack_takes() {
    for scene in SCENES {
        let expected = &theirs(scene)["full"];
        let values = numbers(&expected["eigenvalues"]);
        let arpack = expected["eigsh_products"].as_u64().unwrap() as usize;
        let options = EigsOptions { products: arpack, tolerance: 1e-8, ..EigsOptions::default() };
        let mut matrix = Exported::full(scene);
        let found = eigs(&mut matrix, &options).unwrap();
        println!("{scene}: {} products, eigsh {arpack}", found.stats.products);
        assert_eq!(found.stats.status, Status::ReachedTolerance, "{scene}");
        assert_eq!(found.stats.products, matrix.products);
        assert!(found.stats.products < arpack, "{scene}: {} and {arpack}", found.stats.products);
        for ((value, expected), status) in found.values.iter().zip(&values).zip(&found.statuses) {
            assert_eq!(*status, PairStatus::Converged);
            assert!((value - expected).abs() <= 1e-8 * values[0], "{scene}: {value} {expected}");
        }
    }
}

#[test]
fn fifty_products_resolve_what_arpack_raises_on_after_ninety() {
    // eigsh(ncv=50, maxiter=1) is the recipe of the paper in SciPy's words: as many Lanczos vectors as photos and one restart (section
    // 8.1), with 50 photos (section 8.2).
    let mut raised = 0;
    for scene in SCENES {
        let expected = &theirs(scene)["full"];
        let recipe = &expected["eigsh_ncv50_maxiter1"];
        let arpack = recipe[1].as_u64().unwrap() as usize;
        raised += usize::from(recipe[0] == "ArpackNoConvergence");
        let values = numbers(&expected["eigenvalues"]);
        let options = EigsOptions { products: 50, tolerance: 0.0, ..EigsOptions::default() };
        let found = eigs(&mut Exported::full(scene), &options).unwrap();
        assert!(found.stats.products == 50 && arpack >= 90, "{scene}: {arpack}");
        // Half as many, and each value comes with a bound that holds.
        for (index, (value, bound)) in found.values.iter().zip(&found.bounds).enumerate() {
            let nearest = values.iter().map(|other| (other - value).abs()).fold(f64::INFINITY, f64::min);
            assert!(nearest <= *bound, "{scene}, {index}: {nearest:e} {bound:e}");
        }
    }
    assert!(raised >= 2, "{raised}");
}

#[test]
fn normalized_cuts_are_lapacks_from_no_more_photos_than_arpack_takes() {
    for scene in SCENES {
        let expected = &theirs(scene)["cut"];
        let values = numbers(&expected["eigenvalues"]);
        let arpack = expected["eigsh_products"].as_u64().unwrap() as usize;
        let options = SegmentOptions {
            photos: arpack,
            eigenvectors: values.len(),
            groups: vec![2],
            tolerance: 1e-8,
            mask_below: 0.0,
            ..SegmentOptions::default()
        };
        let mut matrix = Exported::new(scene, &["global"]);
        let found = segment(&mut matrix, &options).unwrap();
        println!("{scene}, normalized cut: {} photos, eigsh {arpack}: {}", found.photos, found.status);
        assert_eq!(found.photos, matrix.products, "the photo for D counts");
        assert!(found.photos <= arpack);
        for ((value, expected), residual) in found.eigenvalues.iter().zip(&values).zip(&found.residuals) {
            assert!(*residual <= 1e-8, "{scene}: {residual:e} at {}", found.photos);
            assert!((value - expected).abs() <= 1e-8, "{scene}: {value} {expected}");
        }
    }
}

#[test]
fn eigenvectors_hold_on_the_exported_matrix() {
    for scene in SCENES {
        let start = Start::Gaussian { seed: 1 };
        let options = EigsOptions { products: 120, start, ..EigsOptions::default() };
        let found = eigs(&mut Exported::full(scene), &options).unwrap();
        let mut matrix = Exported::full(scene);
        for ((vector, value), residual) in found.vectors.iter().zip(&found.values).zip(&found.residuals) {
            let mut product = vec![0.0; N];
            matrix.apply(vector, &mut product).unwrap();
            let difference: Vec<f64> = product.iter().zip(vector).map(|(y, x)| y - value * x).collect();
            // Rounding of 256 terms of size 0.3.
            assert!((norm(&difference) - residual).abs() < 1e-14 * 0.3 * 256.0, "{scene}");
        }
    }
}
