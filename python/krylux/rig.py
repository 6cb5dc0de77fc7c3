"""The devices of a rig file, and cameras and projectors written in Python.

A camera of Python has these members; so that a maker's own library is ten lines away::

    class MyCamera:
        name = "my-camera"           # part of every photo's key in a journal
        size = (640, 480)            # width and height
        bits = 12                    # of a count; the highest count is 2**bits - 1
        channels = 1                 # or 3
        exposures = (1e-4, 1.0)      # the shortest and the longest, in seconds

        def configure(self, exposure):      # seconds; returns what was really set, or None
            ...

        def capture(self):                  # unsigned integers [H, W] or [H, W, 3], or None where no frame came
            ...

**A frame has to be exposed after** ``capture`` **was called.** Then the pattern is on screen. Many libraries let a camera
run freely: what they return next was exposed before, and shows an earlier pattern, or half of two. There are two ways out:

* ``capture`` triggers the camera (*software trigger*), and waits for that frame. krylux measures how long the call takes:
  a frame that comes before its exposure can have passed is refused, with an error that says so.
* ``capture`` returns ``(frame, started)``, where ``started`` is the time of :func:`time.monotonic` at which the exposure
  began. The camera may run freely: frames from before the pattern had settled are refused and taken again, as those of
  krylux's own cameras are.

A camera that only computes its frames says ``simulated = True``; then nothing is measured.

A projector has ``name``, ``size``, ``bits`` (8), ``channels`` (1), ``frame_time`` (0 seconds) and ``show(levels)``,
which receives ``uint16[H, W]`` or ``[H, W, 3]`` and returns when they are on screen. A camera may also have
``restart()``, for a stream that hangs.
"""

import os
import pathlib
import types

import numpy as np

from . import _checks, _krylux, _opening
from ._declared import asked as as_json
from ._program import ProgramRig


class Report(types.SimpleNamespace):
    """Findings about a rig: attributes by name, as each function says.

    Calibration: ``folder``, ``report``, ``effort``, ``lines``. Check: ``findings``, ``passed``, ``complete``, ``status``.
    A round of alignment: ``found``, and then ``aligned``, ``disparity`` (median, 95 %, error, in projector pixels),
    ``shadow`` and ``dark`` (shares), ``offset``, ``place``, ``remedy``, ``symmetry``, ``white`` ``float64[H, W]`` and
    ``sights`` ``uint8[H, W]`` (0 lit, 1 shadow, 2 dark, 3 outside); or else ``fault`` and ``help``.
    """

    def __init__(self, fields):
        super().__init__(**fields)

    def __repr__(self):
        status = self.__dict__.get("status")
        return f"<krylux.rig.Report: {status or ', '.join(self.__dict__)}>"


def _rig(source, options):
    if not isinstance(source, ProgramRig) and not str(source).lower().endswith(".toml"):
        raise _checks.refuse("source", f"{source} is no rig", "give a rig file (.toml), or devices of Python")
    return _opening.request(source, {**_opening.DEFAULTS, **options})


def _ask(verb, source, options, asked):
    """The reports of a question to the devices of a rig."""
    reports = _krylux.ask_rig(verb, _rig(source, options), as_json(asked))
    for found in reports:
        if "folder" in found:
            found["folder"] = pathlib.Path(found["folder"])
        if "disparity" in found:
            found["disparity"] = tuple(found["disparity"][name] for name in ("median", "upper", "error"))
    return [Report(found) for found in reports]


def calibrate(source, folder=None, *, takes=2, map=None, overwrite=False, resume=False, **options):
    """Measures a rig's devices from captures alone: responses, noise, pixel map, latency, drift.

    Parameters
    ----------
    source : path or ProgramRig
        The rig.
    folder : path, optional
        Where the calibration goes. Default: what the rig file names, or ``NAME-calibration`` beside it.
    takes : int
        Frames averaged for each level and pattern.
    map : str, optional
        ``"gray-code"`` or ``"checkerboard"``. Default: Gray codes, or a checkerboard where the camera has less than 1.5
        pixels for each of the projector's along an axis.
    overwrite, resume : bool
        Calibrate anew into a folder that holds a calibration's photos, or go on with it.
    **options
        As those of :func:`krylux.open`.

    Returns
    -------
    Report
        ``folder``, ``report``, ``effort`` and ``lines``.
    """
    folder = None if folder is None else os.fspath(folder)
    if folder is None and isinstance(source, ProgramRig):
        raise _checks.refuse("folder", "devices of Python have no rig file beside which it could be", "name a folder")
    asked = {"takes": _checks.count(takes, "takes"), "map": map, "folder": folder, "overwrite": bool(overwrite),
             "resume": bool(resume)}
    [found] = _ask("calibrate", source, options, asked)
    return found


def flat_field(source, **options):
    """Measures how uneven projector and camera are, by one photo of a matte sheet, and adds it to the rig's calibration.

    Stand a matte sheet of one colour square to the camera, so that it fills the view. A virtual rig gets such a sheet in place of its
    scene. From then on patterns are divided by the projector's brightness, and photos by the camera's.

    Parameters
    ----------
    source : path
        A rig file that names its calibration.
    **options
        As those of :func:`krylux.open`.

    Returns
    -------
    Report
        ``folder`` of the calibration; ``projector`` and ``camera``, their brightness at each of the projector's pixels, row by row.
    """
    [found] = _ask("flat_field", source, options, {})
    return found


