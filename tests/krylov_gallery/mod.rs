//! Named systems `A x = b`, an operator that counts and fails as it is told, and dense answers.
#![allow(dead_code, reason = "each test file uses its part")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use faer::Mat;
use krylux::krylov::{Start, dot, norm};
use krylux::operator::{Adjoint, Operator, Symmetry};
use krylux::{Error, Result};

/// A dense matrix that counts its products, and fails or spoils the one it is told to.
#[derive(Clone)]
pub struct Dense {
    pub rows: usize,
    pub cols: usize,
    pub entries: Vec<f64>,
    pub symmetry: Symmetry,
    pub forward: usize,
    pub adjoint: usize,
    pub fail_at: Option<usize>,
    pub spoil_at: Option<usize>,
}

impl Dense {
    pub fn new(rows: usize, cols: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let entries: Vec<f64> = (0..rows * cols).map(|k| entry(k / cols, k % cols)).collect();
        let symmetric =
            rows == cols && (0..rows).all(|i| (0..i).all(|j| entries[i * cols + j] == entries[j * cols + i]));
        let symmetry = if symmetric { Symmetry::Symmetric } else { Symmetry::General };
        Self { rows, cols, entries, symmetry, forward: 0, adjoint: 0, fail_at: None, spoil_at: None }
    }

    pub fn products(&self) -> usize {
        self.forward + self.adjoint
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        self.entries[i * self.cols + j]
    }

    fn taken(&self, out: &mut [f64]) -> Result<()> {
        if self.fail_at == Some(self.products()) {
            out.fill(-7.0);
            return Err(Error::Interrupted);
        }
        if self.spoil_at == Some(self.products()) {
            out[0] = f64::NAN;
        }
        Ok(())
    }

    pub fn times(&self, x: &[f64]) -> Vec<f64> {
        self.entries.chunks(self.cols).map(|row| dot(row, x)).collect()
    }

    pub fn transposed_times(&self, y: &[f64]) -> Vec<f64> {
        (0..self.cols).map(|j| (0..self.rows).map(|i| self.at(i, j) * y[i]).sum()).collect()
    }
}

impl Operator for Dense {
    fn rows(&self) -> usize {
        self.rows
    }
    fn cols(&self) -> usize {
        self.cols
    }
    fn symmetry(&self) -> Symmetry {
        self.symmetry
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.forward += 1;
        y.copy_from_slice(&self.times(x));
        self.taken(y)
    }
}

impl Adjoint for Dense {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.adjoint += 1;
        x.copy_from_slice(&self.transposed_times(y));
        self.taken(x)
    }
}

/// A system with its least-squares solution of least norm, by the dense singular value decomposition.
pub struct Named {
    pub name: &'static str,
    pub matrix: Dense,
    pub b: Vec<f64>,
    pub solution: Vec<f64>,
    /// `‖b − A x‖` of the solution.
    pub residual: f64,
    /// Largest singular value over the least that is not zero (to 1e-13 of the largest).
    pub condition: f64,
    pub positive_definite: bool,
}

impl Named {
    fn new(name: &'static str, matrix: Dense, b: Vec<f64>) -> Self {
        let full = Mat::from_fn(matrix.rows, matrix.cols, |i, j| matrix.at(i, j));
        let svd = full.thin_svd().unwrap();
        let values: Vec<f64> = svd.S().column_vector().iter().copied().collect();
        let largest = values.first().copied().unwrap_or(0.0);
        let mut solution = vec![0.0; matrix.cols];
        let mut least = largest;
        for (k, &value) in values.iter().enumerate().filter(|(_, value)| **value > 1e-13 * largest) {
            least = least.min(value);
            let along: f64 = (0..matrix.rows).map(|i| svd.U()[(i, k)] * b[i]).sum();
            for (j, x) in solution.iter_mut().enumerate() {
                *x += along / value * svd.V()[(j, k)];
            }
        }
        let residual = misfit(&matrix, &solution, &b);
        let positive_definite = matrix.symmetry == Symmetry::Symmetric
            && full.self_adjoint_eigenvalues(faer::Side::Lower).unwrap()[0] > 1e-13 * largest;
        let condition = if largest > 0.0 { largest / least } else { 1.0 };
        Self { name, matrix, b, solution, residual, condition, positive_definite }
    }

    pub fn n(&self) -> usize {
        self.matrix.cols
    }

    pub fn square(&self) -> bool {
        self.matrix.rows == self.matrix.cols
    }

    pub fn symmetric(&self) -> bool {
        self.matrix.symmetry == Symmetry::Symmetric
    }

    pub fn consistent(&self) -> bool {
        self.residual <= 1e-11 * norm(&self.b)
    }
}

