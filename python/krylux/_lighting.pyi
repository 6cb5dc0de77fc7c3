from collections.abc import Mapping
from os import PathLike
from typing import Literal

from numpy.typing import ArrayLike

from . import answers

class Lighting:
    def compensate(
        self,
        target: ArrayLike,
        *,
        method: str | None = None,
        photos: int | None = None,
        rtol: float | None = None,
        floor: float = 0.0,
        lift: float | None = None,
        peak: float | None = None,
        precondition: str | None = None,
        defocus: float | None = None,
        out_of_focus: bool = False,
        paper: bool = False,
        crosstalk: ArrayLike | Literal["measure"] | None = None,
        unmix: bool = False,
        compare_methods: bool = False,
        model: str | PathLike[str] | None = None,
    ) -> answers.Compensation: ...
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
