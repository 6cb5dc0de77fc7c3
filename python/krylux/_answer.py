"""What all answers have in common."""

from . import _checks


class Answer:
    """The base of all answers.

    Attributes
    ----------
    photos : int
        Photos that it took.
    status : str
        What was found, or why the method ended, as a sentence.
    findings : list of dict
        What was found of the answer and of the rig whose photos it is from: ``name``, ``grade`` (``"ok"``, ``"unmeasured"``,
        ``"warning"`` or ``"fails"``), ``found``, and where there are such ``value``, ``error``, ``bound``, ``expected`` and ``help``.
        Empty without a laboratory.
    """

    def __init__(self, fields, native=None, lab=None):
        self.__dict__.update(fields)
        self._native = native
        self._lab = lab
        self.findings = [] if lab is None or native is None else lab._findings(native)

    @property
    def passed(self):
        """Whether no finding fails. The exit status of the command line says the same."""
        return all(finding["grade"] != "fails" for finding in self.findings)

    def save(self, folder=None, *, overwrite=False):
        """Writes what the verb of the command line leaves: arrays, pictures, ``run.json`` and ``report.html``.

        Parameters
        ----------
        folder : path, optional
            The folder. By default that of the laboratory's own run, or else a new one, ``out/NAME-VERB``.
        overwrite : bool
            Use a folder that holds an earlier run.

        Returns
        -------
        pathlib.Path
            The folder.

        Raises
        ------
        krylux.errors.OptionError
            The folder holds an earlier run, or the photos of the laboratory go to another folder.
        krylux.errors.WriteError
            A file cannot be written.
        krylux.errors.ClosedError
            The laboratory is closed, or the answer was pickled and has none.
        """
        if self._lab is None:
            raise _checks.closed("the answer has no laboratory to be saved by",
                                 "save the answer in the process that asked for it")
        return self._lab._save(self._native, folder, overwrite)

    def check(self):
        """Compares the photos that the answer predicts with light that it was not computed from.

        That is light paths of another seed where the source is a scene, which takes as long as tracing it once more, and
        one more photo where it is a rig.

        Returns
        -------
        dict or None
            ``by`` (``"another-seed"`` or ``"another-photo"``); ``of``, what was predicted; ``error``,
            ``‖p − y‖/‖y‖`` without the noise of the independent photos ``y``, and ``noise``, theirs; ``verdict``, ``"passed"``,
            ``"refuted"`` or ``"too-weak"``, with its ``statistic`` in standard errors, its ``p_value``, the relative error
            ``resolution`` that would have been refuted in 99 of 100 cases, and the ``cause`` where a number tells it. Of eigenpairs and
            segmentations of scenes also ``of_scene``: for each eigenvector (of a segmentation without the first)
            ``value``, the eigenvalue of the scene as opposed to that of its noisy matrix, ``standard_error``,
            ``quotient`` (by independent light alone, with its standard error) and ``residual``. Of compensations
            ``residual``, the distance from the target by independent light, ``observed``, the photo by that light, and
            ``standard_error`` of each of its samples, both ``float32[H, W]`` or ``[H, W, 3]``. ``None`` where there is no independent
            light (runs, models, matrices) or the answer predicts no photos.

        Raises
        ------
        krylux.errors.ClosedError
            The laboratory is closed, or the answer was pickled and has none.
        """
        if self._lab is None:
            raise _checks.closed("the answer has no laboratory to be checked by",
                                 "check the answer in the process that asked for it")
        found = self._lab._check(self._native)
        if found is None:
            return None
        more = {name: found[name] for name in ("of_scene", "residual") if found[name]}
        more |= {name: found[name] for name in ("observed", "standard_error") if name in found}
        return {**found["verification"], **more}

    def __getstate__(self):
        # Arrays and numbers; what saves them stays in this process.
        return {**self.__dict__, "_native": None, "_lab": None}

    def __setstate__(self, state):
        self.__dict__.update(state)

    def __repr__(self):
        status = self.__dict__.get("status", "")
        return f"<{type(self).__name__}: {status}>"
