"""krylux's own Krylov methods on any operator: a matrix, a ``LinearOperator``, anything with ``@``.

A product may be a photo, so that the cost of a method is its number of products, and that is what each method limits.
The methods stop where noise would be fitted, keep bounds where they are told to, and return their best so far.
"""

import numpy as np

from . import _checks, _krylux, answers
from ._declared import asked
from ._operators import describe, preconditioner

__all__ = [
    "bicgstab", "cg", "cgs", "eigs", "fgmres", "fista", "gmres", "jacobi", "krylov_box", "lsmr", "lsqr", "minres",
    "mrnsd", "multiplicative", "solve", "svd", "trace",
]


def solve(method, A, b, *, products=50, rtol=1e-6, atol=0.0, noise=0.0, x0=None, M=None, side="right", restart=None,
          lower=0.0, upper=1.0, diagonal=None, symmetric=None, progress=False):
    """Solves ``A x = b`` within a budget of products.

    Parameters
    ----------
    method : str
        ``"minres"``, ``"gmres"``, ``"fgmres"``, ``"cg"``, ``"cgs"``, ``"bicgstab"``, ``"lsqr"``, ``"lsmr"``; inside a box
        ``"krylov-box"``, ``"fista"``, ``"jacobi"``; not negative ``"mrnsd"``, ``"multiplicative"``.
    A : operator
        ``[m, n]``: anything with ``shape`` and ``@``; also ``T`` where the method takes products with the transpose.
    b : array_like
        ``[m]``.
    products : int
        The most products, with ``A`` and ``Aᵀ`` together.
    rtol, atol : float
        Done when ``‖b − A x‖ ≤ rtol ‖b‖ + atol``.
    noise : float
        The relative noise of a product: steps below it would fit noise, so that the method stops there.
    x0 : array_like, optional
        ``[n]``: the first iterate.
    M : array_like, operator or callable, optional
        The preconditioner ``M⁻¹``: a vector to multiply by, something with ``@``, or a function of a vector. It is taken
        for positive definite.
    side : str
        ``"right"`` or ``"left"``, for GMRES.
    restart : int, optional
        Products after which GMRES restarts.
    lower, upper : float
        The box.
    diagonal : array_like, optional
        ``A 1``, where it is known already, for the methods with bounds.
    symmetric : bool, optional
        Whether ``A = Aᵀ``, for a square ``A``. Default: known of matrices and of krylux's operators; of others it is assumed by ``"minres"``
        and ``"cg"``, which are for such operators only, and not by other methods.
    progress : bool or callable
        As in :func:`krylux.open`; silent by default.

    Returns
    -------
    krylux.answers.Solution

    Raises
    ------
    krylux.errors.OptionError, krylux.errors.NumericalError
        An argument cannot be used; a product holds NaN, or the method needs a symmetric operator.
    Exception
        Whatever ``A`` raises comes out unchanged.
    """
    described = describe(A, symmetric, progress, trusts=method in ("minres", "cg"))
    m, n = described["shape"]
    divide_by, function = preconditioner(M, n)
    question = {
        "products": _checks.count(products, "products"),
        "rtol": _checks.finite(rtol, "rtol", 0.0),
        "atol": _checks.finite(atol, "atol", 0.0),
        "noise": _checks.finite(noise, "noise", 0.0),
        "x0": None if x0 is None else _checks.vector(x0, "x0", n),
        "divide_by": divide_by,
        "preconditioner": function,
        "side": side,
        "restart": None if restart is None else _checks.count(restart, "restart"),
        "lower": _checks.finite(lower, "lower"),
        "upper": _checks.finite(upper, "upper"),
        "diagonal": None if diagonal is None else _checks.vector(diagonal, "diagonal", n),
    }
    return answers.Solution(*_krylux.solve(method, described, _checks.vector(b, "b", m), question))


def _named(method, about):
    def solver(A, b, **options):
        return solve(method, A, b, **options)

    name = method.replace("-", "_")
    solver.__name__ = solver.__qualname__ = name
    solver.__doc__ = (
        f"Solves ``A x = b`` by {about}\n\n    Parameters\n    ----------\n    A : operator\n        ``[m, n]``: anything"
        " with ``shape`` and ``@``.\n    b : array_like\n        ``[m]``.\n    **options\n        As those of"
        " :func:`solve`.\n\n    Returns\n    -------\n    krylux.answers.Solution\n"
    )
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


