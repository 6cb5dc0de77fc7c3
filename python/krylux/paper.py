"""The figures of the paper, made again: what ``krylux reproduce`` does.

O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*, at the paper's pixels and numbers of
photos, on scenes that are made in memory.
"""

import os

from . import _checks, _display, _krylux, _progress


class Figure:
    """A figure that was made again.

    Attributes
    ----------
    name, title, statement : str
        ``"fig4"``, its subject, and what the paper says, in our words.
    rig : str
        ``"ideal"`` or ``"virtual"``: what took the photos.
    setting : str
        Scene, pixels and photos.
    checks : list of dict
        Every measured number: ``what``, ``value``, ``bound`` (``"at least"``, ``"at most"``, ``"stated"``), ``limit``
        and ``met``.
    met : bool
        Whether every number keeps its bound.
    panels : dict of str to dict
        The pictures: ``values`` ``float64[H, W]`` (``uint8[H, W]`` of labels, where 255 is masked), ``kind``
        (``"labels"``, ``"signed"``, ``"amounts"``, ``"light"``), ``caption`` with the unit, and ``white``, the value that
        is shown as white, or ``None``.
    plots : list of dict
        ``lines``, a list of ``(name, float64[n, 2])``; ``x_label``, ``y_label``, ``logarithmic``, ``marks`` and
        ``caption``.
    strips : list of dict
        The photos of a run in order: ``patterns`` and ``photos``, ``float64[k, H, W]``, and ``caption``.
    photos : int
        Photos that its result took: products with the light transport matrix.
    seconds : float
        How long it took, tracing included.
    """

    def __init__(self, fields):
        self.__dict__.update(fields)

    def __repr__(self):
        return f"<{self.title} ({self.rig} rig): {'met' if self.met else 'not met'}, {self.photos} photos>"

    def _repr_html_(self):
        pictures = [_display.image(_paint(panel), panel["caption"]) for panel in self.panels.values()]
        return _display.page(self.title, f"{self.statement} Here: {self.setting}", *pictures)


class Reproduction:
    """Figures that were made again: the answer of :func:`krylux.reproduce`.

    Attributes
    ----------
    figures : list of Figure
        The figures, in the paper's order; with both rigs first those of the ideal one.
    met : bool
        Whether every number keeps its bound. The bounds hold for figures of full size only.
    status : str
        The same as a sentence.
    quick : bool
        Whether they are small and noisy.
    """

    def __init__(self, fields, native):
        self.figures = [
            Figure({**figure, "checks": about["checks"]})
            for figure, about in zip(fields["figures"], fields["summary"])
        ]
        self.met = all(figure.met for figure in self.figures)
        self.status = fields["status"]
        self.quick = fields["quick"]
        self._native = native

    def __getitem__(self, name):
        """The figure of this name; with both rigs that of the ideal one."""
        for figure in self.figures:
            if figure.name == name:
                return figure
        raise KeyError(name)

    def save(self, folder=None, *, overwrite=False):
        """Writes what ``krylux reproduce`` leaves: ``report.html``, ``figures.json`` and every picture.

        Parameters
        ----------
        folder : path, optional
            The folder. Default: a new one, ``out/reproduce``.
        overwrite : bool
            Use a folder that holds an earlier run.

        Returns
        -------
        pathlib.Path
            The folder.

        Raises
        ------
        krylux.errors.OptionError
            The folder holds an earlier run.
        krylux.errors.WriteError
            A file cannot be written.
        krylux.errors.ClosedError
            It was pickled: the process that made the figures writes them.
        """
        if self._native is None:
            raise _checks.closed("the figures were made by another process", "save them there")
        return self._native.save(None if folder is None else os.fspath(folder), overwrite)

    def __getstate__(self):
        return {**self.__dict__, "_native": None}

    def __repr__(self):
        return f"<Reproduction: {len(self.figures)} figures; {self.status}>"

    def _repr_html_(self):
        return _display.page("The paper's figures", self.status, *(figure._repr_html_() for figure in self.figures))


def reproduce(figures="all", *, rig="ideal", quick=False, adapter=None, progress=None):
    """Makes figures of the paper again, and holds each number to its bound.

    Parameters
    ----------
    figures : str or sequence of str
        ``"fig2"``, ``"fig4"``, ``"fig5"``, ``"fig6"``, or ``"fig8"`` to ``"fig13"``; or ``"all"``, which takes minutes.
    rig : str
        ``"ideal"``: photos without devices' faults; ``"virtual"``: through a projector of 8 bits and a camera of 14 with
        their usual faults, calibrated from captures; ``"both"``: one after the other.
    quick : bool
        A third of the pixels per side and a quarter of the light paths: to see that everything runs. The bounds do not
        hold there.
    adapter : str, optional
        Part of the name of the graphics adapter.
    progress : bool or callable
        As in :func:`krylux.open`.

    Returns
    -------
    krylux.paper.Reproduction

    Raises
    ------
    krylux.errors.OptionError
        There is no such figure or rig.
    krylux.errors.NoAdapterError
        The figures are traced, and there is no Vulkan driver.

    References
    ----------
    O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*.
    """
    names = [figures] if isinstance(figures, str) else [*figures]
    if not names:
        raise _checks.refuse("figures", "none is asked for", 'name some, or give "all"')
    question = {
        "figures": [] if "all" in names else names,
        "rig": rig,
        "quick": bool(quick),
        "adapter": adapter,
        "progress": _progress.choose(progress),
        "log": _progress.log,
    }
    return Reproduction(*_krylux.reproduce(question))


def _paint(panel):
    if panel["kind"] == "labels":
        return _display.groups(panel["values"])
    return (_display.signed if panel["kind"] == "signed" else _display.light)(panel["values"])
