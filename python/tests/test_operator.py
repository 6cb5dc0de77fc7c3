"""The operator under SciPy's and PyLops' methods, against dense answers."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg as sparse_linalg
from scipy.sparse.linalg import LinearOperator

import krylux

# Products sum some hundred terms in another order than a dense product.
ROUNDING = 1e-12


def relative(found, true):
    return np.linalg.norm(found - true) / np.linalg.norm(true)


@pytest.fixture
def rhs(dense):
    return np.random.default_rng(1).standard_normal(len(dense))


class Shifted(LinearOperator):
    """``A + s I``: well conditioned, so that solvers converge to the dense answer."""

    def __init__(self, of, shift):
        self.of, self.shift = of, shift
        super().__init__(of.dtype, of.shape)

    def _matvec(self, x):
        return self.of @ x.ravel() + self.shift * x.ravel()

    def _adjoint(self):
        return self


def test_it_is_a_linear_operator_of_scipy(zigzag):
    A = zigzag.operator("global")
    assert isinstance(A, LinearOperator) and isinstance(A, krylux.LabOperator)
    assert type(A).__mro__[1] is LinearOperator
    assert A.dtype is np.dtype(np.float64) and A.shape == (576, 576)
    assert sparse_linalg.aslinearoperator(A) is A


def test_products_equal_those_of_the_matrix_and_are_counted(zigzag, dense):
    A = zigzag.operator("global")
    X = np.random.default_rng(0).standard_normal((576, 5))
    assert relative(A @ X[:, 0], dense @ X[:, 0]) < ROUNDING
    assert A.photos == 1
    assert relative(A.matvec(X[:, :1]), dense @ X[:, :1]) < ROUNDING
    assert relative(A @ X, dense @ X) < ROUNDING
    assert A.photos == 7
    assert relative(A.T @ X, dense.T @ X) < ROUNDING and relative(A.H @ X[:, 0], dense.T @ X[:, 0]) < ROUNDING
    assert relative(A.rmatmat(X), dense.T @ X) < ROUNDING
    assert A.photos == 18


def test_vectors_of_any_type_and_strides_are_taken(zigzag):
    A = zigzag.operator("global")
    wide = np.random.default_rng(4).integers(-3, 4, (1152, 6)).astype(float)
    x, X = wide[::2, 0], wide[::2, ::2]
    assert not x.flags.c_contiguous and not X.flags.c_contiguous
    true, block = A @ x.copy(), A @ X.copy()
    for form in (x, x.astype(np.float32), x.astype(np.int16), x.tolist(), x.astype(">f8"), x[::-1].copy()[::-1]):
        assert np.array_equal(A @ form, true)
        assert np.array_equal(A.matvec(form), true)
    assert np.array_equal(A @ x[:, None], true[:, None])
    for form in (X, np.asfortranarray(X), X.astype(np.float32), X.astype(int)):
        assert np.array_equal(A @ form, block)


def test_a_block_has_the_bits_of_single_products(zigzag):
    A = zigzag.operator("full")
    X = np.random.default_rng(0).standard_normal((576, 9))
    assert np.array_equal(A @ X, np.stack([A @ X[:, k] for k in range(9)], axis=1))


def test_rectangular_matrices_have_a_transpose_of_their_own(rectangular):
    A = krylux.open(rectangular).operator()
    x, y = np.ones(30), np.arange(20.0)
    assert A.shape == (20, 30) and A.T.shape == (30, 20) and not A.is_symmetric
    assert relative(A @ x, rectangular @ x) < ROUNDING
    assert relative(A.T @ y, rectangular.T @ y) < ROUNDING
    assert relative(A.T @ np.eye(20), rectangular.T.toarray()) < ROUNDING
    assert A.T.T is A and A.T.photos == A.photos == 22


def test_eigsh_svds_and_lobpcg_find_the_dense_spectrum(zigzag, dense):
    A = zigzag.operator("global")
    true = scipy.linalg.eigvalsh(dense)[::-1]
    # ARPACK ends at the rounding of its own sums.
    assert np.allclose(sparse_linalg.eigsh(A, k=3, which="LA")[0][::-1], true[:3], rtol=1e-9)
    singular = np.linalg.svd(dense, compute_uv=False)
    assert np.allclose(np.sort(sparse_linalg.svds(A, k=3)[1])[::-1], singular[:3], rtol=1e-9)
    start = np.random.default_rng(2).standard_normal((len(dense), 6))
    values, _ = sparse_linalg.lobpcg(A, start, largest=True, tol=1e-8, maxiter=400)
    # An eigenvalue's error is about the square of the residual, 1e-8, over the gap to the next.
    assert np.allclose(np.sort(values)[::-1][:3], true[:3], rtol=1e-7)


@pytest.mark.parametrize("name", ["minres", "gmres", "lsqr"])
def test_linear_solvers_find_the_dense_solution(zigzag, dense, rhs, name):
    shift = 1.0
    A = Shifted(zigzag.operator("global"), shift)
    true = np.linalg.solve(dense + shift * np.eye(len(dense)), rhs)
    options = {"lsqr": {"atol": 1e-14, "btol": 1e-14}}.get(name, {"rtol": 1e-12})
    found = getattr(sparse_linalg, name)(A, rhs, **options)[0]
    # The condition number of the shifted matrix is below 2; the solvers' own stopping rules leave 1e-8.
    assert relative(found, true) < 1e-8


def test_pylops_composes_with_it_and_its_dot_test_passes(zigzag):
    pylops = pytest.importorskip("pylops")
    A = pylops.aslinearoperator(zigzag.operator("full"))
    n = A.shape[1]
    composed = pylops.Diagonal(np.linspace(1, 2, n)) @ A @ pylops.FirstDerivative(n)
    assert pylops.utils.dottest(composed, n, n, rtol=1e-9)
    both = pylops.VStack([A, 2 * A])
    assert pylops.utils.dottest(both, 2 * n, n, rtol=1e-9)


def test_lanczos_by_hand_gives_the_eigenvalues_of_krylux(zigzag):
    A, q = zigzag.operator("global"), np.ones(576) / 24
    basis, alphas, betas = [q], [], []
    for _ in range(40):
        w = A @ basis[-1]
        alphas.append(w @ basis[-1])
        for vector in basis + basis:
            w = w - (w @ vector) * vector
        betas.append(np.linalg.norm(w))
        basis.append(w / betas[-1])
    found = scipy.linalg.eigh_tridiagonal(alphas, betas[:-1], eigvals_only=True)[-1]
    assert abs(found - zigzag.eigs(1, part="global", photos=80, tolerance=1e-8).values[0]) < 1e-9


def test_on_a_rig_each_product_is_a_photo(ideal_rig, tmp_path):
    with krylux.open(ideal_rig, size=12, spp=16, folder=tmp_path / "run", progress=False) as lab:
        A = lab.operator("full")
        values, _ = sparse_linalg.eigsh(A, k=1, ncv=8)
        taken = A.photos
        assert taken >= 8 and lab.costs["effort"]["taken"] >= taken
        mine = lab.eigs(1, photos=30).values[0]
        # The photos of the ideal rig are rounded to 16 bits: a relative error of about 1e-4 of signed patterns.
        assert values[0] == pytest.approx(mine, rel=2e-3)
