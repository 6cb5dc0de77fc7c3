from collections.abc import Sequence
from os import PathLike
from typing import Any, Literal

from numpy.typing import ArrayLike

from . import answers

class Asking:
    # What krylux declares, as krylux._declared.stub() writes it: a test holds it.
    def segment(
        self,
        groups: int | Sequence[int] = (),
        *,
        photos: int | None = None,
        starts: int | None = None,
        eigenvectors: int = 10,
        cut: Literal["normalized", "average"] = "normalized",
        coordinates: Literal["commute", "plain"] = "commute",
        mu: float = 0.0,
        keep_direct: bool = False,
        mask_below: float = 0.01,
        confirm: float | None = None,
        direct: Literal["source", "patterns", "estimator", "keep"] = "source",
        direct_photos: int = 16,
        direct_square: int = 4,
        blur: float | None = None,
        features: tuple[int, int] | Sequence[tuple[int, int]] = (),
        evidence: bool = False,
        min_rand_index: float | None = None,
    ) -> answers.Segmentation: ...
    def compensate(
        self,
        target: ArrayLike | str | PathLike[str] | None = None,
        *,
        paper: bool = False,
        method: str | None = None,
        photos: int | None = None,
        rtol: float | None = None,
        lift: float | None = None,
        floor: float = 0.0,
        precondition: Literal["none", "diagonal", "multiscale", "direct", "geometry", "defocus"] | None = None,
        out_of_focus: bool = False,
        defocus: float | None = None,
        peak: float | None = None,
        model: str | PathLike[str] | None = None,
        crosstalk: Any | None = None,
        unmix: bool = False,
        compare_methods: bool = False,
    ) -> answers.Compensation: ...
    def separate(
        self,
        by: Literal["exact", "checkerboards", "sinusoids", "codes", "random", "capture"] | None = None,
        *,
        square: int | None = None,
        shifts: int | None = None,
        period: float = 4.0,
        phases: int = 3,
        photos: int | None = None,
        bounces: bool = False,
        sigma: float | None = None,
        probes: int | None = None,
        compare: bool = False,
        max_error: float | None = None,
    ) -> answers.Separation: ...
    def probe(
        self,
        paths: Literal["direct", "indirect", "near", "far", "near-indirect"] = "indirect",
        *,
        sigma: float | None = None,
        mask: Any | None = None,
        photos: int | None = None,
    ) -> answers.Probing: ...
    def eigs(
        self,
        count: int = 6,
        *,
        part: Literal["full", "direct", "global"] = "full",
        which: Literal["la", "sa", "lm", "sm", "be", "li"] = "la",
        photos: int | None = None,
        tolerance: float | None = None,
        method: Literal["power", "lanczos", "block-lanczos", "arnoldi"] = "lanczos",
        block: int = 2,
        max_basis: int | None = None,
        confirm: float | None = None,
        singular: bool = False,
    ) -> answers.Eigenpairs: ...
    def audit(
        self,
        patterns: int = 6,
        *,
        tolerance: float = 0.01,
        asymmetry: float = 0.1,
    ) -> answers.Audit: ...
