"""The answers of a laboratory: arrays as attributes, to be pickled and shown, and saved by their ``save``.

Shapes: ``H×W`` are the pixels of photos; with three channels, pictures are ``H×W×3``. ``k`` counts eigenpairs.
"""

import numpy as np

from . import _display
from ._answer import Answer


def _numbers(values):
    """Numbers that JSON may have no form for: infinite ones come as ``None``."""
    return np.array([np.inf if value is None else value for value in values])


class Segmentation(Answer):
    """Groups of pixels that exchange light: the answer of :meth:`krylux.Lab.segment`.

    Attributes
    ----------
    labels : dict of int to numpy.ndarray
        For each number of groups the label of each pixel, ``uint8[H, W]``; 255 is a pixel without global light.
    confidence : dict of int to numpy.ndarray
        For each number of groups how sure the label of each pixel is, ``float64[H, W]`` from 0 to 1: the probability of its
        group among all groups. It does not say whether the number of groups is right.
    eigenvalues, residuals : numpy.ndarray
        ``float64[k]``: of the graph's matrix, the known one first, and ``‖A y − θ y‖`` of each.
    eigenvectors : numpy.ndarray
        ``float64[k, H, W]``.
    within : numpy.ndarray
        ``float64[k]``: nearly 1 for an eigenvector of regions, nearly 0 for one of a few pixels.
    degree, weights : numpy.ndarray
        ``float64[H, W]``: the light that each pixel exchanges, and the weight that it has in the clustering.
    mask : numpy.ndarray
        ``bool[H, W]``: pixels without global light.
    regions : dict
        How many regions the light shows (``count``), and how sure that is; ``regions_sentence`` says it in words.
    rand_index : dict of int to float
        The adjusted Rand index against the scene's true labels, for each number of groups; empty where there are none.
    evidence : dict of int to dict
        For each number of groups: ``photos`` ``float64[g, H, W]`` of each group lit alone, ``exchange`` ``float64[g, g]``
        and ``cut``; empty where it was not asked for.
    direct : numpy.ndarray or None
        ``float64[H, W]``: the direct light, where it was measured.
    features : dict or None
        ``pixels``, ``coordinates`` and ``distances`` of the pixels that were asked for.
    history : list of tuple
        ``(photos, eigenvalues, residuals)`` after each photo.
    """

    direct = None

    def __init__(self, arrays, facts, native=None, lab=None):
        super().__init__({**facts, **arrays}, native, lab)
        self.rand_index = {int(groups): score for groups, score in facts["adjusted_rand_index"].items()}
        self.history = [tuple(row) for row in facts["history"]]
        self.evidence = {
            of["groups"]: {
                "photos": arrays["evidence"][of["groups"]], "exchange": np.array(of["exchange"]), "cut": of["cut"],
            }
            for of in facts["evidence"]
        }
        if self.features is not None:
            self.features = {
                "pixels": [tuple(pixel) for pixel in self.features["pixels"]],
                "coordinates": np.array(self.features["coordinates"]),
                "distances": np.array(self.features["distances"]),
            }

    def _repr_html_(self):
        pictures = [
            _display.image(_display.groups(labels), f"{count} groups") for count, labels in self.labels.items()
        ]
        pictures.append(_display.spectrum(self.eigenvalues, self.residuals))
        return _display.page("Segmentation", self.status, *pictures)

    def _repr_png_(self):
        return _display.png(_display.enlarged(_display.groups(next(iter(self.labels.values())))))


