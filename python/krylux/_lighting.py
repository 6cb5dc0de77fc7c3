"""The verbs about light itself: probing and relighting."""

import numpy as np

from . import _checks, _declared, answers


class Lighting:
    """Questions about the light of a scene; a base of :class:`krylux.Lab`."""

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
        if patterns is None:
            patterns = {"white": np.ones(self.projector_shape, np.float32)}

        def named(of, option, size):
            return [(name, _checks.picture(array, f"{option}[{name!r}]", size, self.channels))
                    for name, array in dict(of or {}).items()]

        asked = [
            named(patterns, "patterns", self.projector_shape),
            named(duals, "duals", self.shape),
            named(photographs, "photographs", self.shape),
        ]
        options = _declared.asked({"photos": photos, "block": block, "max_error": max_error})
        return answers.Relighting(*self._native.relight(asked, options), self)
