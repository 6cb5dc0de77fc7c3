"""What a laboratory answers about rigs: plans, one scene through several devices, and calibration."""

import inspect
import os

from . import _checks, answers
from ._asking import Asking
from ._declared import asked as as_json, pictures_apart


class OnRigs(Asking):
    """Questions about rigs; a base of :class:`krylux.Lab`."""

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
        planned = {"segment": self._native.plan_segment, "eigs": self._native.plan_eigs}
        if verb in planned:
            return answers.Plan(planned[verb](as_json(bound.arguments), trials))
        given, pictures = pictures_apart(self, bound.arguments, ("target",))
        if any(array.ndim == 3 for _, _, array in pictures):
            raise _checks.refuse("target", "it is coloured, and a plan is of gray light", "give an array of H×W")
        pictures = [(field, name, array.astype("float64")) for field, name, array in pictures]
        return answers.Plan(self._native.plan_compensate(as_json(given), pictures, trials))

    def through_rig(self, rig, *, folder=None, resume=False, overwrite=False):
        """Looks at the same scene through the virtual devices of a rig file.

        The file's own scene is left aside, and this one is not traced again. So the photos of a realistic projector and
        camera can be compared with the true light. The devices are taken as ideal where the file names no calibration,
        until :meth:`calibrate`.

        Parameters
        ----------
        rig : path
            A rig file (``.toml``) of virtual devices.
        folder, resume, overwrite
            As those of :func:`krylux.open`, for a run of the new laboratory.

        Returns
        -------
        krylux.Lab
            A laboratory of kind ``"rig"``, whose unit is DN/s. This one stays open.

        Raises
        ------
        krylux.errors.DataError
            There is no scene, or the devices are real.
        krylux.errors.OptionError
            The scene's projector has other pixels than its camera.

        Examples
        --------
        >>> exact = krylux.open("assets/scenes/corner/scene.glb", size=32)      # doctest: +SKIP
        >>> rig = exact.through_rig("assets/rigs/realistic.toml")               # doctest: +SKIP
        >>> rig.calibrate()                                                     # doctest: +SKIP
        >>> seen, light = rig.white, exact.white                                # doctest: +SKIP
        """
        path = os.path.abspath(rig)
        if not os.path.isfile(path):
            raise _checks.refuse("rig", f"there is no file {os.fspath(rig)!r}", "give a rig file (.toml)")
        lab = object.__new__(type(self))
        lab._source, lab._options, lab._is_calibrated = self._source, self._options, False
        lab._rigs = (*self._rigs, path)
        lab._hold(self._native.through_rig(path))
        if folder is not None:
            lab._native.begin_run(os.fspath(folder), bool(resume), bool(overwrite))
        elif resume or overwrite:
            raise _checks.refuse("folder", "there is none to go on with or to use anew", "name the folder")
        return lab

    def calibrate(self, *, takes=2, map=None, flat_field=False):
        """Calibrates the devices of a rig from captures alone, and takes photos by that from now on.

        Nothing is written: :func:`krylux.rig.calibrate` leaves a folder that a rig file can name. Call it before the
        first photo of a run.

        Parameters
        ----------
        takes : int
            Frames averaged for each level and pattern.
        map : str, optional
            ``"gray-code"`` or ``"checkerboard"``. Default: as the camera's pixels allow.
        flat_field : bool
            Measure also how uneven projector and camera are, by a matte sheet: a virtual rig gets one in place of its
            scene; before a real one it has to stand when the rest is done.

        Returns
        -------
        krylux.rig.Report
            ``report``, every figure with its standard error, and ``lines``, the same in words.

        Raises
        ------
        krylux.errors.OptionError
            The source is no rig.
        krylux.errors.RigError
            The rig fails, or its photos cannot be evaluated.
        """
        from .rig import Report

        found = self._native.calibrate(_checks.count(takes, "takes"), map, bool(flat_field))
        self._is_calibrated = True
        return Report(found)
