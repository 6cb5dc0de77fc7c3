"""krylux's own Krylov methods on any operator: a matrix, a ``LinearOperator``, anything with ``@``.

A product may be a photo, so that the cost of a method is its number of products, and that is what each method limits.
The methods stop where noise would be fitted, keep bounds where they are told to, and return their best so far.
"""

from __future__ import annotations

from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _checks, _krylux, _progress, answers
from ._declared import asked

__all__ = [
    "bicgstab", "cg", "cgs", "eigs", "fgmres", "fista", "gmres", "jacobi", "krylov_box", "lsmr", "lsqr", "minres",
    "mrnsd", "multiplicative", "solve", "svd", "trace",
]


class _Operator(Protocol):
    @property
    def shape(self) -> tuple[int, ...]: ...
    def __matmul__(self, x: Any, /) -> Any: ...


class _Solver(Protocol):
    def __call__(self, A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...


def solve(
    method: str, A: _Operator, b: ArrayLike, *, products: int = 50, rtol: float = 1e-6, atol: float = 0.0,
    noise: float = 0.0, x0: ArrayLike | None = None, M: Any = None, side: Literal["right", "left"] = "right",
    restart: int | None = None, lower: float = 0.0, upper: float = 1.0, diagonal: ArrayLike | None = None,
    symmetric: bool | None = None, progress: _progress.Progress = False,
) -> answers.Solution:
    """Solves ``A x = b`` within a budget of products.

    Args:
        method: ``"minres"``, ``"gmres"``, ``"fgmres"``, ``"cg"``, ``"cgs"``, ``"bicgstab"``, ``"lsqr"``, ``"lsmr"``;
            inside a box ``"krylov-box"``, ``"fista"``, ``"jacobi"``; not negative ``"mrnsd"``, ``"multiplicative"``.
        A: ``[m, n]``: anything with ``shape`` and ``@``; also ``T`` where the method takes products with the transpose.
        b: ``[m]``.
        products: The most products, with ``A`` and ``Aᵀ`` together.
        rtol, atol: Done when ``‖b − A x‖ ≤ rtol ‖b‖ + atol``.
        noise: The relative noise of a product: steps below it would fit noise, so that the method stops there.
        x0: ``[n]``: the first iterate.
        M: The preconditioner ``M⁻¹``: a vector to multiply by, something with ``@``, or a function of a vector. It is
            taken for positive definite.
        side: ``"right"`` or ``"left"``, for GMRES.
        restart: Products after which GMRES restarts.
        lower, upper: The box.
        diagonal: ``A 1``, where it is known already, for the methods with bounds.
        symmetric: Whether ``A = Aᵀ``, for a square ``A``. Default: known of matrices and of krylux's operators; of
            others it is assumed by ``"minres"`` and ``"cg"``, which are for such operators only, and not by other
            methods.
        progress: As in :func:`krylux.open`; silent by default.

    Raises:
        krylux.errors.OptionError, krylux.errors.NumericalError: An argument cannot be used; a product holds NaN, or the
            method needs a symmetric operator.
        Exception: Whatever ``A`` raises comes out unchanged.
    """
    described = _described(A, symmetric, progress, trusts=method in ("minres", "cg"))
    m, n = described["shape"]
    divide_by, function = _preconditioner(M, n)
    question = {
        "products": _checks.count(products, "products"),
        "rtol": _checks.finite(rtol, "rtol", 0.0),
        "atol": _checks.finite(atol, "atol", 0.0),
        "noise": _checks.finite(noise, "noise", 0.0),
        "x0": _checks.maybe(_checks.vector, x0, "x0", n),
        "divide_by": divide_by,
        "preconditioner": function,
        "side": side,
        "restart": _checks.maybe(_checks.count, restart, "restart"),
        "lower": _checks.finite(lower, "lower"),
        "upper": _checks.finite(upper, "upper"),
        "diagonal": _checks.maybe(_checks.vector, diagonal, "diagonal", n),
    }
    return answers.Solution(*_krylux.solve(method, described, _checks.vector(b, "b", m), question))


def _named(method: str, about: str) -> _Solver:
    def solver(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution:
        return solve(method, A, b, **options)

    solver.__name__ = solver.__qualname__ = method.replace("-", "_")
    solver.__doc__ = f"""Solves ``A x = b`` by {about}

    Args:
        A: ``[m, n]``: anything with ``shape`` and ``@``.
        b: ``[m]``.
        **options: As those of :func:`solve`.
    """
    return solver


minres = _named("minres", "MINRES: symmetric ``A``, the residual norm never grows.")
gmres = _named("gmres", "GMRES: any square ``A``, the least residual in the subspace.")
fgmres = _named("fgmres", "flexible GMRES, whose preconditioner may change from step to step.")
cg = _named("cg", "conjugate gradients: symmetric positive definite ``A``.")
cgs = _named("cgs", "conjugate gradients squared: any square ``A``, two products a step.")
bicgstab = _named("bicgstab", "BiCGStab: any square ``A``, two products a step.")
lsqr = _named("lsqr", "LSQR: any ``A``, least squares; takes products with the transpose.")
lsmr = _named("lsmr", "LSMR: any ``A``, least squares; takes products with the transpose.")
jacobi = _named("jacobi", "projected Jacobi iteration, inside the box.")
fista = _named("fista", "FISTA, inside the box; takes products with the transpose.")
krylov_box = _named("krylov-box", "the box-constrained Krylov method of this laboratory: as few photos as possible.")
mrnsd = _named("mrnsd", "modified residual norm steepest descent: a solution that is not negative.")
multiplicative = _named("multiplicative", "multiplicative updates: a solution that is not negative.")


def eigs(
    A: _Operator, count: int = 6, *, which: Literal["la", "sa", "lm", "sm", "be", "li"] = "la", products: int = 50,
    tolerance: float | None = None, method: Literal["lanczos", "block-lanczos", "arnoldi", "power"] | None = None,
    block: int = 2, max_basis: int | None = None, noise: float = 0.0, seed: int = 0, start: ArrayLike | None = None,
    deflate: ArrayLike | None = None, confirm: float | None = None, symmetric: bool | None = None,
    progress: _progress.Progress = False,
) -> answers.Eigenpairs:
    """Computes a few eigenpairs within a budget of products.

    Args:
        A: ``[n, n]``: anything with ``shape`` and ``@``.
        count: How many.
        which: ``"la"``, ``"sa"``, ``"lm"``, ``"sm"``, ``"be"`` or ``"li"``, as in ARPACK.
        products: The most products.
        tolerance: Done when each residual norm is at most this share of the norm of ``A``. Default 1e-8.
        method: ``"lanczos"`` (the default of a symmetric ``A``), ``"block-lanczos"``, ``"arnoldi"`` (of any other) or
            ``"power"``.
        block: Vectors in the block of ``"block-lanczos"``.
        max_basis: The most basis vectors to keep, by restarts.
        noise: The norm of the error of a product with a vector of norm 1.
        seed: The starting vector is drawn with this seed, unless there is a ``start``.
        start: ``[n]``: the starting vector.
        deflate: ``[n, j]``: known eigenvectors as columns, which are projected out.
        confirm: Confirm by further products that no eigenvalue was missed that lies beyond the last one by more than
            this share of the spectrum's spread.
        symmetric: As in :func:`solve`.
        progress: As in :func:`krylux.open`; silent by default.

    References: O'Toole and Kutulakos, section 4.
    """
    described = _described(A, symmetric, progress)
    m, n = described["shape"]
    if m != n:
        raise _checks.refuse("A", f"it has {m} rows and {n} columns", "give a square operator")
    if method is None:
        method = "lanczos" if described["symmetric"] else "arnoldi"
    known = [] if deflate is None else [_checks.vector(one, "deflate", n) for one in np.asarray(deflate).T]
    first = _checks.maybe(_checks.vector, start, "start", n)
    _checks.vectors(block, "block", n)
    question = {"count": _checks.count(count, "count"), "which": which, "photos": _checks.count(products, "products"),
                "tolerance": tolerance, "method": method, "block": block, "max_basis": max_basis, "confirm": confirm}
    beside = (_checks.count(seed, "seed", 0, 2**64 - 1), _checks.finite(noise, "noise", 0.0), first, known)
    return answers.Eigenpairs(*_krylux.eigs(described, asked(question), beside))


def trace(
    A: _Operator, *, products: int = 50, seed: int = 0, method: Literal["hutch++", "hutchinson"] = "hutch++",
    symmetric: bool | None = None,
) -> tuple[float, float, int]:
    """Estimates the trace of a square operator.

    Args:
        A: ``[n, n]``.
        products: Products to take.
        seed: Seed of the random vectors.
        method: ``"hutch++"`` or ``"hutchinson"``.
        symmetric: As in :func:`solve`.

    Returns:
        value, standard_error: The estimate, which is unbiased, and its standard error.
        products: Products that it took.
    """
    described = _described(A, symmetric)
    products = _checks.vectors(products, "products", described["shape"][1])
    return _krylux.trace(described, products, _checks.count(seed, "seed", 0, 2**64 - 1), method)


def svd(
    A: _Operator, rank: int = 10, *, oversampling: int = 10, iterations: int = 0, seed: int = 0,
    symmetric: bool | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Computes the largest singular values and their vectors from random products.

    Args:
        A: ``[m, n]``, with ``T`` unless it is symmetric.
        rank: How many.
        oversampling: Vectors of the sketch beyond the rank.
        iterations: Rounds of subspace iteration, for singular values that decay slowly.
        seed: Seed of the random vectors.
        symmetric: As in :func:`solve`.

    Returns: ``U``, ``s`` and ``Vt``: ``float64[m, k]``, ``[k]`` and ``[k, n]``, as of :func:`scipy.sparse.linalg.svds`, the largest first.

    References: Halko, Martinsson and Tropp, *Finding structure with randomness* (2011), doi:10.1137/090771806.
    """
    described = _described(A, symmetric)
    oversampling = _checks.count(oversampling, "oversampling", 0)
    _checks.vectors(min(_checks.count(rank, "rank") + oversampling, max(*described["shape"], 1)), "rank",
                    max(described["shape"]))
    question = (rank, oversampling, _checks.count(iterations, "iterations", 0),
                _checks.count(seed, "seed", 0, 2**64 - 1))
    left, values, right = _krylux.svd(described, question)
    return left.T, values, right


def _described(A: Any, symmetric: bool | None, progress: _progress.Progress = False, *, trusts: bool = False) -> dict[str, Any]:
    """An operator as the native part calls it: ``product(rows, adjoint)`` returns rows.

    ``trusts``: an operator of which nothing is known is taken for symmetric, because the method is for such ones.
    """
    shape = getattr(A, "shape", None)
    if shape is None or len(shape) != 2 or not hasattr(A, "__matmul__"):
        raise _checks.refuse("A", f"{type(A).__name__} is no operator", "give something with `shape` and `@`")
    if symmetric is None:
        symmetric = _is_symmetric(A)
        symmetric = trusts if symmetric is None else symmetric
    rows, cols = _shape(shape)
    if symmetric and rows != cols:
        fault = f"A has {rows} rows and {cols} columns, and is not symmetric"
        raise _checks.refuse("symmetric", fault, "leave it out, or use lsqr or lsmr")
    transposed = None

    def product(rows, adjoint):
        nonlocal transposed
        matrix = A
        if adjoint:
            if transposed is None:
                transposed = _transpose(A)
            matrix = transposed
        taken = [matrix @ rows[0]] if len(rows) == 1 else (matrix @ rows.T).T
        length = matrix.shape[0]
        answer = _checks.real_array(taken, "A", np.float64)
        if answer.size != len(rows) * length:
            raise _checks.refuse("A", f"its product has the shape {np.shape(taken)}", f"return {length} entries for each vector")
        return answer.reshape(len(rows), length)

    # Products of a matrix in memory share one pass over it. Any other product may be a photo, which is not taken before it
    # is needed.
    block = 8 if isinstance(A, np.ndarray) or hasattr(A, "tocsr") else 1
    return {"product": product, "shape": (rows, cols), "symmetric": bool(symmetric),
            "block": block, "progress": _progress.choose(progress)}


def _shape(shape):
    """Rows and columns, of which a vector has to fit into memory: an operator may claim any shape."""
    rows, cols = (_checks.count(side, "A", 0, 2**128) for side in shape)
    try:
        np.empty(max(rows, cols))
    except (MemoryError, ValueError) as error:
        fault = f"it has {rows} rows and {cols} columns, and no vector of that length fits into memory"
        raise _checks.refuse("A", fault, "give an operator whose `shape` is that of its matrix") from error
    return rows, cols


def _is_symmetric(A):
    """Whether ``A = Aᵀ``, where that is cheap to know; otherwise ``None``."""
    from .operator import LabOperator

    if isinstance(A, LabOperator):
        return A.is_symmetric
    if A.shape[0] != A.shape[1]:
        return False
    if isinstance(A, np.ndarray):
        return bool((A == A.T).all())
    if hasattr(A, "tocsr"):
        difference = A - A.T
        return difference.nnz == 0 or not np.any(difference.data)
    return None


def _transpose(A):
    for name in ("T", "H"):
        transposed = getattr(A, name, None)
        if transposed is not None:
            return transposed
    raise _checks.refuse("A", "the method needs the transpose, which it does not have",
                         "give it a `T`, say symmetric=True, or use gmres")


def _preconditioner(M, n):
    """``(a diagonal to divide by, a function of a vector)``, one of which is nothing."""
    if M is None:
        return None, None
    if hasattr(M, "shape") and len(M.shape) == 2:
        return None, lambda r: _checks.vector(M @ r, "M", n)
    if callable(M):
        return None, lambda r: _checks.vector(M(r), "M", n)
    inverse = _checks.vector(M, "M", n)
    if not (inverse > 0).all():
        raise _checks.refuse("M", "some of its entries are not positive", "give a positive vector")
    return 1 / inverse, None
