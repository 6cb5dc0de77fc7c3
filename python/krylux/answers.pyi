from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ._answer import Answer as Answer
from ._krylux import Answer as _Native

class Segmentation(Answer):
    def __init__(
        self,
        arrays: dict[str, Any],
        facts: dict[str, Any],
        native: _Native | None = None,
        lab: object | None = None,
    ) -> None: ...
    labels: dict[int, NDArray[np.uint8]]
    confidence: dict[int, NDArray[np.float64]]
    eigenvalues: NDArray[np.float64]
    residuals: NDArray[np.float64]
    eigenvectors: NDArray[np.float64]
    within: NDArray[np.float64]
    degree: NDArray[np.float64]
    weights: NDArray[np.float64]
    mask: NDArray[np.bool_]
    regions: dict[str, Any]
    regions_sentence: str
    rand_index: dict[int, float]
    evidence: dict[int, dict[str, Any]]
    direct: NDArray[np.float64] | None
    features: dict[str, Any] | None
    history: list[tuple[int, list[float], list[float]]]

class Eigenpairs(Answer):
    def __init__(
        self,
        arrays: dict[str, Any],
        facts: dict[str, Any],
        native: _Native | None = None,
        lab: object | None = None,
    ) -> None: ...
    values: NDArray[np.float64]
    imaginary: NDArray[np.float64]
    vectors: NDArray[np.float64]
    imaginary_vectors: NDArray[np.float64]
    residuals: NDArray[np.float64]
    bounds: NDArray[np.float64]
    gap_bounds: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    statuses: list[str]
    asymmetry: float
    completeness: str
    confirming: int
    history: list[tuple[int, list[float], list[float]]]
    shape: tuple[int, int] | None
    def picture(self, index: int) -> NDArray[np.float64]: ...

class SingularTriplets(Answer):
    def __init__(
        self,
        arrays: dict[str, Any],
        facts: dict[str, Any],
        native: _Native | None = None,
        lab: object | None = None,
    ) -> None: ...
    values: NDArray[np.float64]
    patterns: NDArray[np.float64]
    photographs: NDArray[np.float64]
    residuals: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    statuses: list[str]
    disagreement: float
    completeness: str
    confirming: int
    history: list[tuple[int, list[float], list[float]]]

class Compensation(Answer):
    def __init__(
        self,
        arrays: dict[str, Any],
        facts: dict[str, Any],
        native: _Native | None = None,
        lab: object | None = None,
    ) -> None: ...
    pattern: NDArray[np.float32]
    target: NDArray[np.float32]
    observed: NDArray[np.float32]
    uncompensated: NDArray[np.float32]
    unclipped: NDArray[np.float32] | None
    peak: float
    residual: float
    unclipped_residual: float
    uncompensated_residual: float
    history: NDArray[np.float64]
    baseline: NDArray[np.float64]
    preparation: int
    similarity: dict[str, Any]
    uncompensated_similarity: dict[str, Any]
    methods: dict[str, dict[str, Any]]
    good: bool

class Separation(Answer):
    def __init__(
        self,
        arrays: dict[str, Any],
        facts: dict[str, Any],
        native: _Native | None = None,
        lab: object | None = None,
    ) -> None: ...
    direct: NDArray[np.float64]
    global_: NDArray[np.float64]
    standard_error: NDArray[np.float64] | None
    global_error: NDArray[np.float64] | None
    truth: NDArray[np.float64] | None
    second: NDArray[np.float64] | None
    rest: NDArray[np.float64] | None
    near: NDArray[np.float64] | None
    far: NDArray[np.float64] | None
    near_noise: float | None
    near_error: float | None
    method: str
    error: float | None
    comparison: list[dict[str, Any]]
    good: bool

class Probing(Answer):
    values: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    truth: NDArray[np.float64] | None
    paths: str
    noise: float | None
    error: float | None

class Relighting(Answer):
    def __init__(
        self,
        arrays: dict[str, Any],
        facts: dict[str, Any],
        native: _Native | None = None,
        lab: object | None = None,
    ) -> None: ...
    relit: dict[str, NDArray[np.float32]]
    duals: dict[str, NDArray[np.float32]]
    direct: dict[str, NDArray[np.float32]]
    truth: dict[str, NDArray[np.float32]]
    errors: dict[str, float | None]
    model: list[tuple[NDArray[np.float64], NDArray[np.float64]]]
    rank: int
    ambient: NDArray[np.float32]
    curve: list[dict[str, Any]]
    good: bool

class Audit(Answer):
    checks: list[dict[str, Any]]
    white: NDArray[np.float64] | None
    direct_share: NDArray[np.float64] | None
    additivity: NDArray[np.float64] | None

class Solution(Answer):
    x: NDArray[np.float64]
    residual: float
    history: NDArray[np.float64]
    best: NDArray[np.float64]
    products: int

class Plan:
    verb: Literal["segment", "compensate", "eigs"]
    photos: NDArray[np.uint64]
    patterns: NDArray[np.uint64]
    frames: NDArray[np.uint64]
    seconds: NDArray[np.float64]
    figures: dict[str, NDArray[np.float64]]
    ideal: dict[str, Any]
    trials: list[dict[str, Any]]
    def __init__(self, fields: dict[str, Any]) -> None: ...
