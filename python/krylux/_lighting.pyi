from collections.abc import Mapping
from os import PathLike
from typing import Literal

from numpy.typing import ArrayLike

from . import answers

class Lighting:
    def separate(
        self,
        by: Literal["exact", "checkerboards", "sinusoids", "random", "capture"] | None = None,
        *,
        square: int = 2,
        shifts: int = 4,
        period: float = 4.0,
        phases: int = 3,
        photos: int | None = None,
        sigma: float | None = None,
        probes: int | None = None,
        bounces: bool = False,
        compare: bool = False,
        max_error: float | None = None,
    ) -> answers.Separation: ...
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