class Eigenpairs(Answer):
    """The answer of :meth:`krylux.Lab.eigs` and of :func:`krylux.krylov.eigs`.

    Attributes
    ----------
    values, imaginary : numpy.ndarray
        ``float64[k]``: the eigenvalues, the most wanted first; imaginary parts are 0 for a symmetric matrix.
    vectors, imaginary_vectors : numpy.ndarray
        ``float64[n, k]``: eigenvectors of norm 1 as columns, as SciPy has them.
    residuals, bounds, gap_bounds, standard_errors : numpy.ndarray
        ``float64[k]``: ``‖A y − θ y‖``; bounds on the distance to an eigenvalue, and by Temple and Kato; the errors due to
        the noise of photos.
    statuses : list of str
        ``"converged"``, ``"limited by noise"`` or ``"not resolved"``.
    asymmetry : float
        ``‖H − Hᵀ‖/‖H‖`` of the operator on the subspace.
    completeness : str
        Whether eigenvalues may have been missed: none, none beyond a limit except with a stated chance, or not excluded.
    confirming : int
        Products that confirmed it; on a rig ``photos`` counts them.
    history : list of tuple
        ``(photos, values, residuals)`` after each photo.
    shape : tuple of int or None
        ``(H, W)`` of an eigenvector as a picture, where it is one.
    """

    def __init__(self, arrays, facts, native=None, lab=None):
        super().__init__({**facts, **arrays}, native, lab)
        columns = {name: arrays[name].reshape(len(arrays["eigenvalues"]), -1).T for name in arrays if "vectors" in name}
        self.values, self.vectors = arrays["eigenvalues"], columns["eigenvectors"]
        self.imaginary = arrays.get("eigenvalues-imaginary", np.zeros_like(self.values))
        self.imaginary_vectors = columns.get("eigenvectors-imaginary", np.zeros_like(self.vectors))
        self.completeness = facts["completeness_in_words"]
        self.history = [tuple(row) for row in facts["history"]]
        self.shape = None if lab is None else lab.projector_shape

    def picture(self, index):
        """Eigenvector ``index`` as a picture, ``float64[H, W]``."""
        if self.shape is None:
            raise ValueError("these eigenvectors are no pictures: the operator has no pixels")
        return self.vectors[:, index].reshape(self.shape)

    def _repr_html_(self):
        pictures = []
        if self.shape is not None and min(self.shape) > 1:
            values = self.values[:8]
            pictures = [
                _display.image(_display.signed(self.picture(index)), f"{value:.4g}")
                for index, value in enumerate(values)
            ]
        spectrum = _display.spectrum(self.values, self.residuals)
        return _display.page("Eigenpairs", f"{self.photos} photos: {self.status}; {self.completeness}", spectrum, *pictures)


class SingularTriplets(Answer):
    """The answer of :meth:`krylux.Lab.singular`: ``A v = σ u`` and ``Aᵀ u = σ v``.

    Attributes
    ----------
    values : numpy.ndarray
        ``float64[k]``: the singular values ``σ``, descending.
    patterns : numpy.ndarray
        ``float64[k, H, W]``: the right singular vectors ``v`` of norm 1, as pictures of the projector.
    photographs : numpy.ndarray
        ``float64[k, H, W]``: the left singular vectors ``u`` of norm 1, as pictures of the camera.
    residuals, standard_errors : numpy.ndarray
        ``float64[k]``: how far the products are from ``σ u`` and ``σ v``; the errors due to the noise of photos.
    statuses : list of str
        ``"converged"``, ``"limited by noise"`` or ``"not resolved"``.
    disagreement : float
        How far the photos of the transpose are from the other photos transposed, relative to these.
    completeness, confirming
        As of :class:`Eigenpairs`.
    history : list of tuple
        ``(photos, values, residuals)`` after each pair of photos.
    """

    def __init__(self, arrays, facts, native=None, lab=None):
        super().__init__({**facts, **arrays}, native, lab)
        self.values, self.standard_errors = arrays["singular-values"], arrays["standard-errors"]
        self.patterns, self.photographs = arrays["right-vectors"], arrays["left-vectors"]
        self.completeness = facts["completeness_in_words"]
        self.history = [tuple(row) for row in facts["history"]]

    def _repr_html_(self):
        pictures = []
        for name, stack in (("pattern", self.patterns), ("photo", self.photographs)):
            if min(stack.shape[1:]) > 1:
                pictures += [
                    _display.image(_display.signed(picture), f"{name} of {value:.4g}")
                    for picture, value in zip(stack[:4], self.values, strict=False)
                ]
        spectrum = _display.spectrum(self.values, self.residuals)
        return _display.page("Singular values", f"{self.photos} photos there and back: {self.status}", spectrum, *pictures)


