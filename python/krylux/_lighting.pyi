from collections.abc import Mapping
from os import PathLike
from typing import Literal

from numpy.typing import ArrayLike

from . import answers

class Lighting:
    def probe(
        self,
        paths: Literal["direct", "indirect", "near", "far", "near-indirect"] = "indirect",
        *,
        sigma: float | None = None,
        photos: int | None = None,
    ) -> answers.Probing: ...
    def relight(
        self,
        patterns: Mapping[str, ArrayLike] | None = None,
        *,
        duals: Mapping[str, ArrayLike] | None = None,
        photographs: Mapping[str, ArrayLike] | None = None,
        photos: int | None = None,
        block: int | None = None,
        max_error: float | None = None,
    ) -> answers.Relighting: ...
