from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

from ._krylux import Operator

class LabOperator(LinearOperator[np.float64]):
    part: str
    channel: int
    photo_shape: tuple[int, int]
    pattern_shape: tuple[int, int]
    is_symmetric: bool
    def __init__(
        self,
        native: Operator,
        part: str,
        channel: int,
        photo_shape: tuple[int, int],
        pattern_shape: tuple[int, int],
    ) -> None: ...
    def __matmul__(self, x: Any) -> Any: ...
    @property
    def photos(self) -> int: ...
    @property
    def standard_errors(self) -> NDArray[np.float64]: ...
