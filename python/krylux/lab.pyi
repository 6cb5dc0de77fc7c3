from collections.abc import Callable
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from ._rigs import OnRigs
from .operator import LabOperator
from .rig import ProgramRig

class Lab(OnRigs):
    kind: Literal["scene", "rig", "run", "matrix"]
    name: str
    shape: tuple[int, int]
    projector_shape: tuple[int, int]
    channels: int
    unit: str
    seed: int
    def __init__(self, source: Any, options: dict[str, Any]) -> None: ...
    @overload
    def photo(self, pattern: ArrayLike, *, with_error: Literal[False] = False) -> NDArray[np.float32]: ...
    @overload
    def photo(
        self, pattern: ArrayLike, *, with_error: Literal[True]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]: ...
    @property
    def white(self) -> NDArray[np.float32]: ...
    @property
    def ambient(self) -> NDArray[np.float32]: ...
    @property
    def noise(self) -> dict[str, Any] | None: ...
    @property
    def is_symmetric(self) -> bool: ...
    @property
    def is_simulated(self) -> bool: ...
    @property
    def costs(self) -> dict[str, Any] | None: ...
    def product_noise(self, part: str = "full") -> float | None: ...
    def labels(self) -> NDArray[np.uint8]: ...
    def truth(self) -> tuple[NDArray[np.uint8], list[str]] | None: ...
    def matrix(self, part: Literal["full", "direct", "global"] = "full", *, channel: int = 0) -> csr_array[np.float64]: ...
    def operator(self, part: Literal["full", "direct", "global"] = "full", *, channel: int = 0) -> LabOperator: ...
    @property
    def folder(self) -> Path | None: ...
    def close(self) -> None: ...
    @property
    def is_closed(self) -> bool: ...
    def __enter__(self) -> Self: ...
    def __exit__(
        self, *_: type[BaseException] | BaseException | TracebackType | None
    ) -> None: ...

def open(
    source: str | PathLike[str] | ArrayLike | ProgramRig | Any,
    *,
    size: int | tuple[int, int] | None = None,
    projector_size: int | tuple[int, int] | None = None,
    spp: int | None = None,
    max_bounces: int | None = None,
    seed: int | None = None,
    sampler: Literal["sobol", "independent"] | None = None,
    russian_roulette: bool = False,
    channels: Literal["luma", "rgb", "native"] = "luma",
    camera: str | None = None,
    camera_file: str | PathLike[str] | None = None,
    auto_camera: bool = False,
    strict: bool = False,
    allow_programs: bool = False,
    adapter: str | None = None,
    cache: str | PathLike[str] | bool | None = None,
    operator: Literal["auto", "replay", "retrace"] = "auto",
    products: Literal["auto", "cpu", "device"] = "auto",
    memory: int | None = None,
    split_bounces: bool = False,
    folder: str | PathLike[str] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool | Callable[[str, int, int, str], object] | None = None,
    name: str | None = None,
) -> Lab: ...
