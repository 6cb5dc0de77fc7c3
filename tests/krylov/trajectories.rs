//! The way of every solver, not only where it arrives: residuals after four, eight and twelve products.
//!
//! A mistake in a step size, a momentum or a rotation often costs some products and no accuracy, and no test of the solution
//! sees it. The numbers in `trajectories.txt` are no truth: they are what the methods did when all other tests held. A change
//! that moves them is meant, and then this test prints the lines that take their place, or it is a mistake.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use std::fmt::Write;

use crate::krylov::boxed::scenes;
use crate::krylov_gallery::{Named, named};
use krylux::krylov::{METHODS, Method, SolveOptions, solve_adjoint};

const KNOWN: &str = include_str!("trajectories.txt");

/// Methods whose iterates stay inside bounds start from the white photo, which is given.
fn residuals(method: Method, system: &Named, bounded: bool) -> Vec<f64> {
    let matrix = &system.matrix;
    let diagonal = bounded.then(|| matrix.times(&vec![1.0; matrix.cols]));
    let after = |products: usize| {
        let options =
            SolveOptions { products, rtol: 0.0, diagonal: diagonal.clone(), ..SolveOptions::default() };
        solve_adjoint(method, &mut matrix.clone(), &system.b, &options).unwrap().residual
    };
    [4, 8, 12].map(after).to_vec()
}

/// Systems on which residuals are far from rounding after twelve products.
fn systems() -> Vec<(Named, bool)> {
    let names = [
        "spd_ill",
        "indefinite",
        "badly_scaled",
        "nonsymmetric_strong",
        "upwind",
        "rotations",
        "tall_inconsistent",
    ];
    let linear = names.into_iter().map(|name| (named(name), false));
    let boxed = scenes().into_iter().map(|(name, matrix, b)| {
        let system = Named { name, matrix, b, ..named("tiny_1") };
        (system, true)
    });
    linear.chain(boxed).collect()
}

#[test]
fn every_solver_takes_the_way_that_it_took() {
    let mut now = String::new();
    for (system, bounded) in systems() {
        for facts in METHODS {
            let constrained = facts.constraint != krylux::krylov::Constraint::None;
            let fits =
                (system.square() || facts.needs_transpose) && (system.symmetric() || !facts.needs_symmetry);
            if constrained == bounded && fits {
                let residuals = residuals(facts.method, &system, bounded);
                writeln!(
                    now,
                    "{} {} {:.9e} {:.9e} {:.9e}",
                    facts.name, system.name, residuals[0], residuals[1], residuals[2]
                )
                .unwrap();
            }
        }
    }
    assert_eq!(now.lines().count(), KNOWN.lines().count(), "the lines are now\n{now}");
    for (known, line) in KNOWN.lines().zip(now.lines()) {
        let (mut known_words, mut words) = (known.split(' '), line.split(' '));
        assert_eq!(
            (known_words.next(), known_words.next()),
            (words.next(), words.next()),
            "the lines are now\n{now}"
        );
        for (known, now) in known_words.zip(words) {
            let (known, now): (f64, f64) = (known.parse().unwrap(), now.parse().unwrap());
            // The sine and exponential of other systems differ in the last bit, which twelve steps on these systems amplify by far
            // less than 1e9. What is below 1e-8 is rounding on its way to nothing.
            assert!((known - now).abs() <= 1e-6 * known + 1e-8, "{line}, and it was {known}");
        }
    }
}
