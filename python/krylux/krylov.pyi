from collections.abc import Callable
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import answers

__all__ = [
    "bicgstab", "cg", "cgs", "eigs", "fgmres", "fista", "gmres", "jacobi", "krylov_box", "lsmr", "lsqr", "minres",
    "mrnsd", "multiplicative", "solve", "svd", "trace",
]

class _Operator(Protocol):
    @property
    def shape(self) -> tuple[int, ...]: ...
    def __matmul__(self, x: Any, /) -> Any: ...

_Progress = bool | Callable[[str, int, int, str], object] | None

def solve(
    method: str,
    A: _Operator,
    b: ArrayLike,
    *,
    products: int = 50,
    rtol: float = 1e-6,
    atol: float = 0.0,
    noise: float = 0.0,
    x0: ArrayLike | None = None,
    M: Any = None,
    side: Literal["right", "left"] = "right",
    restart: int | None = None,
    lower: float = 0.0,
    upper: float = 1.0,
    diagonal: ArrayLike | None = None,
    symmetric: bool | None = None,
    progress: _Progress = False,
) -> answers.Solution: ...
def minres(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def gmres(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def fgmres(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def cg(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def cgs(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def bicgstab(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def lsqr(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def lsmr(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def jacobi(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def fista(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def krylov_box(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def mrnsd(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def multiplicative(A: _Operator, b: ArrayLike, **options: Any) -> answers.Solution: ...
def eigs(
    A: _Operator,
    count: int = 6,
    *,
    which: Literal["la", "sa", "lm", "sm", "be", "li"] = "la",
    products: int = 50,
    tolerance: float | None = None,
    method: Literal["lanczos", "block-lanczos", "arnoldi", "power"] | None = None,
    block: int = 2,
    max_basis: int | None = None,
    noise: float = 0.0,
    seed: int = 0,
    start: ArrayLike | None = None,
    deflate: ArrayLike | None = None,
    confirm: float | None = None,
    symmetric: bool | None = None,
    progress: _Progress = False,
) -> answers.Eigenpairs: ...
def trace(
    A: _Operator,
    *,
    products: int = 50,
    seed: int = 0,
    method: Literal["hutch++", "hutchinson"] = "hutch++",
    symmetric: bool | None = None,
) -> tuple[float, float, int]: ...
def svd(
    A: _Operator,
    rank: int = 10,
    *,
    oversampling: int = 10,
    iterations: int = 0,
    seed: int = 0,
    symmetric: bool | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...