def check(source, folder="out", **options):
    """Checks a bench before a session: devices, light, frames, calibration, disk.

    Parameters
    ----------
    source : path or ProgramRig
        The rig.
    folder : path
        The folder of the session's runs; its disk is checked for free space.
    **options
        As those of :func:`krylux.open`.

    Returns
    -------
    Report
        ``findings``, ``passed``, ``complete`` and ``status``.
    """
    [found] = _ask("check", source, options, {"folder": os.fspath(folder)})
    return found


def align(source, *, rounds=1, patterns=6, asymmetry=0.1, exposure=None, **options):
    """Tells whether camera and projector are at one point, and which way the camera must go.

    Parameters
    ----------
    source : path or ProgramRig
        The rig.
    rounds : int
        Rounds of structured light.
    patterns : int
        Random patterns of each round, by whose pairs symmetry is judged; 0: not at all.
    asymmetry : float
        ``‖A − Aᵀ‖/‖A‖`` that passes.
    exposure : float, optional
        Seconds of each exposure.
    **options
        As those of :func:`krylux.open`.

    Returns
    -------
    list of Report
        One for each round.
    """
    return _ask("align", source, options, {
        "rounds": _checks.count(rounds, "rounds"),
        "patterns": _checks.count(patterns, "patterns", 0),
        "asymmetry": _checks.finite(asymmetry, "asymmetry", 0.0),
        "exposure": _checks.maybe(_checks.finite, exposure, "exposure", 0.0),
    })


def preview(source, pattern=None, *, frames=None, exposure=None, **options):
    """Shows what the camera sees, frame by frame, while somebody sets up the rig.

    Nothing is converted to light: figures are those of the camera's counts. The devices are open from the first frame
    until the loop ends.

    Parameters
    ----------
    source : path or ProgramRig
        The rig.
    pattern : array_like, optional
        ``[H, W]`` or ``[H, W, 3]`` of the projector's pixels: 0 is its lowest level, 1 its highest. Default: white.
    frames : int, optional
        Frames to take. Default: without end.
    exposure : float, optional
        Seconds of each exposure. Default: the longest of the rig file, or that at which white fills 70 % of the range.
    **options
        As those of :func:`krylux.open`.

    Yields
    ------
    Report
        ``counts`` ``uint16[H, W]`` or ``[H, W, 3]``; ``picture`` ``uint8[H, W, 3]`` in sRGB, where saturated pixels are red
        and those with a count of 0 blue; ``figures``, a dictionary of ``focus`` (higher is sharper; ``None`` for the first
        frame), ``best_focus``, ``saturated`` and ``black`` (shares of the samples), ``brightest`` (a count), ``mean`` (a
        share of the range), ``per_second`` and ``exposure`` (seconds); ``range``, the counts without light, from which
        on they are saturated, and the highest; ``status``, the figures as a line.

    Raises
    ------
    krylux.errors.OptionError
        The source is no rig, or the pattern does not have the projector's pixels.
    krylux.errors.RigError
        The rig fails.

    Examples
    --------
    >>> for frame in krylux.rig.preview("bench.toml", frames=100):      # doctest: +SKIP
    ...     print(frame.status)
    """
    frames = None if frames is None else _checks.count(frames, "frames")
    exposure = _checks.maybe(_checks.finite, exposure, "exposure", 0.0)
    if pattern is not None:
        pattern = _checks.real_array(pattern, "pattern", np.float32)
        if pattern.ndim not in (2, 3) or (pattern.ndim == 3 and pattern.shape[2] != 3):
            raise _checks.refuse("pattern", f"its shape is {pattern.shape}", "give an array of H×W or H×W×3")
    return _frames(_rig(source, options), pattern, frames, exposure)


def _frames(request, pattern, frames, exposure):
    running = _krylux.Preview(request, pattern, exposure)
    try:
        while frames is None or frames > 0:
            yield Report(running.next())
            frames = None if frames is None else frames - 1
    finally:
        running.close()


def list(source=None, *, display=None):
    """Lists the monitors and cameras that a rig file may name, and what they can do.

    Parameters
    ----------
    source : path, optional
        A rig file, whose X server and camera are queried, too.
    display : str, optional
        The X server, such as ``":0"``. Default: that of the rig file, or of ``DISPLAY``.

    Returns
    -------
    Report
        ``monitors``, dictionaries of ``name``, ``resolution``, ``place``, ``primary`` and ``frame_time``; ``cameras``,
        dictionaries of ``kind``, what identifies the camera, and ``abilities`` where they are known; ``virtual``, the
        ``projector`` and ``camera`` of a rig file whose devices are none of these, or ``None``; ``notes``, why a kind of
        device could not be searched for.

    Raises
    ------
    krylux.errors.OptionError
        The source is no rig file.
    krylux.errors.DataError
        The rig file is malformed.
    """
    if source is not None and not os.fspath(source).lower().endswith(".toml"):
        raise _checks.refuse("source", f"{source} is no rig file", "give a rig file (.toml), or nothing")
    asked = {"file": None if source is None else os.fspath(source), "display": display}
    return Report(_krylux.attached(as_json(asked)))