def eigs(A, count=6, *, which="la", products=50, tolerance=None, method=None, block=2, max_basis=None, noise=0.0,
         seed=0, start=None, deflate=None, confirm=None, symmetric=None, progress=False):
    """Computes a few eigenpairs within a budget of products.

    Parameters
    ----------
    A : operator
        ``[n, n]``: anything with ``shape`` and ``@``.
    count : int
        How many.
    which : str
        ``"la"``, ``"sa"``, ``"lm"``, ``"sm"``, ``"be"`` or ``"li"``, as in ARPACK.
    products : int
        The most products.
    tolerance : float, optional
        Done when each residual norm is at most this share of the norm of ``A``. Default 1e-8.
    method : str, optional
        ``"lanczos"`` (the default of a symmetric ``A``), ``"block-lanczos"``, ``"arnoldi"`` (of any other) or ``"power"``.
    block : int
        Vectors in the block of ``"block-lanczos"``.
    max_basis : int, optional
        The most basis vectors to keep, by restarts.
    noise : float
        The norm of the error of a product with a vector of norm 1.
    seed : int
        The starting vector is drawn with this seed, unless there is a ``start``.
    start : array_like, optional
        ``[n]``: the starting vector.
    deflate : array_like, optional
        ``[n, j]``: known eigenvectors as columns, which are projected out.
    confirm : float, optional
        Confirm by further products that no eigenvalue was missed that lies beyond the last one by more than this share of the
        spectrum's spread.
    symmetric : bool, optional
        As in :func:`solve`.
    progress : bool or callable
        As in :func:`krylux.open`; silent by default.

    Returns
    -------
    krylux.answers.Eigenpairs

    References
    ----------
    O'Toole and Kutulakos, section 3.
    """
    described = describe(A, symmetric, progress)
    m, n = described["shape"]
    if m != n:
        raise _checks.refuse("A", f"it has {m} rows and {n} columns", "give a square operator")
    if method is None:
        method = "lanczos" if described["symmetric"] else "arnoldi"
    known = [] if deflate is None else [_checks.vector(one, "deflate", n) for one in np.asarray(deflate).T]
    start = None if start is None else _checks.vector(start, "start", n)
    _checks.vectors(block, "block", n)
    question = {"count": _checks.count(count, "count"), "which": which, "photos": _checks.count(products, "products"),
                "tolerance": tolerance, "method": method, "block": block, "max_basis": max_basis, "confirm": confirm}
    beside = (_checks.count(seed, "seed", 0, 2**64 - 1), _checks.finite(noise, "noise", 0.0), start, known)
    return answers.Eigenpairs(*_krylux.eigs(described, asked(question), beside))


def trace(A, *, products=50, seed=0, method="hutch++", symmetric=None):
    """Estimates the trace of a square operator.

    Parameters
    ----------
    A : operator
        ``[n, n]``.
    products : int
        Products to take.
    seed : int
        Seed of the random vectors.
    method : str
        ``"hutch++"`` or ``"hutchinson"``.
    symmetric : bool, optional
        As in :func:`solve`.

    Returns
    -------
    value, standard_error : float
        The estimate, which is unbiased, and its standard error.
    products : int
        Products that it took.
    """
    described = describe(A, symmetric)
    products = _checks.vectors(products, "products", described["shape"][1])
    return _krylux.trace(described, products, _checks.count(seed, "seed", 0, 2**64 - 1), method)


def svd(A, rank=10, *, oversampling=10, iterations=0, seed=0, symmetric=None):
    """Computes the largest singular values and their vectors from random products.

    Parameters
    ----------
    A : operator
        ``[m, n]``, with ``T`` unless it is symmetric.
    rank : int
        How many.
    oversampling : int
        Vectors of the sketch beyond the rank.
    iterations : int
        Rounds of subspace iteration, for singular values that decay slowly.
    seed : int
        Seed of the random vectors.
    symmetric : bool, optional
        As in :func:`solve`.

    Returns
    -------
    U, s, Vt : numpy.ndarray
        ``float64[m, k]``, ``[k]`` and ``[k, n]``, as of :func:`scipy.sparse.linalg.svds`, the largest first.

    References
    ----------
    Halko, Martinsson and Tropp, *Finding structure with randomness* (2011), doi:10.1137/090771806.
    """
    described = describe(A, symmetric)
    oversampling = _checks.count(oversampling, "oversampling", 0)
    _checks.vectors(min(_checks.count(rank, "rank") + oversampling, max(*described["shape"], 1)), "rank",
                    max(described["shape"]))
    question = (rank, oversampling, _checks.count(iterations, "iterations", 0),
                _checks.count(seed, "seed", 0, 2**64 - 1))
    left, values, right = _krylux.svd(described, question)
    return left.T, values, right
