"""The light transport of a laboratory as a linear operator of SciPy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

from . import _checks, _krylux

if TYPE_CHECKING:
    _LinearOperator = LinearOperator[np.float64]
else:
    _LinearOperator = LinearOperator

_FLOAT64 = np.dtype(np.float64)


class LabOperator(_LinearOperator):
    """One part and channel of a light transport matrix: ``y = A x``, each product one photo.

    It is a :class:`scipy.sparse.linalg.LinearOperator`, so that everything that takes one works with it. On a scene a
    product is a product with the traced matrix; on a rig it is a photo (two where a signed vector is split), which is
    in the journal of the run before it is returned. It stays valid after its laboratory is closed. Operators of one
    laboratory take turns, and threads may share one.

    Obtain one by :meth:`krylux.Lab.operator`.

    Attributes:
        shape: ``(pixels of a photo, pixels of a pattern)``.
        dtype: ``float64``.
        part: ``"full"``, ``"direct"`` or ``"global"`` light.
        channel: The channel, from 0.
        is_symmetric: Whether ``A = Aᵀ``, as for a coaxial rig.
        photo_shape, pattern_shape: ``(height, width)`` of photos and of patterns, as vectors are flattened row by row.
    """

    def __init__(self, native: _krylux.Operator, part: str, channel: int, photo_shape: tuple[int, int],
                 pattern_shape: tuple[int, int]) -> None:
        self._native = native
        self.part, self.channel = part, channel
        self.photo_shape, self.pattern_shape = photo_shape, pattern_shape
        self.is_symmetric = native.is_symmetric
        super().__init__(np.dtype(np.float64), native.shape)  # type: ignore[call-arg]

    @property
    def photos(self) -> int:
        """The number of products so far, those with the transpose among them."""
        return self._native.photos()

    @property
    def standard_errors(self) -> NDArray[np.float64]:
        """The expected error ``‖y − A x‖₂`` of each product of the last call, ``float64[k]``; empty where it is not known."""
        return self._native.standard_errors()

    # To type checkers, the product is that of SciPy's operators: float64 of arrays, and an operator of operators.
    if not TYPE_CHECKING:
        def __matmul__(self, x):
            # Most products are of plain vectors. SciPy would look at them several times on the way.
            if type(x) is np.ndarray and x.ndim == 1 and x.dtype is _FLOAT64 and x.size == self.shape[1]:
                return self._native.product(x, False)
            return super().__matmul__(x)

    def _matvec(self, x):
        return self._native.product(_vector(x, "x", self.shape[1]), False)

    def _rmatvec(self, y):
        return self._native.product(_vector(y, "y", self.shape[0]), True)

    def _matmat(self, X):
        return self._block(X, "X", False)

    def _rmatmat(self, Y):
        return self._block(Y, "Y", True)

    def _block(self, columns, option, adjoint):
        # One vector in each row: a block of krylux, whose products share one pass over the matrix.
        columns = np.asarray(columns)
        if columns.dtype is not _FLOAT64:
            columns = _checks.real_array(columns, option, np.float64)
        rows = np.ascontiguousarray(columns.T)
        return self._native.products(rows, adjoint).T

    def _adjoint(self):
        return self if self.is_symmetric else _Transposed(self)

    def _transpose(self):
        # The matrix is real.
        return self._adjoint()

    def __reduce__(self):
        raise TypeError(
            "an operator stands for devices or a device's memory, which no other process has\n"
            "  help: pickle the laboratory, or its matrix(), and call operator() there"
        )

    def __repr__(self):
        rows, cols = self.shape
        symmetric = ", symmetric" if self.is_symmetric else ""
        return f"<LabOperator of {rows}×{cols}: {self.part} light, channel {self.channel}{symmetric}; {self.photos} photos>"


def _vector(x, option, length):
    """A contiguous vector in double precision; most vectors are one already, and then nothing is looked at twice."""
    if type(x) is np.ndarray and x.dtype is _FLOAT64 and x.size == length:
        return x.ravel()
    return _checks.vector(x, option, length)


class _Transposed(_LinearOperator):
    """The transpose of a laboratory's operator; its products are counted there."""

    def __init__(self, of):
        self._of = of
        super().__init__(of.dtype, of.shape[::-1])

    @property
    def photos(self):
        """The number of products of the operator that this is the transpose of."""
        return self._of.photos

    def _matvec(self, x):
        return self._of._rmatvec(x)

    def _rmatvec(self, y):
        return self._of._matvec(y)

    def _matmat(self, X):
        return self._of._rmatmat(X)

    def _rmatmat(self, Y):
        return self._of._matmat(Y)

    def _adjoint(self):
        return self._of

    def _transpose(self):
        return self._of