class Compensation(Answer):
    """The pattern under which the scene looks like a target: the answer of :meth:`krylux.Lab.compensate`.

    Attributes
    ----------
    pattern : numpy.ndarray
        ``float32[H, W]`` or ``[H, W, 3]``: the pattern, in ``[floor, 1]``.
    target, observed, uncompensated : numpy.ndarray
        The target light, the photo of the pattern, and that of the target itself; in the laboratory's unit.
    unclipped : numpy.ndarray or None
        The method's own answer, where it had to be clipped.
    peak : float
        The radiance that 1 in the target stands for.
    residual, unclipped_residual, uncompensated_residual : float
        ``‖b − A x‖/‖b‖`` of the three.
    history, baseline : numpy.ndarray
        The residual after each photo, of the method and of projected Jacobi.
    preparation : int
        Photos before those of the method.
    similarity, uncompensated_similarity : dict
        ``psnr`` in dB, ``ssim``, ``rmse`` and others against the target.
    methods : dict of str to dict
        Other methods with as many photos, where they were asked for.
    good : bool
        Whether it is better than no compensation, and as good as was asked for.
    """

    unclipped = None

    def __init__(self, arrays, facts, native=None, lab=None):
        super().__init__({**facts, **arrays}, native, lab)
        self.pattern = arrays["compensation"]
        self.photos, self.preparation, self.status = (facts[of] for of in ("photos_of_method", "photos_before", "ended"))
        self.residual = facts["relative_residual"]
        self.unclipped_residual = facts["relative_residual_unclipped"]
        self.uncompensated_residual = facts["relative_residual_uncompensated"]
        self.similarity, self.uncompensated_similarity = facts["likeness"], facts["likeness_uncompensated"]
        self.methods = {
            of["method"]: {
                "photos": of["photos"], "frames": of["frames"], "residual": of["relative_residual"], "ssim": of["ssim"],
                "history": _numbers(of["residuals"]), "displayed": _numbers(of["residuals_displayed"]),
            }
            for of in facts["methods"]
        }

    def _repr_html_(self):
        pictures = [
            _display.image(_display.light(picture), caption)
            for picture, caption in (
                (self.pattern, "pattern"),
                (self.observed, f"observed: residual {self.residual:.4f}"),
                (self.uncompensated, f"uncompensated: {self.uncompensated_residual:.4f}"),
                (self.target, "target"),
            )
        ]
        return _display.page("Compensation", f"{self.photos} photos: {self.status}", *pictures)

    def _repr_png_(self):
        return _display.png(_display.enlarged(_display.light(self.pattern)))


class Separation(Answer):
    """Direct and global light under white: the answer of :meth:`krylux.Lab.separate`.

    Attributes
    ----------
    direct, global_ : numpy.ndarray
        ``float64[H, W]`` or ``[H, W, 3]``: light of one bounce, and of two and more.
    standard_error, global_error : numpy.ndarray or None
        The standard errors of ``direct`` and of ``global_``, where the method tells them.
    truth : numpy.ndarray or None
        The exact ``direct``, where the simulator knows it.
    second, rest : numpy.ndarray or None
        The second bounce, and the third and later ones, where they were asked for.
    near, far : numpy.ndarray or None
        Global light by how far it went; ``near_noise`` and ``near_error`` say how well that is known.
    method : str
        The method's name.
    error : float or None
        The relative error of ``direct``, where the truth is known.
    comparison : list of dict
        Every method at several numbers of photos, where that was asked for.
    good : bool
        Whether the error is as small as was asked for.
    """

    standard_error = global_error = truth = second = rest = near = far = None

    def __init__(self, arrays, facts, native=None, lab=None):
        super().__init__({**facts, **arrays}, native, lab)
        self.error = facts["relative_error"]
        self.near_noise, self.near_error = facts["near_indirect_noise"], facts["near_indirect_error"]

    def _repr_html_(self):
        pictures = [
            _display.image(_display.light(picture), caption)
            for picture, caption in ((self.direct, "direct"), (self.global_, "global"))
        ]
        return _display.page("Separation", self.status, *pictures)


class Probing(Answer):
    """A photo of which only some light paths are let through: the answer of :meth:`krylux.Lab.probe`.

    Attributes
    ----------
    values, standard_errors : numpy.ndarray
        ``float64[H, W]`` or ``[H, W, 3]``: the photo, and its standard errors.
    truth : numpy.ndarray or None
        The exact photo, where the matrix is known.
    paths : str
        Which paths were let through.
    noise : float or None
        The norm of the standard errors, relative to that of the photo. None where no such light can be measured.
    error : float or None
        The relative error, where the exact photo is known.
    """

    truth = None

    def __init__(self, arrays, facts, native=None, lab=None):
        fields = {"paths": facts["name"], "noise": facts["relative_standard_error"], "error": facts["relative_error"]}
        super().__init__({**fields, **arrays, "photos": facts["photos"], "status": facts["status"]}, native, lab)

    def _repr_html_(self):
        return _display.page("Probing", self.status, _display.image(_display.light(self.values), self.paths))

    def _repr_png_(self):
        return _display.png(_display.enlarged(_display.light(self.values)))


