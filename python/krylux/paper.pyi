from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from ._krylux import Figures as _Native

class Figure:
    name: str
    title: str
    statement: str
    rig: Literal["ideal", "virtual"]
    setting: str
    checks: list[dict[str, Any]]
    met: bool
    panels: dict[str, dict[str, Any]]
    plots: list[dict[str, Any]]
    strips: list[dict[str, Any]]
    photos: int
    seconds: float
    def __init__(self, fields: dict[str, Any]) -> None: ...

class Reproduction:
    figures: list[Figure]
    met: bool
    status: str
    quick: bool
    def __init__(self, fields: dict[str, Any], native: _Native) -> None: ...
    def __getitem__(self, name: str) -> Figure: ...
    def save(self, folder: str | PathLike[str] | None = None, *, overwrite: bool = False) -> Path: ...
    def __getstate__(self) -> dict[str, Any]: ...

def reproduce(
    figures: str | Sequence[str] = "all",
    *,
    rig: Literal["ideal", "virtual", "both"] = "ideal",
    quick: bool = False,
    adapter: str | None = None,
    progress: bool | Callable[[str, int, int, str], object] | None = None,
) -> Reproduction: ...
