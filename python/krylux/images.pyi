from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

class Similarity:
    rmse: float
    relative_rmse: float
    largest: float
    psnr: float
    ssim: float | None
    range: float
    difference: NDArray[np.float32]
    def __init__(self, fields: dict[str, Any]) -> None: ...

def compare(
    a: ArrayLike | str | PathLike[str], b: ArrayLike | str | PathLike[str], *, range: float | None = None
) -> Similarity: ...
