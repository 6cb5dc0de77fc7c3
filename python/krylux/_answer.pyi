from os import PathLike
from pathlib import Path
from typing import Any

from ._krylux import Answer as _Native
from .lab import Lab

class Answer:
    photos: int
    status: str
    def __init__(self, fields: dict[str, Any], native: _Native | None = None, lab: Lab | None = None) -> None: ...
    def save(self, folder: str | PathLike[str] | None = None, *, overwrite: bool = False) -> Path: ...
    def __getstate__(self) -> dict[str, Any]: ...
    def __setstate__(self, state: dict[str, Any]) -> None: ...
