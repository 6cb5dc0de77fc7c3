//! Helpers for the tests of the Krylov methods: operators that count, fail and err, and a named gallery.
#![allow(dead_code, reason = "each test binary uses its own part of this")]
#![allow(clippy::unwrap_used, reason = "in a test a panic is the report")]

use faer::{Mat, Side};
use krylux::krylov::{Start, dot, norm};
use krylux::operator::{Adjoint, Operator, Symmetry};
use krylux::{Error, Result};

/// A dense matrix that counts its products, and fails or spoils those it is told to.
#[derive(Clone)]
pub struct Dense {
    pub n: usize,
    pub entries: Vec<f64>,
    pub symmetry: Symmetry,
    pub products: usize,
    pub fail_at: Option<usize>,
    pub spoil_at: Option<usize>,
}

impl Dense {
    pub fn new(n: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let entries = (0..n * n).map(|k| entry(k / n, k % n)).collect();
        Self { n, entries, symmetry: Symmetry::Symmetric, products: 0, fail_at: None, spoil_at: None }
    }

    pub fn general(n: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        Self { symmetry: Symmetry::General, ..Self::new(n, entry) }
    }

    pub fn diagonal(values: &[f64]) -> Self {
        Self::new(values.len(), |i, j| if i == j { values[i] } else { 0.0 })
    }

    /// `Q diag(values) Q` with a Householder reflection `Q`: the same eigenvalues, and no zeros to make it easy.
    pub fn turned(values: &[f64]) -> Self {
        Self::diagonal(values).reflected()
    }

    /// `Q A Q`, as [`Dense::turned`].
    pub fn reflected(mut self) -> Self {
        let n = self.n;
        let axis: Vec<f64> = (0..n).map(|i| 1.0 + ((i * i) as f64).sin()).collect();
        let square = dot(&axis, &axis);
        // A − 2 a (aᵀA)/|a|² for the rows, then for the columns.
        for _ in 0..2 {
            let mut shares = vec![0.0; n];
            for (row, factor) in self.entries.chunks(n).zip(&axis) {
                shares.iter_mut().zip(row).for_each(|(share, entry)| *share += factor * entry);
            }
            for (row, factor) in self.entries.chunks_mut(n).zip(&axis) {
                row.iter_mut()
                    .zip(&shares)
                    .for_each(|(entry, share)| *entry -= 2.0 * factor * share / square);
            }
            self.entries = (0..n * n).map(|k| self.entries[(k % n) * n + k / n]).collect();
        }
        self
    }

    pub fn matrix(&self) -> Mat<f64> {
        Mat::from_fn(self.n, self.n, |i, j| self.entries[i * self.n + j])
    }

    /// Descending.
    pub fn eigenvalues(&self) -> Vec<f64> {
        let mut values = self.matrix().self_adjoint_eigenvalues(Side::Lower).unwrap();
        values.reverse();
        values
    }

    pub fn complex_eigenvalues(&self) -> Vec<(f64, f64)> {
        self.matrix().eigenvalues().unwrap().iter().map(|value| (value.re, value.im)).collect()
    }

    /// The largest column norm: of the size of `‖A‖`.
    pub fn size(&self) -> f64 {
        (0..self.n)
            .map(|j| (0..self.n).map(|i| self.entries[i * self.n + j].powi(2)).sum::<f64>().sqrt())
            .fold(0.0, f64::max)
    }

    /// `‖A (x + i y) − (θ + i φ)(x + i y)‖`, by products that are not counted.
    pub fn residual(&self, value: (f64, f64), re: &[f64], im: &[f64]) -> f64 {
        let zero = vec![0.0; self.n];
        let im = if im.is_empty() { &zero } else { im };
        let (mut a, mut b) = (vec![0.0; self.n], vec![0.0; self.n]);
        let mut this = self.clone();
        (this.fail_at, this.spoil_at) = (None, None);
        this.apply(re, &mut a).unwrap();
        this.apply(im, &mut b).unwrap();
        let real: Vec<f64> = (0..self.n).map(|i| a[i] - value.0 * re[i] + value.1 * im[i]).collect();
        let imaginary: Vec<f64> = (0..self.n).map(|i| b[i] - value.0 * im[i] - value.1 * re[i]).collect();
        norm(&real).hypot(norm(&imaginary))
    }
}

