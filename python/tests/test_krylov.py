"""krylux's own solvers on operators of Python."""

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg as sparse_linalg

import krylux
from krylux import errors, krylov

RANDOM = np.random.default_rng(7)
SQUARE = (lambda a: a @ a.T / 40 + np.eye(40))(RANDOM.random((40, 40)))
WIDE = RANDOM.random((30, 12))


class Counting:
    """Anything with ``shape``, ``@`` and ``T``."""

    def __init__(self, matrix, of=None):
        self.matrix, self.shape, self.of = matrix, matrix.shape, of or self
        self.products = 0

    def __matmul__(self, x):
        self.of.products += 1 if x.ndim == 1 else x.shape[1]
        return self.matrix @ x

    @property
    def T(self):
        return Counting(self.matrix.T, self)


@pytest.mark.parametrize("method", ["minres", "gmres", "fgmres", "cg", "cgs", "bicgstab", "lsqr", "lsmr"])
def test_solvers_find_the_dense_solution(method):
    A, b = Counting(SQUARE), np.arange(40.0)
    found = getattr(krylov, method)(A, b, products=400, rtol=1e-10, symmetric=True)
    # The condition number is below 20.
    assert np.allclose(found.x, np.linalg.solve(SQUARE, b), rtol=1e-7, atol=1e-7), found.status
    assert found.products == A.products


@pytest.mark.parametrize("form", [np.asarray, scipy.sparse.csr_array, sparse_linalg.aslinearoperator, np.asfortranarray])
def test_operators_of_any_form_are_taken(form):
    x = krylov.lsqr(form(WIDE), WIDE @ np.ones(12), products=200, rtol=1e-12).x
    assert np.allclose(x, 1, rtol=1e-6)


@pytest.mark.parametrize("method", ["krylov_box", "jacobi", "fista"])
def test_boxes_are_kept(method):
    found = getattr(krylov, method)(SQUARE, SQUARE @ np.linspace(-0.5, 1.5, 40), products=300, lower=0.1, upper=0.9)
    assert found.x.min() >= 0.1 - 1e-15 and found.x.max() <= 0.9 + 1e-15
    clipped = np.clip(np.linspace(-0.5, 1.5, 40), 0.1, 0.9)
    b = SQUARE @ np.linspace(-0.5, 1.5, 40)
    assert found.residual <= np.linalg.norm(b - SQUARE @ clipped) / np.linalg.norm(b)


def test_eigs_of_symmetric_and_of_other_operators():
    true = np.linalg.eigvalsh(SQUARE)[::-1]
    found = krylov.eigs(Counting(SQUARE), 3, products=40, symmetric=True)
    assert np.allclose(found.values, true[:3], rtol=1e-9) and found.vectors.shape == (40, 3)
    other = krylov.eigs(RANDOM.random((10, 10)), 2, products=10)
    assert other.statuses[0] == "converged"
    rotation = krylov.eigs(np.array([[0.0, -1.0], [1.0, 0.0]]), 2, products=2)
    assert sorted(rotation.imaginary) == pytest.approx([-1, 1])
    rest = krylov.eigs(SQUARE, 1, deflate=found.vectors, products=37)
    assert rest.values[0] == pytest.approx(true[3], rel=1e-6)


def test_trace_and_svd():
    value, error, products = krylov.trace(SQUARE, products=30)
    assert abs(value - np.trace(SQUARE)) < 5 * error + 1e-9 and products <= 30
    U, s, Vt = krylov.svd(WIDE, rank=12, oversampling=0)
    assert np.allclose(U * s @ Vt, WIDE, atol=1e-9)


def test_preconditioners_are_vectors_operators_and_functions():
    diagonal = np.linspace(1, 1e4, 40)
    A, b = np.diag(diagonal) + 0.1, np.ones(40)
    plain = krylov.cg(A, b, products=200, rtol=1e-8)
    for M in (1 / diagonal, np.diag(1 / diagonal), lambda r: r / diagonal):
        found = krylov.cg(A, b, products=200, rtol=1e-8, M=M)
        assert found.products < plain.products / 2
    with pytest.raises(errors.OptionError, match="M: some of its entries are not positive"):
        krylov.cg(A, b, M=-diagonal)


def test_exceptions_of_the_operator_come_out_unchanged():
    class Broken(Counting):
        def __matmul__(self, x):
            if self.products == 3:
                raise ConnectionError("the shutter is stuck")
            return super().__matmul__(x)

    with pytest.raises(ConnectionError, match="shutter is stuck") as caught:
        krylov.minres(Broken(SQUARE), np.ones(40), symmetric=True)
    assert caught.traceback[-1].name == "__matmul__"


def test_wrong_operators_are_named():
    class Short(Counting):
        def __matmul__(self, x):
            return np.ones(3)

    cases = [
        (lambda: krylov.minres("A", np.ones(3)), "A"),
        (lambda: krylov.gmres(Short(SQUARE), np.ones(40)), "A"),
        (lambda: krylov.gmres(SQUARE * np.nan, np.ones(40)), "A"),
        (lambda: krylov.gmres(SQUARE, np.ones(39)), "b"),
        (lambda: krylov.gmres(SQUARE, np.ones(40), products=0), "products"),
        (lambda: krylov.gmres(SQUARE, np.ones(40), x0=np.ones(3)), "x0"),
        (lambda: krylov.eigs(WIDE), "A"),
        (lambda: krylov.solve("magic", SQUARE, np.ones(40)), "method"),
        (lambda: krylov.gmres(SQUARE, np.ones(40), side="up"), "side"),
    ]
    for call, option in cases:
        with pytest.raises(errors.OptionError) as caught:
            call()
        assert caught.value.option == option
    with pytest.raises(errors.NumericalError, match="symmetric"):
        krylov.minres(np.triu(SQUARE), np.ones(40))
    assert krylov.minres(Counting(SQUARE), np.ones(40)).products > 1, "an operator that nothing is known of is trusted"


def test_the_operator_of_a_laboratory_is_solved_with_too(zigzag, dense):
    A = zigzag.operator("global")
    found = krylov.eigs(A, 2, products=60)
    assert np.allclose(found.values, np.linalg.eigvalsh(dense)[::-1][:2], rtol=1e-9)
    assert A.photos == found.photos
