import builtins
from collections.abc import Generator, Mapping, Sequence
from os import PathLike
from types import SimpleNamespace
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

class _Projector(Protocol):
    @property
    def size(self) -> int | tuple[int, int]: ...
    def show(self, levels: NDArray[np.uint16], /) -> object: ...

class _Camera(Protocol):
    @property
    def size(self) -> int | tuple[int, int]: ...
    @property
    def exposures(self) -> Sequence[float]: ...
    def configure(self, exposure: float, /) -> float | None: ...
    def capture(self) -> NDArray[Any] | tuple[NDArray[Any], float] | None: ...

class ProgramRig:
    projector: _Projector
    camera: _Camera
    measurement: dict[str, Any]
    calibration: str | None
    def __init__(
        self,
        projector: _Projector,
        camera: _Camera,
        *,
        measurement: Mapping[str, Any] | None = None,
        calibration: str | PathLike[str] | None = None,
    ) -> None: ...

class Report(SimpleNamespace):
    def __init__(self, fields: dict[str, Any]) -> None: ...

def calibrate(
    source: str | PathLike[str] | ProgramRig,
    folder: str | PathLike[str] | None = None,
    *,
    takes: int = 2,
    map: Literal["gray-code", "checkerboard"] | None = None,
    overwrite: bool = False,
    resume: bool = False,
    **options: Any,
) -> Report: ...
def flat_field(source: str | PathLike[str], **options: Any) -> Report: ...
def check(
    source: str | PathLike[str] | ProgramRig, folder: str | PathLike[str] = "out", **options: Any
) -> Report: ...
def align(
    source: str | PathLike[str] | ProgramRig,
    *,
    rounds: int = 1,
    patterns: int = 6,
    asymmetry: float = 0.1,
    exposure: float | None = None,
    **options: Any,
) -> builtins.list[Report]: ...
def preview(
    source: str | PathLike[str] | ProgramRig,
    pattern: ArrayLike | None = None,
    *,
    frames: int | None = None,
    exposure: float | None = None,
    **options: Any,
) -> Generator[Report]: ...
def list(source: str | PathLike[str] | None = None, *, display: str | None = None) -> Report: ...
