from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

from numpy.typing import ArrayLike

from . import answers

class Asking:
    seed: int
    def segment(
        self,
        groups: int | Sequence[int] = (),
        *,
        photos: int | None = None,
        starts: int | None = None,
        eigenvectors: int = 10,
        cut: Literal["normalized", "average"] = "normalized",
        mu: float = 0.0,
        mask_below: float = 0.01,
        direct: Literal["source", "patterns", "estimator", "keep"] = "source",
        direct_photos: int = 16,
        direct_square: int = 4,
        blur: float = 0.0,
        features: Iterable[tuple[int, int]] = (),
        evidence: bool = False,
    ) -> answers.Segmentation: ...
    def eigs(
        self,
        count: int = 6,
        *,
        part: Literal["full", "direct", "global"] = "full",
        which: Literal["la", "sa", "lm", "sm", "be", "li"] = "la",
        photos: int | None = None,
        tolerance: float | None = None,
        method: Literal["lanczos", "block-lanczos", "arnoldi", "power"] = "lanczos",
        block: int = 2,
        max_basis: int | None = None,
    ) -> answers.Eigenpairs: ...
    def solve(
        self,
        b: ArrayLike,
        *,
        method: str = "minres",
        photos: int = 50,
        rtol: float = 1e-6,
        lower: float = 0.0,
        upper: float = 1.0,
    ) -> answers.Solution: ...
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
    ) -> answers.Compensation: ...
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
    def audit(self, *, patterns: int = 6, tolerance: float = 0.01, asymmetry: float = 0.1) -> answers.Audit: ...

def eigs_question(
    *,
    count: int,
    which: str,
    photos: int,
    tolerance: float | None,
    method: str,
    block: int,
    max_basis: int | None,
    seed: int,
    noise: float = 0.0,
    start: Any = None,
    deflate: Iterable[Any] = (),
) -> dict[str, Any]: ...
def columns(fields: dict[str, Any]) -> dict[str, Any]: ...