impl Operator for Dense {
    fn rows(&self) -> usize {
        self.n
    }
    fn cols(&self) -> usize {
        self.n
    }
    fn symmetry(&self) -> Symmetry {
        self.symmetry
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.products += 1;
        y.fill(-7.0);
        if self.fail_at == Some(self.products) {
            return Err(Error::Interrupted);
        }
        for (y, row) in y.iter_mut().zip(self.entries.chunks(self.n)) {
            *y = dot(row, x);
        }
        if self.spoil_at == Some(self.products) {
            y[0] = f64::NAN;
        }
        Ok(())
    }
}

impl Adjoint for Dense {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.products += 1;
        x.fill(0.0);
        for (row, factor) in self.entries.chunks(self.n).zip(y) {
            x.iter_mut().zip(row).for_each(|(x, entry)| *x += factor * entry);
        }
        Ok(())
    }
}

/// Products with an error of norm `noise(product) · ‖x‖` in a random direction, fresh each time.
pub struct Noisy<'a, F> {
    pub operator: &'a mut dyn Operator,
    pub noise: F,
    pub taken: usize,
    /// Whether it states the errors of its products.
    pub states: bool,
    error: f64,
}

impl<'a, F: Fn(usize) -> f64> Noisy<'a, F> {
    pub fn new(operator: &'a mut dyn Operator, noise: F) -> Self {
        Self { operator, noise, taken: 0, states: false, error: 0.0 }
    }
}

impl<F: Fn(usize) -> f64> Operator for Noisy<'_, F> {
    fn rows(&self) -> usize {
        self.operator.rows()
    }
    fn cols(&self) -> usize {
        self.operator.cols()
    }
    fn symmetry(&self) -> Symmetry {
        self.operator.symmetry()
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.operator.apply(x, y)?;
        self.taken += 1;
        let error = Start::Gaussian { seed: 1000 + self.taken as u64 }.vector(y.len());
        self.error = (self.noise)(self.taken) * norm(x);
        let factor = self.error / norm(&error);
        y.iter_mut().zip(&error).for_each(|(y, error)| *y += factor * error);
        Ok(())
    }
    fn standard_errors(&self) -> Vec<f64> {
        if self.states { vec![self.error] } else { Vec::new() }
    }
}

pub fn spread(n: usize) -> Vec<f64> {
    (0..n).map(|k| 1.0 - (k as f64 / n as f64).sqrt()).collect()
}

/// Named symmetric systems, of the kinds that make eigensolvers stumble.
pub fn symmetric_gallery() -> Vec<(&'static str, Dense)> {
    let with = |n: usize, value: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..n).map(value).collect() };
    let clustered = |k: usize| 1.0 - 1e-6 * (k % 5) as f64 - (k / 5) as f64 * 0.05;
    let path = |i: usize, j: usize| match i.abs_diff(j) {
        0 => 2.0,
        1 => -1.0,
        _ => 0.0,
    };
    let wilkinson = |i: usize, j: usize| match i.abs_diff(j) {
        0 => (i as f64 - 10.0).abs(),
        1 => 1.0,
        _ => 0.0,
    };
    let kernel = |i: usize, j: usize| (-((i as f64 - j as f64) / 15.0).powi(2)).exp();
    let two_regions =
        |i: usize, j: usize| if (i < 40) == (j < 40) { 1.0 / (1.0 + i.abs_diff(j) as f64) } else { 0.0 };
    let arrow = |i: usize, j: usize| match (i, j) {
        (0, 0) => 1.0,
        (0, k) | (k, 0) => 1.0 / k as f64,
        (i, j) if i == j => i as f64 * 0.1,
        _ => 0.0,
    };
    vec![
        ("spread", Dense::turned(&spread(120))),
        ("indefinite", Dense::turned(&with(60, &|k| k as f64 - 40.0))),
        ("negative_definite", Dense::turned(&with(50, &|k| -1.0 - k as f64))),
        ("graded", Dense::turned(&with(40, &|k| 10f64.powi(-(k as i32) / 3)))),
        ("singular", Dense::turned(&with(70, &|k| if k < 20 { 1.0 / (1.0 + k as f64) } else { 0.0 }))),
        ("almost_singular", Dense::turned(&with(60, &|k| if k < 59 { 1.0 + k as f64 } else { 1e-13 }))),
        ("repeated", Dense::diagonal(&with(60, &|k| (4 - k / 15) as f64))),
        ("repeated_turned", Dense::turned(&with(60, &|k| (4 - k / 15) as f64))),
        ("clustered", Dense::turned(&with(80, &clustered))),
        (
            "nearly_degenerate",
            Dense::turned(&with(90, &|k| if k < 2 { 2.0 - 1e-9 * k as f64 } else { 1.0 / k as f64 })),
        ),
        ("one_dominant", Dense::turned(&with(100, &|k| if k == 0 { 1e6 } else { (k as f64).cos() }))),
        (
            "plus_minus_pairs",
            Dense::turned(&with(60, &|k| if k % 2 == 0 { 1.0 + k as f64 } else { -(k as f64) })),
        ),
        ("identity", Dense::diagonal(&[1.0; 50])),
        ("zero", Dense::diagonal(&[0.0; 40])),
        (
            "rank_one",
            Dense::new(50, |i, j| {
                ((i * j) as f64 + 1.0).recip().min((1.0 + i as f64) * (1.0 + j as f64) / 2500.0)
            })
            .rank_one(),
        ),
        ("second_difference", Dense::new(80, path)),
        ("wilkinson", Dense::new(21, wilkinson)),
        ("smooth_kernel", Dense::new(100, kernel)),
        ("two_regions", Dense::new(90, two_regions)),
        ("arrow", Dense::new(60, arrow)),
        ("hilbert", Dense::new(30, |i, j| 1.0 / (1.0 + (i + j) as f64))),
        ("huge_entries", Dense::turned(&with(40, &|k| 1e150 * (1.0 + k as f64)))),
        ("tiny_entries", Dense::turned(&with(40, &|k| 1e-150 * (1.0 + k as f64)))),
        ("one_by_one", Dense::diagonal(&[3.0])),
        ("two_by_two", Dense::new(2, |i, j| if i == j { 0.0 } else { 1.0 })),
    ]
}