class Relighting(Answer):
    """A low-rank model and what it answered: the answer of :meth:`krylux.Lab.relight`.

    Attributes
    ----------
    relit, duals, direct : dict of str to numpy.ndarray
        By name: photos of patterns, dual photographs, and photos without interreflections; ``float32``.
    truth : dict of str to numpy.ndarray
        The true photos, where the scene is simulated.
    errors : dict of str to float
        ``‖relit − true‖/‖true‖`` of each pattern.
    model : list of tuple
        For each channel ``(basis, photos)``, ``float64[r, n]`` and ``float64[r, m]``: orthonormal patterns and their photos
        without direct light, as rows.
    rank : int
        The rank of the model.
    ambient : numpy.ndarray
        The photo without projector.
    curve : list of dict
        The model's error for each number of photos, where the matrix is known.
    good : bool
        Whether the errors are as small as was asked for.
    """

    def __init__(self, arrays, facts, native=None, lab=None):
        super().__init__({name: facts[name] for name in ("photos", "status", "rank", "curve", "good")}, native, lab)
        names = {"relit": [of["pattern"] for of in facts["relit"]], "duals": [of["pattern"] for of in facts["dual"]],
                 "direct": [of["photo"] for of in facts["inverse"]]}
        names["truth"] = names["relit"]
        for attribute, of in names.items():
            setattr(self, attribute, {of[index]: picture for index, picture in arrays.get(attribute, {}).items()})
        self.errors = {of["pattern"]: of["relative_error"] for of in facts["relit"]}
        self.ambient = arrays["ambient"]
        self.model = [(basis, arrays["basis_photos"][channel]) for channel, basis in arrays["basis"].items()]

    def _repr_html_(self):
        pictures = [_display.image(_display.light(picture), name) for name, picture in self.relit.items()]
        return _display.page("Relighting", self.status, *pictures)


class Audit(Answer):
    """Whether a source is a linear, symmetric operator: the answer of :meth:`krylux.Lab.audit`.

    Attributes
    ----------
    checks : list of dict
        ``name``, ``grade`` and ``found`` of each check, and where it has them ``value``, ``error``, ``bound``, ``expected`` and ``help``.
        They are the audit's findings: it has ``passed`` if none fails.
    white, direct_share, additivity : numpy.ndarray or None
        ``float64[H, W]``: the white photo, the share of direct light, and the departure from additivity.
    """

    white = direct_share = additivity = None

    def __init__(self, arrays, facts, native=None, lab=None):
        arrays = {name.replace("-", "_"): array for name, array in arrays.items()}
        super().__init__({name: facts[name] for name in ("checks", "photos", "status")} | arrays, native, lab)

    def _repr_html_(self):
        rows = "".join(
            f"<tr><td>{check['name']}</td><td>{check['grade']}</td><td>{_display.text(check['found'])}</td></tr>"
            for check in self.checks
        )
        return _display.page("Audit", self.status, f"<table>{rows}</table>")


class Solution(Answer):
    """The answer of :meth:`krylux.Lab.solve` and of the solvers in :mod:`krylux.krylov`.

    Attributes
    ----------
    x : numpy.ndarray
        ``float64[n]``: the best iterate.
    residual : float
        Its ``‖b − A x‖/‖b‖``.
    history, best : numpy.ndarray
        The residual after each product, and the least so far.
    products, photos : int
        Products with ``A`` and ``Aᵀ``; on a rig each is a photo.
    """

    def __init__(self, arrays, facts, native=None, lab=None):
        fields = {"x": arrays["solution"], "residual": float(arrays["residual"]), "status": facts["ended"]}
        fields |= {name: arrays[name] for name in ("history", "best")}
        super().__init__(fields | {name: facts[name] for name in ("products", "photos")}, native, lab)


class Plan:
    """The predicted cost and error of a verb on a rig: the answer of :meth:`krylux.Lab.plan`.

    Every array has one entry for each trial, whose noise is its own; their spread is that of the prediction.

    Attributes
    ----------
    verb : str
        ``"segment"``, ``"compensate"`` or ``"eigs"``.
    photos, patterns, frames : numpy.ndarray
        ``uint64[t]``: products that the method takes, distinct patterns that are shown, and frames of the camera.
    seconds : numpy.ndarray
        ``float64[t]``: seconds on the rig.
    figures : dict of str to numpy.ndarray
        ``float64[t]`` by name: adjusted Rand indices of the groups, residuals of a compensation, or errors of eigenvalues.
    ideal : dict
        What the figures are held against: the answer with ideal devices.
    trials : list of dict
        The trials with all that is known of them.
    """

    def __init__(self, fields):
        self.__dict__.update(fields)

    def __repr__(self):
        return (f"<Plan of {self.verb}: {self.photos.mean():.0f} photos, {self.frames.mean():.0f} frames, "
                f"{self.seconds.mean():.1f} s on the rig; the mean of {len(self.seconds)} trials>")

    def _repr_html_(self):
        costs = {"photos": self.photos, "patterns": self.patterns, "frames": self.frames, "seconds": self.seconds}
        rows = "".join(
            f"<tr><td>{_display.text(name)}</td><td>{values.mean():.4g}</td><td>{values.min():.4g}</td>"
            f"<td>{values.max():.4g}</td></tr>"
            for name, values in {**costs, **self.figures}.items() if len(values)
        )
        head = "<tr><th></th><th>mean</th><th>least</th><th>largest</th></tr>"
        return _display.page("Plan", repr(self).strip("<>"), f"<table>{head}{rows}</table>")
