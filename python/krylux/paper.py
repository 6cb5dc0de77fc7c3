"""The figures of the paper, made again: what ``krylux reproduce`` does.

The paper is O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*. Pixels and numbers of
photos are the paper's where it states them (sections 8.2 and 8.3), and ours elsewhere. The scenes, which are made in
memory, and all bounds are ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from . import _checks, _display, _krylux, _progress


class Figure:
    """A figure that was made again.

    Attributes:
        name, title, statement: ``"fig4"``, its subject, and what the paper says, in our words.
        rig: ``"ideal"`` or ``"virtual"``: what took the photos.
        setting: Scene, pixels and photos.
        checks: Every measured number: ``what``, ``value``, ``bound`` (``"at least"``, ``"at most"``, ``"stated"``),
            ``limit``, ``met``, ``cause``, and ``wrong``, the name and the score of a wrong answer, which must miss the
            bound, or ``None``.
        met: Whether every number keeps its bound.
        panels: The pictures: ``values`` ``float64[H, W]`` (``uint8[H, W]`` of labels, where 255 is masked), ``kind``
            (``"labels"``, ``"signed"``, ``"amounts"``, ``"light"``), ``caption`` with the unit, and ``white``, the
            value that is shown as white, or ``None``.
        plots: ``lines``, a list of ``(name, float64[n, 2])``; ``x_label``, ``y_label``, ``logarithmic``, ``marks`` and
            ``caption``.
        strips: The photos of a run in order: ``patterns`` and ``photos``, ``float64[k, H, W]``, and ``caption``.
        photos: Photos that its result took: products with the light transport matrix.
        seconds: How long it took, tracing included.
    """

    name: str
    title: str
    statement: str
    rig: Literal["ideal", "virtual"]
    setting: str
    checks: list[dict[str, Any]]
    met: bool
    panels: dict[str, dict[str, Any]]
    plots: list[dict[str, Any]]
    strips: list[dict[str, Any]]
    photos: int
    seconds: float

    def __init__(self, fields: dict[str, Any]) -> None:
        self.__dict__.update(fields)

    def __repr__(self) -> str:
        return f"<{self.title} ({self.rig} rig): {'met' if self.met else 'not met'}, {self.photos} photos>"

    def _repr_html_(self) -> str:
        pictures = [_display.Picture(_paint(panel), panel["caption"]) for panel in self.panels.values()]
        return _display.page(self.title, f"{self.statement} Here: {self.setting}", *pictures)


class Reproduction:
    """Figures that were made again: the answer of :func:`krylux.reproduce`.

    Attributes:
        figures: The figures, in the paper's order; with both rigs first those of the ideal one.
        met: Whether every number keeps its bound. The bounds hold for figures of full size only.
        status: The same as a sentence.
        quick: Whether they are small and noisy.
    """

    figures: list[Figure]
    met: bool
    status: str
    quick: bool

    def __init__(self, fields: dict[str, Any], native: _krylux.Figures, quick: bool) -> None:
        pairs = zip(fields["figures"], fields["summary"], strict=True)
        self.figures = [Figure(about | figure) for figure, about in pairs]
        self.met = all(figure.met for figure in self.figures)
        self.status, self.quick = fields["status"], bool(quick)
        self._native: _krylux.Figures | None = native

    def __getitem__(self, name: str) -> Figure:
        """The figure of this name; with both rigs that of the ideal one."""
        for figure in self.figures:
            if figure.name == name:
                return figure
        raise KeyError(name)

    def save(self, folder: _checks.FilePath | None = None, *, overwrite: bool = False) -> Path:
        """Writes what ``krylux reproduce`` leaves: ``report.html``, ``figures.json`` and every picture.

        Args:
            folder: The folder. Default: a new one, ``out/reproduce``.
            overwrite: Use a folder that holds an earlier run.

        Returns: The folder.

        Raises:
            krylux.errors.OptionError: The folder holds an earlier run.
            krylux.errors.WriteError: A file cannot be written.
            krylux.errors.ClosedError: It was pickled: the process that made the figures writes them.
        """
        if self._native is None:
            raise _checks.closed("the figures were made by another process", "save them there")
        return self._native.save(folder, overwrite)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_native": None}

    def __repr__(self) -> str:
        return f"<Reproduction: {len(self.figures)} figures; {self.status}>"

    def _repr_html_(self) -> str:
        return _display.page("The paper's figures", self.status, *(figure._repr_html_() for figure in self.figures))


def reproduce(
    figures: str | Sequence[str] = "all", *, rig: Literal["ideal", "virtual", "both"] = "ideal", quick: bool = False,
    adapter: str | None = None, progress: _progress.Progress = None,
) -> Reproduction:
    """Makes figures of the paper again, and holds each number to its bound.

    Args:
        figures: ``"fig2"``, ``"fig4"``, ``"fig5"``, ``"fig6"``, or ``"fig8"`` to ``"fig13"``; or ``"all"``, which takes
            minutes.
        rig: ``"ideal"``: photos without devices' faults; ``"virtual"``: through a projector of 8 bits and a camera of
            14 with their usual faults, calibrated from captures; ``"both"``: one after the other.
        quick: A third of the pixels per side and a quarter of the light paths: to see that everything runs. The bounds
            do not hold there.
        adapter: Part of the name of the graphics adapter.
        progress: As in :func:`krylux.open`.

    Raises:
        krylux.errors.OptionError: There is no such figure or rig.
        krylux.errors.NoAdapterError: The figures are traced, and there is no Vulkan driver.

    References: O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*.
    """
    names = [figures] if isinstance(figures, str) else [*figures]
    if not names:
        raise _checks.refuse("figures", "none is asked for", 'name some, or give "all"')
    names = [] if "all" in names else names
    return Reproduction(*_krylux.reproduce(names, rig, bool(quick), adapter, _progress.choose(progress)), quick)


def _paint(panel: dict[str, Any]) -> Any:
    painters = {"labels": _display.groups, "signed": _display.signed}
    return painters.get(panel["kind"], _display.light)(panel["values"])