impl Dense {
    /// The outer product of its first row with itself.
    fn rank_one(self) -> Self {
        let row = self.entries[..self.n].to_vec();
        Self::new(self.n, |i, j| row[i] * row[j])
    }
}

/// Named systems that are not symmetric.
pub fn general_gallery() -> Vec<(&'static str, Dense)> {
    let rotations = |n: usize| {
        // Blocks r (cos −sin; sin cos): eigenvalues r e^{±iφ}, then hidden by a reflection.
        Dense::general(n, move |i, j| {
            if i / 2 != j / 2 {
                return 0.0;
            }
            let radius = 1.0 / (1.0 + (i / 2) as f64 * 0.3);
            let angle = 0.4 + (i / 2) as f64 * 0.7;
            match (i % 2, j % 2) {
                (0, 1) => -radius * angle.sin(),
                (1, 0) => radius * angle.sin(),
                _ => radius * angle.cos(),
            }
        })
        .reflected()
    };
    let convection = |i: usize, j: usize| match i as i64 - j as i64 {
        0 => 2.0,
        1 => -1.2,
        -1 => -0.8,
        _ => 0.0,
    };
    let random = |n: usize| {
        let entries = Start::Gaussian { seed: 9 }.vector(n * n);
        Dense::general(n, move |i, j| entries[i * n + j] / (n as f64).sqrt())
    };
    let stochastic = |i: usize, j: usize| {
        let weight = |i: usize, j: usize| 1.0 / (1.0 + (i as f64 - 0.7 * j as f64).abs());
        weight(i, j) / (0..70).map(|k| weight(i, k)).sum::<f64>()
    };
    vec![
        ("rotations", rotations(60)),
        ("cyclic_shift", Dense::general(12, |i, j| f64::from(u8::from((j + 1) % 12 == i)))),
        ("convection_diffusion", Dense::general(50, convection)),
        ("random", random(60)),
        ("row_stochastic", Dense::general(70, stochastic)),
        (
            "triangular",
            Dense::general(40, |i, j| {
                if i == j {
                    40.0 - i as f64
                } else if j > i {
                    0.3
                } else {
                    0.0
                }
            }),
        ),
        ("symmetric_all_the_same", Dense { symmetry: Symmetry::General, ..Dense::turned(&spread(60)) }),
        ("zero", Dense::general(20, |_, _| 0.0)),
        ("one_by_one", Dense::general(1, |_, _| -2.0)),
    ]
}
