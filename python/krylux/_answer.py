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
    """

    def __init__(self, fields, native=None, lab=None):
        self.__dict__.update(fields)
        self._native = native
        self._lab = lab

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

    def __getstate__(self):
        # Arrays and numbers; what saves them stays in this process.
        return {**self.__dict__, "_native": None, "_lab": None}

    def __setstate__(self, state):
        self.__dict__.update(state)

    def __repr__(self):
        status = self.__dict__.get("status", "")
        return f"<{type(self).__name__}: {status}>"
