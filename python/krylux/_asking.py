"""The verbs of a laboratory: what the command line asks, as methods that return arrays."""

import numpy as np

from . import _checks, answers


class Asking:
    """The questions that a laboratory answers; the base of :class:`krylux.Lab`."""

    def segment(self, groups=(), *, photos=None, starts=None, eigenvectors=10, cut="normalized", mu=0.0,
                mask_below=0.01, direct="source", direct_photos=16, direct_square=4, blur=0.0, features=(),
                evidence=False):
        """Segments the scene by how light travels in it: pixels that exchange light form a group.

        Parameters
        ----------
        groups : int or sequence of int
            Numbers of groups, all from the same photos. Default: as many as the light shows regions.
        photos : int
            Photos to take at most. Default 50, or as many as the run that is the source might take.
        starts : int
            Patterns that the photos start from; 1 is the paper's process. Default: a quarter of the photos, up to 12.
        eigenvectors : int
            Eigenvectors that the groups are made from.
        cut : str
            ``"normalized"`` or ``"average"``.
        mu : float
            Added to every edge of the graph, in units of ``A``.
        mask_below : float
            Masks pixels with less than this share of the median global light.
        direct : str
            How direct light is kept apart: ``"source"``, ``"patterns"``, ``"estimator"``, or ``"keep"``.
        direct_photos, direct_square : int
            Photos of direct light where it is measured, and the side in pixels of the squares of ``"patterns"``.
        blur : float
            Standard deviation in pixels by which patterns and photos are blurred.
        features : sequence of (int, int)
            Pixels, as ``(column, row)``, whose places in the space of eigenvectors are wanted.
        evidence : bool
            Light each group alone, one more photo for each.

        Returns
        -------
        krylux.answers.Segmentation

        References
        ----------
        O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*, section 5.
        """
        groups = [groups] if np.ndim(groups) == 0 else list(groups)
        question = {
            "photos": self._budget(photos, 50),
            "groups": [_checks.count(number, "groups") for number in groups],
            "starts": self._starts(starts),
            "eigenvectors": _checks.count(eigenvectors, "eigenvectors"),
            "cut": cut,
            "mu": _checks.finite(mu, "mu"),
            "mask_below": _checks.finite(mask_below, "mask_below"),
            "direct": direct,
            "direct_photos": _checks.count(direct_photos, "direct_photos"),
            "direct_square": _checks.count(direct_square, "direct_square"),
            "blur": _checks.finite(blur, "blur"),
            "features": [tuple(_checks.count(side, "features", 0) for side in pixel) for pixel in features],
            "evidence": bool(evidence),
            "seed": self.seed,
        }
        return answers.Segmentation(*self._native.segment(question), self)

    def eigs(self, count=6, *, part="full", which="la", photos=None, tolerance=None, method="lanczos", block=2,
             max_basis=None):
        """Computes eigenvalues and eigenvectors of one part of the light transport matrix.

        Parameters
        ----------
        count : int
            How many eigenpairs.
        part : str
            ``"full"``, ``"direct"`` or ``"global"`` light.
        which : str
            ``"la"``, ``"sa"``, ``"lm"``, ``"sm"``, ``"be"`` or ``"li"``, as in ARPACK.
        photos : int
            Photos to take at most. Default 50, or as many as the run that is the source might take.
        tolerance : float
            Done when each residual norm is at most this share of the matrix norm. Default 1e-8, or the photos' noise.
        method : str
            ``"lanczos"``, ``"block-lanczos"``, ``"arnoldi"`` or ``"power"``.
        block : int
            Vectors in the block of ``"block-lanczos"``.
        max_basis : int
            The most basis vectors to keep, by restarts.

        Returns
        -------
        krylux.answers.Eigenpairs

        References
        ----------
        O'Toole and Kutulakos, section 3.
        """
        question = eigs_question(count=count, which=which, photos=self._budget(photos, 50), tolerance=tolerance,
                                 method=method, block=block, max_basis=max_basis, seed=self.seed)
        fields, native = self._native.eigs(part, question)
        return answers.Eigenpairs({**columns(fields), "shape": self.projector_shape}, native, self)

    def solve(self, b, *, method="minres", photos=50, rtol=1e-6, lower=0.0, upper=1.0):
        """Solves ``A x = b`` with the matrix of the first channel.

        Parameters
        ----------
        b : array_like
            An entry for each pixel of a photo.
        method : str
            A name of ``krylux solve --method``, such as ``"minres"``, ``"gmres"``, ``"lsqr"`` or ``"krylov-box"``.
        photos : int
            Products to take at most.
        rtol : float
            Done when ``‖b − A x‖ ≤ rtol ‖b‖``.
        lower, upper : float
            The box of the methods that keep one.

        Returns
        -------
        krylux.answers.Solution
        """
        rhs = _checks.vector(b, "b", self.shape[0] * self.shape[1])
        bounds = (_checks.finite(lower, "lower"), _checks.finite(upper, "upper"))
        question = (_checks.count(photos, "photos"), _checks.finite(rtol, "rtol", 0.0), *bounds)
        return answers.Solution(*self._native.solve(method, rhs, question), self)

    def compensate(self, target, *, method=None, photos=None, rtol=None, floor=0.0, lift=None, peak=None,
                   precondition=None, defocus=None, out_of_focus=False, paper=False, crosstalk=None, unmix=False,
                   compare_methods=False):
        """Finds what to project, so that the scene looks like a target.

        Parameters
        ----------
        target : array_like
            ``[H, W]`` or ``[H, W, 3]`` of the camera's pixels, in [0, 1] of ``peak``.
        method : str
            Default ``"krylov-box"``; see ``krylux compensate --method``.
        photos : int
            Photos that the method may take, beside the white one. Default 20.
        rtol : float
            Done when what is seen differs from the target by at most this share of it. Default 0.001.
        floor : float
            The least that is projected.
        lift : float
            Moves the target's values from [0, 1] to [lift, 1].
        peak : float
            The radiance that 1 in the target stands for. Default: half the median of the white photo.
        precondition : str
            ``"none"``, ``"diagonal"``, ``"multiscale"``, ``"direct"``, ``"geometry"`` or ``"defocus"``; for methods without
            a box.
        defocus : float
            The width of the lens' blur in pixels, for ``"defocus"``.
        out_of_focus : bool
            Some lens is out of focus.
        paper : bool
            The paper's recipe: five photos of MINRES, preconditioned by the direct image.
        crosstalk : array_like or "measure"
            ``[3, 3]``: what each camera channel sees of each projector colour; or measured by three photos more.
        unmix : bool
            Solve each channel by itself, and un-mix the colours afterwards.
        compare_methods : bool
            Give every other method as many photos.

        Returns
        -------
        krylux.answers.Compensation

        References
        ----------
        O'Toole and Kutulakos, section 6.
        """
        target = _checks.picture(target, "target", self.shape, self.channels)
        if target.min() < 0 or target.max() > 1:
            fault = f"its values are from {target.min():g} to {target.max():g}, but a target's are from 0 to 1"
            raise _checks.refuse("target", fault, "scale it, and say by peak what 1 stands for")
        if target.max() == 0:
            raise _checks.refuse("target", "it is black", "give an image with light in it")
        measure = isinstance(crosstalk, str) and crosstalk == "measure"
        if crosstalk is not None and self.channels == 1:
            raise _checks.refuse("crosstalk", "gray light has no colours to mix", "open the source with channels=\"rgb\"")
        question = {
            "method": method,
            "photos": self._photos_of_run if photos is None else _checks.count(photos, "photos", 0),
            "rtol": rtol,
            "floor": _checks.finite(floor, "floor"),
            "lift": lift,
            "peak": peak,
            "precondition": precondition,
            "defocus": defocus,
            "out_of_focus": bool(out_of_focus),
            "paper": bool(paper),
            "measure_crosstalk": measure,
            "crosstalk": None if measure or crosstalk is None else _three_by_three(crosstalk),
            "unmix": bool(unmix),
            "compare_methods": bool(compare_methods),
        }
        return answers.Compensation(*self._native.compensate(target, question), self)

    def separate(self, by=None, *, square=2, shifts=4, period=4.0, phases=3, photos=None, sigma=None, probes=None,
                 bounces=False, compare=False, max_error=None):
        """Separates direct and global light under white.

        Parameters
        ----------
        by : str
            ``"exact"``, ``"checkerboards"``, ``"sinusoids"``, ``"random"`` or ``"capture"``. Default: exact on scenes,
            checkerboards on rigs.
        square, shifts : int
            Pixels of a checkerboard's squares, and places that they are shifted to in each direction.
        period : float
            Pixels of a sinusoid's wave.
        phases : int
            Photos of a sinusoid in each of two directions.
        photos : int
            Photos of random patterns or of the capture. Default 40.
        sigma : float
            How far light counts as near, in pixels. Default: a sixteenth of the width.
        probes : int
            Photos that tell near from far global light. Default: 100 on scenes, none on rigs.
        bounces : bool
            The second bounce and the rest; open the source with ``split_bounces=True``.
        compare : bool
            Compare every method at several numbers of photos (scenes only).
        max_error : float
            The largest error of the direct light that is good enough (scenes only).

        Returns
        -------
        krylux.answers.Separation
        """
        question = {
            "by": by,
            "square": _checks.count(square, "square"),
            "shifts": _checks.count(shifts, "shifts"),
            "period": _checks.finite(period, "period"),
            "phases": _checks.count(phases, "phases"),
            "photos": self._budget(photos, 40),
            "sigma": sigma,
            "probes": probes,
            "bounces": bool(bounces),
            "compare": bool(compare),
            "max_error": max_error,
        }
        return answers.Separation(*self._native.separate(question), self)

    def probe(self, paths="indirect", *, sigma=None, photos=None):
        """Takes a photo of which only some light paths are let through.

        Parameters
        ----------
        paths : str
            ``"direct"``, ``"indirect"``, ``"near"``, ``"far"`` or ``"near-indirect"``.
        sigma : float
            Near light is weighted by ``exp(−d²/2σ²)`` of the distance ``d`` in pixels. Default: a sixteenth of the width.
        photos : int
            Random patterns. Default 100.

        Returns
        -------
        krylux.answers.Probing
        """
        return answers.Probing(*self._native.probe(paths, sigma, self._budget(photos, 100)), self)

    def relight(self, patterns=None, *, duals=None, photographs=None, photos=None, block=None, max_error=None):
        """Captures the light transport in a few dozen photos, and answers by the model; a run answers without any photo.

        Parameters
        ----------
        patterns : dict of str to array_like
            Patterns of the projector's pixels to relight with. Default: white.
        duals : dict of str to array_like
            Patterns of the camera's pixels, for dual photographs.
        photographs : dict of str to array_like
            Photos to take the interreflections out of.
        photos : int
            Photos of the capture. Default 40.
        block : int
            Patterns that are chosen beforehand; 1 is white alone. Default 12.
        max_error : float
            The largest error of a relit photo that is good enough (scenes only).

        Returns
        -------
        krylux.answers.Relighting

        References
        ----------
        O'Toole and Kutulakos, *Optical computing for fast light transport analysis* (2010).
        """
        if patterns is None:
            patterns = {"white": np.ones(self.projector_shape, np.float32)}

        def named(of, option, size):
            return [(name, _checks.picture(array, f"{option}[{name!r}]", size, self.channels))
                    for name, array in dict(of or {}).items()]

        asked = (
            named(patterns, "patterns", self.projector_shape),
            named(duals, "duals", self.shape),
            named(photographs, "photographs", self.shape),
        )
        block = None if block is None else _checks.count(block, "block")
        return answers.Relighting(*self._native.relight(*asked, (self._budget(photos, 40), block, max_error)), self)

    def audit(self, *, patterns=6, tolerance=0.01, asymmetry=0.1):
        """Checks that the source is the linear, symmetric operator that every other method takes it for.

        Parameters
        ----------
        patterns : int
            Random patterns; symmetry is judged by all pairs of them.
        tolerance : float
            Relative deviation from additivity, homogeneity and repeatability that passes.
        asymmetry : float
            ``‖A − Aᵀ‖/‖A‖`` that passes.

        Returns
        -------
        krylux.answers.Audit
        """
        question = (_checks.count(patterns, "patterns"), _checks.finite(tolerance, "tolerance", 0.0),
                    _checks.finite(asymmetry, "asymmetry", 0.0))
        return answers.Audit(*self._native.audit(*question), self)

    def _budget(self, photos, default):
        """The photos that were given, or those of the run, or a default."""
        return _checks.count(self._photos_of_run or default if photos is None else photos, "photos")

    def _starts(self, starts):
        if starts is None and self._photos_of_run is not None:
            # Fewer photos of a run than it has ask for the same patterns.
            return min(max((self._photos_of_run - 2) // 4, 1), 12)
        return None if starts is None else _checks.count(starts, "starts")


def eigs_question(*, count, which, photos, tolerance, method, block, max_basis, seed, noise=0.0, start=None, deflate=()):
    """What the native part asks of eigenpairs."""
    return {
        "count": _checks.count(count, "count"),
        "which": which,
        "photos": _checks.count(photos, "photos"),
        "tolerance": None if tolerance is None else _checks.finite(tolerance, "tolerance", 0.0),
        "method": method,
        "block": _checks.count(block, "block"),
        "max_basis": None if max_basis is None else _checks.count(max_basis, "max_basis"),
        "noise": _checks.finite(noise, "noise", 0.0),
        "seed": _checks.count(seed, "seed", 0),
        "start": start,
        "deflate": list(deflate),
    }


def columns(fields):
    """Eigenvectors as columns, as SciPy has them."""
    return {**fields, "vectors": fields["vectors"].T, "imaginary_vectors": fields["imaginary_vectors"].T}


def _three_by_three(crosstalk):
    matrix = _checks.real_array(crosstalk, "crosstalk", np.float64)
    if matrix.shape != (3, 3):
        raise _checks.refuse("crosstalk", f"its shape is {matrix.shape}", "give an array of 3 × 3, or \"measure\"")
    return matrix.tolist()
