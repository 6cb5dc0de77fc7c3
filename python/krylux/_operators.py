"""Operators of Python, as the native solvers call them."""

import numpy as np

from . import _checks, _progress


def describe(A, symmetric=None, progress=False, *, trusts=False):
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
            "block": block, "progress": _progress.choose(progress), "log": _progress.log}


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


def preconditioner(M, n):
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
