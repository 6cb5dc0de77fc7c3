"""The verbs about light itself: compensation, probing and relighting."""

import numpy as np

from . import _checks, _declared, answers
from ._questions import compensate_question


class Lighting:
    """Questions about the light of a scene; a base of :class:`krylux.Lab`."""

    def compensate(self, target, *, method=None, photos=None, rtol=None, floor=0.0, lift=None, peak=None,
                   precondition=None, defocus=None, out_of_focus=False, paper=False, crosstalk=None, unmix=False,
                   compare_methods=False, model=None):
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
        model : path
            The folder of a run on this source, of :meth:`relight` or of any verb that keeps its photos: a model of the light
            answers, and ``photos`` only correct it.

        Returns
        -------
        krylux.answers.Compensation

        References
        ----------
        O'Toole and Kutulakos, section 6.
        """
        target, question = compensate_question(self, locals())
        return answers.Compensation(*self._native.compensate(target, question), self)

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
