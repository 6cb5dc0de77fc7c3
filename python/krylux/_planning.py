"""Plans: what a verb will cost on a rig, and how good its answer will be."""

import inspect

import numpy as np

from . import _checks, answers
from ._asking import Asking
from ._questions import compensate_question, eigs_question, segment_question


class Planning(Asking):
    """Questions about questions; a base of :class:`krylux.Lab`."""

    def plan(self, verb, *arguments, trials=3, **options):
        """Predicts photos, time and error of a verb on a rig, by runs on the rig's virtual twin.

        The twin is the virtual rig with all faults that its file gives it, in front of light transport that is known
        exactly. Each trial takes the whole measurement on it with noise of its own, and its answer is compared with that
        of ideal devices. Nothing is taken from a photo budget, and no folder is needed.

        Parameters
        ----------
        verb : str
            ``"segment"``, ``"compensate"`` or ``"eigs"``.
        *arguments, **options
            Those of :meth:`segment`, :meth:`compensate` or :meth:`eigs`, such as ``groups=[2], photos=40``. What those
            do beside their answer is not planned: evidence, features, blur, direct light that is measured, colours,
            models, and comparisons of methods.
        trials : int
            Runs on the twin.

        Returns
        -------
        krylux.answers.Plan

        Raises
        ------
        krylux.errors.OptionError
            The source is no rig, there is no such verb, or an argument cannot be planned.
        krylux.errors.DataError
            The rig's devices are real, so that there is no twin.

        Examples
        --------
        >>> lab = krylux.open("assets/rigs/realistic.toml")             # doctest: +SKIP
        >>> lab.plan("segment", [2], photos=40).seconds.mean()          # doctest: +SKIP
        """
        known = {"segment": self.segment, "compensate": self.compensate, "eigs": self.eigs}
        if verb not in known:
            raise _checks.refuse("verb", f"there is no plan of {verb!r}", 'give "segment", "compensate" or "eigs"')
        trials = _checks.count(trials, "trials")
        bound = inspect.signature(known[verb]).bind(*arguments, **options)
        bound.apply_defaults()
        asked = bound.arguments
        _refuse_beside(verb, asked)
        if verb == "segment":
            found = self._native.plan_segment(segment_question(self, asked), trials)
        elif verb == "compensate":
            target, question = compensate_question(self, asked)
            if target.ndim == 3:
                raise _checks.refuse("target", "it is coloured, and a plan is of gray light", "give an array of H×W")
            found = self._native.plan_compensate(target, question, trials)
        else:
            part = asked.pop("part")
            asked["photos"] = self._budget(asked["photos"], 50)
            _checks.vectors(asked["block"], "block", self._pixels)
            found = self._native.plan_eigs(part, eigs_question(**asked, seed=self.seed), trials)
        return answers.Plan(found)


#: Arguments of a verb that a plan has no use for.
_BESIDE = {
    "segment": ("blur", "features", "evidence"),
    "compensate": ("peak", "crosstalk", "unmix", "compare_methods", "model"),
    "eigs": (),
}


def _refuse_beside(verb, asked):
    for option in _BESIDE[verb]:
        given = asked[option]
        if given is not None and np.size(given) > 0 and (np.ndim(given) > 0 or bool(given)):
            raise _checks.refuse(option, f"it is no part of a plan of {verb}", "leave it out")
    if asked.get("direct", "source") not in ("source", "keep"):
        raise _checks.refuse("direct", f"{asked['direct']!r} is no part of a plan", 'give "source" or "keep"')