/// `‖b − A x‖`, by a product of its own.
pub fn misfit(matrix: &Dense, x: &[f64], b: &[f64]) -> f64 {
    let difference: Vec<f64> = matrix.times(x).iter().zip(b).map(|(y, b)| b - y).collect();
    norm(&difference)
}

pub fn random(n: usize, seed: u64) -> Vec<f64> {
    Start::Gaussian { seed }.vector(n)
}

/// `Q diag(values) Q` with a Householder reflection `Q`, symmetric to the bit.
pub fn turned(values: &[f64]) -> Dense {
    let n = values.len();
    let axis: Vec<f64> = (0..n).map(|i| 1.0 + ((i * i) as f64).sin()).collect();
    let square = dot(&axis, &axis);
    let q = |i: usize, j: usize| f64::from(u8::from(i == j)) - 2.0 * axis[i] * axis[j] / square;
    Dense::new(n, n, |i, j| {
        let (i, j) = (i.min(j), i.max(j));
        (0..n).map(|k| q(i, k) * values[k] * q(k, j)).sum()
    })
}

pub fn diagonal(values: &[f64]) -> Dense {
    Dense::new(values.len(), values.len(), |i, j| if i == j { values[i] } else { 0.0 })
}

/// A scene: direct light on the diagonal, with a texture, and smooth indirect light `Σ a_k φ_k φ_kᵀ ≥ 0` between
/// `side × side` pixels that are lit from each other's neighbourhoods.
pub fn light_like(side: usize, indirect: f64) -> Dense {
    let n = side * side;
    let place = |i: usize| ((i % side) as f64 / side as f64, (i / side) as f64 / side as f64);
    let albedo = |i: usize| 0.6 + 0.35 * ((i * 7919 % 104_729) as f64).sin();
    Dense::new(n, n, |i, j| {
        let (i, j) = (i.min(j), i.max(j));
        let ((xi, yi), (xj, yj)) = (place(i), place(j));
        let square = (xi - xj).powi(2) + (yi - yj).powi(2);
        let both = albedo(i) * albedo(j);
        let direct = if i == j { 0.3 * albedo(i) } else { 0.0 };
        direct + indirect * both * 0.3 / n as f64 / (0.05 + square)
    })
}

/// `B A B` with a symmetric, normalized Gaussian blur `B` of `sigma` pixels: defocus of projector and camera.
pub fn defocused(sharp: &Dense, side: usize, sigma: f64) -> Dense {
    let n = side * side;
    let line = Mat::from_fn(side, side, |i, j| {
        // Mirrored at the borders, which keeps it symmetric and its sums 1.
        let gauss = |d: f64| (-d * d / (2.0 * sigma * sigma)).exp() / (sigma * std::f64::consts::TAU.sqrt());
        let (i, j, w) = (i as f64, j as f64, side as f64);
        (-3..=3)
            .map(|m| gauss(i - j - 2.0 * w * f64::from(m)) + gauss(i + j + 1.0 - 2.0 * w * f64::from(m)))
            .sum()
    });
    let blur = Mat::from_fn(n, n, |i, j| {
        let across: f64 = line[(i % side, j % side)];
        across * line[(i / side, j / side)]
    });
    let full = &blur * Mat::from_fn(n, n, |i, j| sharp.at(i, j)) * &blur;
    Dense::new(n, n, |i, j| full[(i.min(j), i.max(j))])
}

fn plain(name: &'static str, matrix: Dense) -> Named {
    let b = random(matrix.rows, 11);
    Named::new(name, matrix, b)
}

fn in_range(name: &'static str, matrix: Dense) -> Named {
    let b = matrix.times(&random(matrix.cols, 12));
    Named::new(name, matrix, b)
}

fn graded(n: usize, decades: f64) -> Vec<f64> {
    (0..n).map(|k| 10.0_f64.powf(-decades * k as f64 / (n - 1) as f64)).collect()
}

