"""The verbs about light itself: separation, probing and relighting."""

import numpy as np

from . import _checks, answers


class Lighting:
    """Questions about the light of a scene; a base of :class:`krylux.Lab`."""

    def separate(self, by=None, *, square=2, shifts=4, period=4.0, phases=3, photos=None, sigma=None, probes=None,
                 bounces=False, compare=False, max_error=None):
        """Separates direct and global light under white.

        Parameters
        ----------
        by : str
            ``"exact"``, ``"checkerboards"``, ``"sinusoids"``, ``"codes"``, ``"random"`` or ``"capture"``. Default: exact
            on scenes, checkerboards on rigs.
        square, shifts : int
            Pixels of a checkerboard's squares, and places that they are shifted to in each direction.
        period : float
            Pixels of a sinusoid's wave.
        phases : int
            Photos of a sinusoid in each of two directions.
        photos : int
            Photos of random patterns or of the capture (default 40), or of codes (4, 8, 16 and so on; default 16).
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
        if by == "codes" and photos is None:
            # A run may have any number of photos, and codes need a power of two.
            photos = 16
        question = {
            "by": by,
            "square": _checks.count(square, "square"),
            "shifts": _checks.count(shifts, "shifts"),
            "period": _checks.finite(period, "period"),
            "phases": _checks.count(phases, "phases"),
            "photos": _checks.vectors(self._budget(photos, 40), "photos", self._pixels),
            "sigma": _checks.maybe(_checks.finite, sigma, "sigma", 0.0),
            "probes": _checks.maybe(_checks.count, probes, "probes", 0),
            "bounces": bool(bounces),
            "compare": bool(compare),
            "max_error": _checks.maybe(_checks.finite, max_error, "max_error"),
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
        sigma = _checks.maybe(_checks.finite, sigma, "sigma", 0.0)
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
        for option, value in (("photos", photos), ("block", block), ("max_error", max_error)):
            if self._has_model and value is not None:
                fault = f"{self.name} holds a model that is captured already, and no scene to compare it with"
                raise _checks.refuse(option, fault, "leave it out, or open the scene or the rig")
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
        block = _checks.maybe(_checks.vectors, block, "block", self._pixels)
        max_error = _checks.maybe(_checks.finite, max_error, "max_error")
        return answers.Relighting(*self._native.relight(*asked, (self._budget(photos, 40), block, max_error)), self)
