"""The answers of a laboratory: arrays as attributes, to be pickled and shown, and saved by their ``save``.

Shapes: ``H×W`` are the pixels of photos; with three channels, pictures are ``H×W×3``. ``k`` counts eigenpairs.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from . import _checks, _display, _krylux

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .lab import Lab as _Lab

_Floats = NDArray[np.float64]
_History = list[tuple[int, list[float], list[float]]]


def _numbers(values: Iterable[float | None]) -> _Floats:
    """Numbers that JSON may have no form for: infinite ones come as ``None``."""
    return np.array([np.inf if value is None else value for value in values])


class Answer:
    """The base of all answers.

    Attributes:
        photos: Photos that it took.
        status: What was found, or why the method ended, as a sentence.
        findings: What was found of the answer and of the rig whose photos it is from: ``name``, ``grade`` (``"ok"``,
            ``"unmeasured"``, ``"warning"`` or ``"fails"``), ``found``, and where there are such ``value``, ``error``,
            ``bound``, ``expected`` and ``help``. Empty without a laboratory.
    """

    photos: int
    status: str
    findings: list[dict[str, Any]]

    #: What krylux calls the attributes that have other names here.
    _names: ClassVar[dict[str, str]] = {}
    _title: ClassVar[str] = ""

    def __init__(
        self, arrays: dict[str, Any], facts: dict[str, Any], native: _krylux.Answer | None = None, lab: _Lab | None = None
    ) -> None:
        self.__dict__.update(facts | {name.replace("-", "_"): array for name, array in arrays.items()})
        self.__dict__.update({name: self.__dict__[of] for name, of in self._names.items()})
        if isinstance(self.__dict__.get("history"), list):
            self.history: Any = [tuple(row) for row in facts["history"]]
        self._native = native
        self._lab = lab
        self.findings = [] if lab is None or native is None else lab._native.findings(native)

    @property
    def passed(self) -> bool:
        """Whether no finding fails. The exit status of the command line says the same."""
        return all(finding["grade"] != "fails" for finding in self.findings)

    def save(self, folder: _checks.FilePath | None = None, *, overwrite: bool = False) -> Path:
        """Writes what the verb of the command line leaves: arrays, pictures, ``run.json`` and ``report.html``.

        Args:
            folder: The folder. By default that of the laboratory's own run, or else a new one, ``out/NAME-VERB``.
            overwrite: Use a folder that holds an earlier run.

        Returns: The folder.

        Raises:
            krylux.errors.OptionError: The folder holds an earlier run, or the photos of the laboratory go to another
                folder.
            krylux.errors.WriteError: A file cannot be written.
            krylux.errors.ClosedError: The laboratory is closed, or the answer was pickled and has none.
        """
        lab, native = self._asked("save")
        return lab.save(native, folder, overwrite)

    def check(self) -> dict[str, Any] | None:
        """Compares the photos that the answer predicts with light that it was not computed from.

        That is light paths of another seed where the source is a scene, which takes as long as tracing it once more, and
        one more photo where it is a rig.

        Returns: ``by`` (``"another-seed"`` or ``"another-photo"``); ``of``, what was predicted; ``error``, ``‖p −
            y‖/‖y‖`` without the noise of the independent photos ``y``, and ``noise``, theirs; ``verdict``,
            ``"passed"``, ``"refuted"`` or ``"too-weak"``, with its ``statistic`` in standard errors, its ``p_value``,
            the relative error ``resolution`` that would have been refuted in 99 of 100 cases, and the ``cause`` where a
            number tells it. Of eigenpairs and segmentations of scenes also ``of_scene``: for each eigenvector (of a
            segmentation without the first) ``value``, the eigenvalue of the scene as opposed to that of its noisy
            matrix, ``standard_error``, ``quotient`` (by independent light alone, with its standard error) and
            ``residual``. Of compensations ``residual``, the distance from the target by independent light,
            ``observed``, the photo by that light, and ``standard_error`` of each of its samples, both ``float32[H, W]``
            or ``[H, W, 3]``. ``None`` where there is no independent light (runs, models, matrices) or the answer
            predicts no photos.

        Raises:
            krylux.errors.ClosedError: The laboratory is closed, or the answer was pickled and has none.
        """
        lab, native = self._asked("check")
        return lab.check(native)

    def _asked(self, verb: str) -> tuple[_krylux.Lab, _krylux.Answer]:
        """The laboratory that was asked, and its own form of the answer."""
        if self._lab is None or self._native is None:
            raise _checks.closed(f"the answer has no laboratory to be {verb.rstrip('e')}ed by",
                                 f"{verb} the answer in the process that asked for it")
        return self._lab._native, self._native

    def __getstate__(self) -> dict[str, Any]:
        # Arrays and numbers; what saves them stays in this process.
        return {**self.__dict__, "_native": None, "_lab": None}

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.status}>"

    def _sentence(self) -> str:
        """What a notebook shows above the figures."""
        return self.status

    def _figures(self) -> Iterable[Any]:
        """What a notebook shows below the sentence, and what is plotted."""
        return ()

    def plot(self) -> Figure:
        """Draws the answer with Matplotlib: its pictures, and eigenvalues or residuals where it has such.

        Returns: The figure, for ``savefig`` and for notebooks.

        Raises:
            ImportError: Matplotlib is not installed.
        """
        figure: Figure = _display.plot(self._sentence(), list(self._figures()))
        return figure

    def _repr_html_(self) -> str:
        return _display.page(self._title or type(self).__name__, self._sentence(), *self._figures())


class Segmentation(Answer):
    """Groups of pixels that exchange light: the answer of :meth:`krylux.Lab.segment`.

    Attributes:
        labels: For each number of groups the label of each pixel, a masked array of ``uint8[H, W]``; pixels without
            global light are masked, so that ``plt.imshow(groups.labels[2])`` shows the groups. Their value is 255.
        confidence: For each number of groups how sure the label of each pixel is, ``float64[H, W]`` from 0 to 1: the
            probability of its group among all groups. It does not say whether the number of groups is right.
        eigenvalues, residuals: ``float64[k]``: of the graph's matrix, the known one first, and ``‖A y − θ y‖`` of each.
        eigenvectors: ``float64[k, H, W]``.
        within: ``float64[k]``: nearly 1 for an eigenvector of regions, nearly 0 for one of a few pixels.
        degree, weights: ``float64[H, W]``: the light that each pixel exchanges, and the weight that it has in the
            clustering.
        mask: ``bool[H, W]``: pixels without global light.
        regions: How many regions the light shows (``count``), and how sure that is; ``regions_sentence`` says it in
            words.
        rand_index: The adjusted Rand index against the scene's true labels, for each number of groups; empty where
            there are none.
        evidence: For each number of groups: ``photos`` ``float64[g, H, W]`` of each group lit alone, ``exchange``
            ``float64[g, g]`` and ``cut``; empty where it was not asked for.
        direct: ``float64[H, W]``: the direct light, where it was measured.
        features: ``pixels``, ``coordinates`` and ``distances`` of the pixels that were asked for.
        history: ``(photos, eigenvalues, residuals)`` after each photo.
    """

    labels: dict[int, np.ma.MaskedArray[Any, np.dtype[np.uint8]]]
    confidence: dict[int, _Floats]
    eigenvalues: _Floats
    residuals: _Floats
    eigenvectors: _Floats
    within: _Floats
    degree: _Floats
    weights: _Floats
    mask: NDArray[np.bool_]
    regions: dict[str, Any]
    regions_sentence: str
    rand_index: dict[int, float]
    evidence: dict[int, dict[str, Any]]
    direct: _Floats | None = None
    features: dict[str, Any] | None
    history: _History

    def __init__(self, arrays: dict[str, Any], facts: dict[str, Any], *asked: Any) -> None:
        super().__init__(arrays, facts, *asked)
        self.labels = {groups: np.ma.masked_equal(labels, 255) for groups, labels in arrays["labels"].items()}
        self.rand_index = {int(groups): score for groups, score in facts["adjusted_rand_index"].items()}
        self.evidence = {
            of["groups"]: {
                "photos": arrays["evidence"][of["groups"]], "exchange": np.array(of["exchange"]), "cut": of["cut"],
            }
            for of in facts["evidence"]
        }
        if self.features is not None:
            self.features = {name: np.array(values) for name, values in self.features.items()}
            self.features["pixels"] = [tuple(pixel) for pixel in facts["features"]["pixels"]]

    def _figures(self) -> Iterable[Any]:
        yield from (_display.Picture(_display.groups(labels), f"{count} groups") for count, labels in self.labels.items())
        yield _display.Spectrum(self.eigenvalues, self.residuals)
        # The first eigenvector is the same at every pixel.
        for vector, value in zip(self.eigenvectors[1:5], self.eigenvalues[1:5], strict=True):
            yield _display.Picture(_display.signed(vector), f"{value:.4g}")

    def _repr_png_(self) -> bytes:
        return _display.png(_display.groups(next(iter(self.labels.values()))))


class Eigenpairs(Answer):
    """The answer of :meth:`krylux.Lab.eigs` and of :func:`krylux.krylov.eigs`.

    Attributes:
        values, imaginary: ``float64[k]``: the eigenvalues, the most wanted first; imaginary parts are 0 for a symmetric
            matrix.
        vectors, imaginary_vectors: ``float64[n, k]``: eigenvectors of norm 1 as columns, as SciPy has them.
        residuals, bounds, gap_bounds, standard_errors: ``float64[k]``: ``‖A y − θ y‖``; bounds on the distance to an
            eigenvalue, and by Temple and Kato; the errors due to the noise of photos.
        statuses: ``"converged"``, ``"limited by noise"`` or ``"not resolved"``.
        asymmetry: ``‖H − Hᵀ‖/‖H‖`` of the operator on the subspace.
        completeness: Whether eigenvalues may have been missed: none, none beyond a limit except with a stated chance,
            or not excluded.
        confirming: Products that confirmed it; on a rig ``photos`` counts them.
        history: ``(photos, values, residuals)`` after each photo.
        shape: ``(H, W)`` of an eigenvector as a picture, where it is one.
    """

    values: _Floats
    imaginary: _Floats
    vectors: _Floats
    imaginary_vectors: _Floats
    residuals: _Floats
    bounds: _Floats
    gap_bounds: _Floats
    standard_errors: _Floats
    statuses: list[str]
    asymmetry: float
    completeness: str
    confirming: int
    history: _History
    shape: tuple[int, int] | None
    _names = {"values": "eigenvalues", "completeness": "completeness_in_words"}

    def __init__(self, arrays: dict[str, Any], facts: dict[str, Any], *asked: Any) -> None:
        super().__init__(arrays, facts, *asked)
        columns = {name: arrays[name].reshape(len(arrays["eigenvalues"]), -1).T for name in arrays if "vectors" in name}
        self.vectors = columns["eigenvectors"]
        self.imaginary = arrays.get("eigenvalues-imaginary", np.zeros_like(self.values))
        self.imaginary_vectors = columns.get("eigenvectors-imaginary", np.zeros_like(self.vectors))
        self.shape = None if self._lab is None else self._lab.projector_shape

    def picture(self, index: int) -> _Floats:
        """Eigenvector ``index`` as a picture, ``float64[H, W]``."""
        if self.shape is None:
            raise ValueError("these eigenvectors are no pictures: the operator has no pixels")
        return self.vectors[:, index].reshape(self.shape)

    def _sentence(self) -> str:
        return f"{self.status}; {self.completeness}"

    def _figures(self) -> Iterable[Any]:
        yield _display.Spectrum(self.values, self.residuals)
        if self.shape is not None and min(self.shape) > 1:
            for index, value in enumerate(self.values[:8]):
                yield _display.Picture(_display.signed(self.picture(index)), f"{value:.4g}")


class SingularTriplets(Answer):
    """The answer of :meth:`krylux.Lab.singular`: ``A v = σ u`` and ``Aᵀ u = σ v``.

    Attributes:
        values: ``float64[k]``: the singular values ``σ``, descending.
        patterns: ``float64[k, H, W]``: the right singular vectors ``v`` of norm 1, as pictures of the projector.
        photographs: ``float64[k, H, W]``: the left singular vectors ``u`` of norm 1, as pictures of the camera.
        residuals, standard_errors: ``float64[k]``: how far the products are from ``σ u`` and ``σ v``; the errors due to
            the noise of photos.
        statuses: ``"converged"``, ``"limited by noise"`` or ``"not resolved"``.
        disagreement: How far the photos of the transpose are from the other photos transposed, relative to these.
        completeness, confirming: As of :class:`Eigenpairs`.
        history: ``(photos, values, residuals)`` after each pair of photos.
    """

    values: _Floats
    patterns: _Floats
    photographs: _Floats
    residuals: _Floats
    standard_errors: _Floats
    statuses: list[str]
    disagreement: float
    completeness: str
    confirming: int
    history: _History
    _title = "Singular values"
    _names = {
        "values": "singular_values", "patterns": "right_vectors", "photographs": "left_vectors",
        "completeness": "completeness_in_words",
    }

    def _figures(self) -> Iterable[Any]:
        yield _display.Spectrum(self.values, self.residuals)
        for name, stack in (("pattern", self.patterns), ("photo", self.photographs)):
            if min(stack.shape[1:]) > 1:
                for picture, value in zip(stack[:4], self.values, strict=False):
                    yield _display.Picture(_display.signed(picture), f"{name} of {value:.4g}")


class Compensation(Answer):
    """The pattern under which the scene looks like a target: the answer of :meth:`krylux.Lab.compensate`.

    Attributes:
        pattern: ``float32[H, W]`` or ``[H, W, 3]``: the pattern, in ``[floor, 1]``.
        target, observed, uncompensated: The target light, the photo of the pattern, and that of the target itself; in
            the laboratory's unit.
        unclipped: The method's own answer, where it had to be clipped.
        peak: The radiance that 1 in the target stands for.
        residual, unclipped_residual, uncompensated_residual: ``‖b − A x‖/‖b‖`` of the three.
        least_residual: What no pattern falls below, where products with the transpose tell it, or ``None``.
        history, baseline: The residual after each photo, of the method and of projected Jacobi.
        preparation: Photos before those of the method.
        similarity, uncompensated_similarity: ``psnr`` in dB, ``ssim``, ``rmse`` and others against the target.
        methods: Other methods with as many photos, where they were asked for.
        good: Whether it is better than no compensation, and as good as was asked for.
    """

    pattern: NDArray[np.float32]
    target: NDArray[np.float32]
    observed: NDArray[np.float32]
    uncompensated: NDArray[np.float32]
    unclipped: NDArray[np.float32] | None = None
    peak: float
    residual: float
    unclipped_residual: float
    uncompensated_residual: float
    least_residual: float | None
    history: _Floats
    baseline: _Floats
    preparation: int
    similarity: dict[str, Any]
    uncompensated_similarity: dict[str, Any]
    methods: dict[str, dict[str, Any]]
    good: bool
    _names = {
        "pattern": "compensation", "photos": "photos_of_method", "preparation": "photos_before", "status": "ended",
        "residual": "relative_residual", "unclipped_residual": "relative_residual_unclipped", "similarity": "likeness",
        "uncompensated_residual": "relative_residual_uncompensated", "uncompensated_similarity": "likeness_uncompensated",
        "least_residual": "relative_residual_least",
    }

    def __init__(self, arrays: dict[str, Any], facts: dict[str, Any], *asked: Any) -> None:
        super().__init__(arrays, facts, *asked)
        self.methods = {
            of["method"]: {
                "photos": of["photos"], "frames": of["frames"], "residual": of["relative_residual"], "ssim": of["ssim"],
                "history": _numbers(of["residuals"]), "displayed": _numbers(of["residuals_displayed"]),
            }
            for of in facts["methods"]
        }

    def _sentence(self) -> str:
        return f"{self.photos} photos: {self.status}"

    def _figures(self) -> Iterable[Any]:
        yield _display.Picture(_display.light(self.pattern), "pattern")
        yield _display.Picture(_display.light(self.observed), f"observed: residual {self.residual:.4f}")
        yield _display.Picture(_display.light(self.uncompensated), f"uncompensated: {self.uncompensated_residual:.4f}")
        yield _display.Picture(_display.light(self.target), "target")

    def _repr_png_(self) -> bytes:
        return _display.png(_display.light(self.pattern))


class Separation(Answer):
    """Direct and global light under white: the answer of :meth:`krylux.Lab.separate`.

    Attributes:
        direct, global_: ``float64[H, W]`` or ``[H, W, 3]``: light of one bounce, and of two and more.
        standard_error, global_error: The standard errors of ``direct`` and of ``global_``, where the method tells them.
        truth: The exact ``direct``, where the simulator knows it.
        second, rest: The second bounce, and the third and later ones, where they were asked for.
        near, far: Global light by how far it went; ``near_noise`` and ``near_error`` say how well that is known.
        method: The method's name.
        error: The relative error of ``direct``, where the truth is known.
        comparison: Every method at several numbers of photos, where that was asked for.
        good: Whether the error is as small as was asked for.
    """

    direct: _Floats
    global_: _Floats
    standard_error: _Floats | None = None
    global_error: _Floats | None = None
    truth: _Floats | None = None
    second: _Floats | None = None
    rest: _Floats | None = None
    near: _Floats | None = None
    far: _Floats | None = None
    near_noise: float | None
    near_error: float | None
    method: str
    error: float | None
    comparison: list[dict[str, Any]]
    good: bool
    _names = {"error": "relative_error", "near_noise": "near_indirect_noise", "near_error": "near_indirect_error"}

    def _figures(self) -> Iterable[Any]:
        yield _display.Picture(_display.light(self.direct), "direct")
        yield _display.Picture(_display.light(self.global_), "global")


class Probing(Answer):
    """A photo of which only some light paths are let through: the answer of :meth:`krylux.Lab.probe`.

    Attributes:
        values, standard_errors: ``float64[H, W]`` or ``[H, W, 3]``: the photo, and its standard errors.
        truth: The exact photo, where the matrix is known.
        paths: Which paths were let through.
        noise: The norm of the standard errors, relative to that of the photo. None where no such light can be measured.
        error: The relative error, where the exact photo is known.
    """

    values: _Floats
    standard_errors: _Floats
    truth: _Floats | None = None
    paths: str
    noise: float | None
    error: float | None
    _names = {"paths": "name", "noise": "relative_standard_error", "error": "relative_error"}

    def _figures(self) -> Iterable[Any]:
        yield _display.Picture(_display.light(self.values), self.paths)

    def _repr_png_(self) -> bytes:
        return _display.png(_display.light(self.values))


class Relighting(Answer):
    """A low-rank model and what it answered: the answer of :meth:`krylux.Lab.relight`.

    Attributes:
        relit, duals, direct: By name: photos of patterns, dual photographs, and photos without interreflections;
            ``float32``.
        truth: The true photos, where the scene is simulated.
        errors: ``‖relit − true‖/‖true‖`` of each pattern.
        model: For each channel ``(basis, photos)``, ``float64[r, n]`` and ``float64[r, m]``: orthonormal patterns and
            their photos without direct light, as rows.
        rank: The rank of the model.
        ambient: The photo without projector.
        curve: The model's error for each number of photos, where the matrix is known.
        good: Whether the errors are as small as was asked for.
    """

    relit: dict[str, NDArray[np.float32]]
    duals: dict[str, NDArray[np.float32]]
    direct: dict[str, NDArray[np.float32]]
    truth: dict[str, NDArray[np.float32]]
    errors: dict[str, float | None]
    model: list[tuple[_Floats, _Floats]]
    rank: int
    ambient: NDArray[np.float32]
    curve: list[dict[str, Any]]
    good: bool

    def __init__(self, arrays: dict[str, Any], facts: dict[str, Any], *asked: Any) -> None:
        super().__init__({}, {name: facts[name] for name in ("photos", "status", "rank", "curve", "good")}, *asked)
        names = {"relit": [of["pattern"] for of in facts["relit"]], "duals": [of["pattern"] for of in facts["dual"]],
                 "direct": [of["photo"] for of in facts["inverse"]]}
        names["truth"] = names["relit"]
        for attribute, of in names.items():
            setattr(self, attribute, {of[index]: picture for index, picture in arrays.get(attribute, {}).items()})
        self.errors = {of["pattern"]: of["relative_error"] for of in facts["relit"]}
        self.ambient = arrays["ambient"]
        self.model = [(basis, arrays["basis_photos"][channel]) for channel, basis in arrays["basis"].items()]

    def _figures(self) -> Iterable[Any]:
        return (_display.Picture(_display.light(picture), name) for name, picture in self.relit.items())


class Audit(Answer):
    """Whether a source is a linear, symmetric operator: the answer of :meth:`krylux.Lab.audit`.

    Attributes:
        checks: ``name``, ``grade`` and ``found`` of each check, and where it has them ``value``, ``error``, ``bound``,
            ``expected`` and ``help``. They are the audit's findings: it has ``passed`` if none fails.
        white, direct_share, additivity: ``float64[H, W]``: the white photo, the share of direct light, and the
            departure from additivity.
    """

    checks: list[dict[str, Any]]
    white: _Floats | None = None
    direct_share: _Floats | None = None
    additivity: _Floats | None = None

    def _figures(self) -> Iterable[Any]:
        yield _display.Table([check[cell] for cell in ("name", "grade", "found")] for check in self.checks)


class Imported(Answer):
    """A model fitted to captures: the answer of :meth:`krylux.Lab.imported`.

    Attributes:
        captures: The number of captures.
        relative_error_left_out: The error of photos that were left out, relative to them.
        relative_noise: The noise of a photo, relative to it; ``noise_is_measured`` tells whether repeated takes told it.
        error_over_stated: The errors of those photos over their stated errors: 1 if stated errors are right.
        photos_left_out: Their places among the captures.
        prior: The scales of the prior of each channel.
    """

    captures: int
    relative_error_left_out: float
    relative_noise: float
    noise_is_measured: bool
    error_over_stated: float
    photos_left_out: list[int]
    prior: list[dict[str, float]]


class Solution(Answer):
    """The answer of :meth:`krylux.Lab.solve` and of the solvers in :mod:`krylux.krylov`.

    Attributes:
        x: ``float64[n]``: the best iterate.
        residual: Its ``‖b − A x‖/‖b‖``.
        history, best: The residual after each product, and the least so far.
        products, photos: Products with ``A`` and ``Aᵀ``; on a rig each is a photo.
    """

    x: _Floats
    residual: float
    history: _Floats
    best: _Floats
    products: int
    _names = {"x": "solution", "status": "ended"}

    def __init__(self, arrays: dict[str, Any], facts: dict[str, Any], *asked: Any) -> None:
        super().__init__(arrays, facts, *asked)
        self.residual = float(arrays["residual"])

    def _figures(self) -> Iterable[Any]:
        yield _display.Curve(self.history)


class Plan:
    """The predicted cost and error of a verb on a rig: the answer of :meth:`krylux.Lab.plan`.

    Every array has one entry for each trial, whose noise is its own; their spread is that of the prediction.

    Attributes:
        verb: ``"segment"``, ``"compensate"`` or ``"eigs"``.
        photos, patterns, frames: ``uint64[t]``: products that the method takes, distinct patterns that are shown, and
            frames of the camera.
        seconds: ``float64[t]``: seconds on the rig.
        figures: ``float64[t]`` by name: adjusted Rand indices of the groups, residuals of a compensation, or errors of
            eigenvalues.
        ideal: What the figures are held against: the answer with ideal devices.
        trials: The trials with all that is known of them.
    """

    verb: Literal["segment", "compensate", "eigs"]
    photos: NDArray[np.uint64]
    patterns: NDArray[np.uint64]
    frames: NDArray[np.uint64]
    seconds: _Floats
    figures: dict[str, _Floats]
    ideal: dict[str, Any]
    trials: list[dict[str, Any]]

    def __init__(self, fields: dict[str, Any]) -> None:
        self.verb, self.ideal, self.trials = fields["verb"], fields["ideal"], fields["trials"]
        self.figures = {name: np.asarray(values, np.float64) for name, values in fields["values"]}
        costs = [trial["cost"] for trial in self.trials]
        for name, kind in (("photos", np.uint64), ("patterns", np.uint64), ("frames", np.uint64), ("seconds", float)):
            setattr(self, name, np.asarray([cost[name] for cost in costs], kind))

    def __repr__(self) -> str:
        return (f"<Plan of {self.verb}: {self.photos.mean():.0f} photos, {self.frames.mean():.0f} frames, "
                f"{self.seconds.mean():.1f} s on the rig; the mean of {len(self.seconds)} trials>")

    def _repr_html_(self) -> str:
        costs = {"photos": self.photos, "patterns": self.patterns, "frames": self.frames, "seconds": self.seconds}
        rows = [[name, f"{of.mean():.4g}", f"{of.min():.4g}", f"{of.max():.4g}"]
                for name, of in {**costs, **self.figures}.items() if len(of)]
        return _display.page("Plan", repr(self).strip("<>"), _display.Table(rows, ["", "mean", "least", "largest"]))