/// Every kind of system that has ever tripped a solver.
pub fn gallery() -> Vec<Named> {
    let n = 40;
    let noise = random(n * n, 5);
    let rectangle = |rows: usize, cols: usize| {
        let entries = random(rows * cols, 6);
        Dense::new(rows, cols, |i, j| entries[i * cols + j])
    };
    let with_zeros = |count: usize| -> Vec<f64> {
        (0..n).map(|k| if k < count { 0.0 } else { 1.0 + k as f64 / n as f64 }).collect()
    };
    let eye = |i: usize, j: usize| f64::from(u8::from(i == j));
    let unit = |n: usize| (0..n).map(|i| eye(i, 0)).collect::<Vec<f64>>();
    vec![
        plain("spd_well", turned(&(0..n).map(|k| 1.0 + 2.0 * k as f64 / n as f64).collect::<Vec<_>>())),
        in_range("spd_ill", turned(&graded(n, 5.0))),
        plain("negative_definite", turned(&(0..n).map(|k| -1.0 - k as f64 / 9.0).collect::<Vec<_>>())),
        plain("indefinite", turned(&(0..n).map(|k| k as f64 - 14.5).collect::<Vec<_>>())),
        in_range("nearly_singular", {
            let mut values = with_zeros(0);
            values[0] = 1e-10;
            turned(&values)
        }),
        plain("repeated_eigenvalues", turned(&(0..n).map(|k| [1.0, 2.0, 5.0][k % 3]).collect::<Vec<_>>())),
        plain(
            "clustered_eigenvalues",
            turned(&(0..n).map(|k| 1.0 + (k % 4) as f64 + 1e-6 * k as f64).collect::<Vec<_>>()),
        ),
        plain("identity", diagonal(&vec![1.0; n])),
        plain("scaled_identity", diagonal(&vec![1e-150; n])),
        Named::new("zero_rhs", turned(&with_zeros(0)), vec![0.0; n]),
        Named::new("zero_matrix", diagonal(&vec![0.0; n]), unit(n)),
        in_range("singular_consistent", turned(&with_zeros(3))),
        plain("singular_inconsistent", turned(&with_zeros(3))),
        plain("badly_scaled", {
            let scale = graded(n, 3.0);
            let core = light_like(2, 0.5);
            Dense::new(n, n, |i, j| scale[i] * scale[j] * (eye(i, j) + 0.02 * core.at(i % 4, j % 4)))
        }),
        plain(
            "arrow",
            Dense::new(n, n, |i, j| {
                if i == j {
                    4.0 + i as f64 / 8.0
                } else if i == 0 || j == 0 {
                    0.3
                } else {
                    0.0
                }
            }),
        ),
        plain("swap_symmetric", Dense::new(n, n, |i, j| eye(i ^ 1, j))),
        plain("light_like", light_like(6, 0.4)),
        in_range("defocused", defocused(&light_like(6, 0.4), 6, 0.6)),
        plain("nonsymmetric_mild", Dense::new(n, n, |i, j| 2.0 * eye(i, j) + 0.05 * noise[i * n + j])),
        plain("nonsymmetric_strong", Dense::new(n, n, |i, j| 1.5 * eye(i, j) + noise[i * n + j] / 6.0)),
        plain("upwind", Dense::new(n, n, |i, j| 2.0 * eye(i, j) - 1.6 * eye(i, j + 1) - 0.3 * eye(i + 1, j))),
        plain(
            "rotations",
            Dense::new(n, n, |i, j| {
                let (s, c) = (0.3 + 0.02 * (i / 2) as f64).sin_cos();
                if i == j {
                    c
                } else if i ^ 1 == j {
                    if i < j { -s } else { s }
                } else {
                    0.0
                }
            }),
        ),
        plain(
            "skew",
            Dense::new(n, n, |i, j| {
                if i == j {
                    0.0
                } else {
                    let s = ((i.min(j) * 5 + i.max(j)) as f64).sin() + 2.0 * eye(i ^ 1, j);
                    if i < j { s } else { -s }
                }
            }),
        ),
        Named::new("cyclic_shift", Dense::new(12, 12, |i, j| eye(i, (j + 1) % 12)), unit(12)),
        Named::new(
            "quarter_turn",
            Dense::new(2, 2, |i, j| {
                if i == j {
                    0.0
                } else if i < j {
                    1.0
                } else {
                    -1.0
                }
            }),
            unit(2),
        ),
        Named::new("traceless", diagonal(&[1.0, -1.0]), vec![1.0, 1.0]),
        Named::new("tiny_1", diagonal(&[3.0]), vec![6.0]),
        Named::new("tiny_2", Dense::new(2, 2, |i, j| [[2.0, 1.0], [1.0, 3.0]][i][j]), vec![1.0, -1.0]),
        plain("tall_inconsistent", rectangle(30, 12)),
        in_range("tall_consistent", rectangle(30, 12)),
        plain("wide", rectangle(12, 30)),
        plain("rank_deficient", {
            let (left, right) = (rectangle(20, 4), rectangle(4, 15));
            Dense::new(20, 15, |i, j| (0..4).map(|k| left.at(i, k) * right.at(k, j)).sum())
        }),
        plain("column", rectangle(9, 1)),
        plain("row", rectangle(1, 9)),
    ]
}

/// The system of this name.
pub fn named(name: &str) -> Named {
    gallery().into_iter().find(|system| system.name == name).unwrap_or_else(|| panic!("no system {name}"))
}
