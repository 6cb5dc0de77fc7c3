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

from __future__ import annotations

import builtins
import json
import os
import pathlib
import time
import types
from collections.abc import Generator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _checks, _declared, _krylux, lab


class _Projector(Protocol):
    @property
    def size(self) -> int | tuple[int, int]: ...
    def show(self, levels: NDArray[np.uint16], /) -> object: ...


class _Camera(Protocol):
    @property
    def size(self) -> int | tuple[int, int]: ...
    @property
    def exposures(self) -> Sequence[float]: ...
    def configure(self, exposure: float, /) -> float | None: ...
    def capture(self) -> NDArray[Any] | tuple[NDArray[Any], float] | None: ...


class ProgramRig:
    """A projector and a camera written in Python, as a source for :func:`krylux.open`.

    Each frame has to be exposed after ``capture`` was called, or to say when: see the text of :mod:`krylux.rig`.

    Args:
        projector, camera: The devices; the text of :mod:`krylux.rig` says which members they have.
        measurement: The ``[measurement]`` table of a rig file, such as ``{"exposures": [0.01], "takes": 4}``.
        calibration: The folder that a calibration was written to. Default: the devices are taken as ideal.

    Raises:
        krylux.errors.OptionError: A device lacks a member, or one has an unusable value.

    Examples:
        >>> lab = krylux.open(krylux.rig.ProgramRig(MyProjector(), MyCamera()), folder="out/mine")  # doctest: +SKIP
    """

    def __init__(self, projector: _Projector, camera: _Camera, *, measurement: Mapping[str, Any] | None = None,
                 calibration: _checks.FilePath | None = None) -> None:
        self.projector, self.camera = projector, camera
        self.measurement: dict[str, Any] = dict(measurement or {})
        self.calibration: str | None = None if calibration is None else os.path.abspath(calibration)
        _require(projector, "projector", ("size", "show"))
        _require(camera, "camera", ("size", "exposures", "configure", "capture"))

    def _description(self):
        """What the rig file says of both devices."""
        def described(kind, device):
            return {
                "name": str(getattr(device, "name", kind)),
                "size": _checks.size(device.size, f"{kind}.size"),
                "channels": _checks.count(getattr(device, "channels", 1), f"{kind}.channels"),
                "bits": _checks.count(getattr(device, "bits", 8), f"{kind}.bits"),
            }

        exposures = [_checks.finite(seconds, "camera.exposures", 0.0) for seconds in self.camera.exposures]
        frame_time = float(getattr(self.projector, "frame_time", 0.0))
        return {"projector": described("projector", self.projector) | {"frame_time": frame_time},
                "camera": described("camera", self.camera) | {"exposures": exposures}}

    def _request(self, name):
        description = self._description()
        camera = _Checked(self.camera, description["camera"])
        devices = {"projector": self.projector, "camera": camera, "description": json.dumps(description)}
        return {"source": f"{name or 'program'}.toml", "rig": self._toml(description), "devices": devices}

    def _toml(self, description):
        """The rig file that describes these devices; a run keeps it."""
        lines = ['kind = "program"']
        if self.calibration is not None:
            lines.append(f"calibration = {_toml_value(self.calibration)}")
        for table, values in (*description.items(), ("measurement", self.measurement)):
            lines.append(f"\n[{table}]")
            lines += [f"{key} = {_toml_value(value)}" for key, value in values.items()]
        return "\n".join(lines) + "\n"


#: The share of an exposure that a triggered frame takes at least. Cameras round exposures, and not all say to what.
_SOONEST = 0.9


class _Checked:
    """A camera whose frames are checked and flattened, with the seconds since their exposures began, where it says so."""

    def __init__(self, camera, about):
        self._camera = camera
        width, height = about["size"]
        self._shape = (height, width) if about["channels"] == 1 else (height, width, about["channels"])
        self._highest = 2 ** about["bits"] - 1
        self._exposure = 0.0
        self._is_simulated = bool(getattr(camera, "simulated", False))
        if hasattr(camera, "restart"):
            self.restart = camera.restart

    def configure(self, exposure):
        set_ = self._camera.configure(exposure)
        self._exposure = float(exposure if set_ is None else set_)
        return self._exposure

    def capture(self):
        called = time.monotonic()
        frame = self._camera.capture()
        took = time.monotonic() - called
        if frame is None:
            return None
        if isinstance(frame, tuple):
            frame, started = self._timed(frame)
        elif self._is_simulated or took >= _SOONEST * self._exposure:
            started = None
        else:
            fault = (f"it returned a frame after {took:.2g} s, but an exposure takes {self._exposure:.2g} s: the frame was "
                     "exposed before it was asked for, and may show an earlier pattern")
            raise _checks.refuse("camera.capture", fault, "trigger the camera, or return (frame, started) with the time "
                                 "of time.monotonic() at which the exposure began; a camera that computes its frames says "
                                 "simulated = True")
        flat = self._flat(frame)
        return flat, None if started is None else max(time.monotonic() - started, 0.0)

    def _timed(self, answer):
        """``(frame, started)``, checked."""
        help = "return (frame, started) with the time of time.monotonic() at which the exposure began"
        if len(answer) != 2:
            raise _checks.refuse("camera.capture", f"it returned {len(answer)} things", help)
        frame, started = answer
        started = _checks.finite(started, "camera.capture")
        # The frame is here: its exposure has passed, but for what the camera's clock is off.
        latest = time.monotonic() - _SOONEST * (0.0 if self._is_simulated else self._exposure)
        if started > latest:
            fault = f"its exposure began at {started:.6f} s, but only before {latest:.6f} s could it have ended by now"
            raise _checks.refuse("camera.capture", fault, help)
        return frame, started

    def _flat(self, frame):
        counts = np.asarray(frame)
        if counts.shape != self._shape or counts.dtype.kind not in "iu":
            fault = f"it returned {counts.dtype}{[*counts.shape]}"
            raise _checks.refuse("camera.capture", fault, f"return whole numbers of the shape {[*self._shape]}")
        if counts.size and (counts.min() < 0 or counts.max() > self._highest):
            fault = f"it returned counts from {counts.min()} to {counts.max()}"
            raise _checks.refuse("camera.capture", fault, f"return counts from 0 to {self._highest}, or correct bits")
        return np.ascontiguousarray(counts, dtype=np.uint16).reshape(-1)


def _require(device, kind, members):
    for member in members:
        if not hasattr(device, member):
            raise _checks.refuse(kind, f"it has no `{member}`", f"a {kind} needs {', '.join(members)}")


def _toml_value(value):
    """A number, a text or a list of them in TOML, which writes these as JSON does."""
    if value is None or isinstance(value, Mapping):
        raise _checks.refuse("measurement", f"{value!r} has no form in a rig file", "give numbers, texts, or lists of them")
    if isinstance(value, (builtins.list, tuple)) or (isinstance(value, np.ndarray) and value.ndim):
        return "[" + ", ".join(_toml_value(one) for one in value) + "]"
    return _checks.as_json("measurement", value)


_Source = _checks.FilePath | ProgramRig
if TYPE_CHECKING:
    _Map = Literal["gray-code", "checkerboard"]


class Report(types.SimpleNamespace):
    """Findings about a rig: attributes by name, as each function says.

    Calibration: ``folder``, ``report``, ``effort``, ``lines``. Check: ``findings``, ``passed``, ``complete``, ``status``.
    A round of alignment: ``found``, and then ``aligned``, ``disparity`` (median, 95 %, error, in projector pixels),
    ``shadow`` and ``dark`` (shares), ``offset``, ``place``, ``remedy``, ``symmetry``, ``white`` ``float64[H, W]`` and
    ``sights`` ``uint8[H, W]`` (0 lit, 1 shadow, 2 dark, 3 outside); or else ``fault`` and ``help``.
    """

    def __init__(self, fields: dict[str, Any]) -> None:
        super().__init__(**fields)

    def __repr__(self) -> str:
        return f"<krylux.rig.Report: {self.__dict__.get('status') or ', '.join(self.__dict__)}>"


def _rig(source, options):
    if not isinstance(source, ProgramRig) and not str(source).lower().endswith(".toml"):
        raise _checks.refuse("source", f"{source} is no rig", "give a rig file (.toml), or devices of Python")
    return lab.request(source, options)


def _ask(verb: str, request: Any, asked: dict[str, Any]) -> builtins.list[Report]:
    """The reports of a question to the devices of a rig."""
    reports = _krylux.ask_rig(verb, request, _declared.asked(asked))
    for found in reports:
        if "folder" in found:
            found["folder"] = pathlib.Path(found["folder"])
        if "disparity" in found:
            found["disparity"] = tuple(found["disparity"][name] for name in ("median", "upper", "error"))
    return [Report(found) for found in reports]


def calibrate(source: _Source, folder: _checks.FilePath | None = None, *, takes: int = 2, map: _Map | None = None,
              overwrite: bool = False, resume: bool = False, **options: Any) -> Report:
    """Measures a rig's devices from captures alone: responses, noise, pixel map, latency, drift.

    Args:
        source: The rig.
        folder: Where the calibration goes. Default: what the rig file names, or ``NAME-calibration`` beside it.
        takes: Frames averaged for each level and pattern.
        map: ``"gray-code"`` or ``"checkerboard"``. Default: Gray codes, or a checkerboard where the camera has less
            than 1.5 pixels for each of the projector's along an axis.
        overwrite, resume: Calibrate anew into a folder that holds a calibration's photos, or go on with it.
        **options: As those of :func:`krylux.open`.

    Returns: ``folder``, ``report``, ``effort`` and ``lines``.
    """
    if folder is None and isinstance(source, ProgramRig):
        raise _checks.refuse("folder", "devices of Python have no rig file beside which it could be", "name a folder")
    asked = {"takes": _checks.count(takes, "takes"), "map": map, "folder": folder, "overwrite": bool(overwrite),
             "resume": bool(resume)}
    return _ask("calibrate", _rig(source, options), asked)[0]


def flat_field(source: _checks.FilePath, **options: Any) -> Report:
    """Measures how uneven projector and camera are, by one photo of a matte sheet, and adds it to the rig's calibration.

    Stand a matte sheet of one colour square to the camera, so that it fills the view. A virtual rig gets such a sheet in place of its
    scene. From then on patterns are divided by the projector's brightness, and photos by the camera's.

    Args:
        source: A rig file that names its calibration.
        **options: As those of :func:`krylux.open`.

    Returns: ``folder`` of the calibration; ``projector`` and ``camera``, their brightness at each of the projector's
        pixels, row by row.
    """
    return _ask("flat_field", _rig(source, options), {})[0]


def check(source: _Source, folder: _checks.FilePath = "out", **options: Any) -> Report:
    """Checks a bench before a session: devices, light, frames, calibration, disk.

    Args:
        source: The rig.
        folder: The folder of the session's runs; its disk is checked for free space.
        **options: As those of :func:`krylux.open`.

    Returns: ``findings``, ``passed``, ``complete`` and ``status``.
    """
    return _ask("check", _rig(source, options), {"folder": folder})[0]


def align(source: _Source, *, rounds: int = 1, patterns: int = 6, asymmetry: float = 0.1, exposure: float | None = None,
          **options: Any) -> builtins.list[Report]:
    """Tells whether camera and projector are at one point, and which way the camera must go.

    Args:
        source: The rig.
        rounds: Rounds of structured light.
        patterns: Random patterns of each round, by whose pairs symmetry is judged; 0: not at all.
        asymmetry: ``‖A − Aᵀ‖/‖A‖`` that passes.
        exposure: Seconds of each exposure.
        **options: As those of :func:`krylux.open`.

    Returns: One for each round.
    """
    return _ask("align", _rig(source, options), {
        "rounds": _checks.count(rounds, "rounds"),
        "patterns": _checks.count(patterns, "patterns", 0),
        "asymmetry": _checks.finite(asymmetry, "asymmetry", 0.0),
        "exposure": _checks.maybe(_checks.finite, exposure, "exposure", 0.0),
    })


def preview(source: _Source, pattern: ArrayLike | None = None, *, frames: int | None = None,
            exposure: float | None = None, **options: Any) -> Generator[Report]:
    """Shows what the camera sees, frame by frame, while somebody sets up the rig.

    Nothing is converted to light: figures are those of the camera's counts. The devices are open from the first frame
    until the loop ends.

    Args:
        source: The rig.
        pattern: ``[H, W]`` or ``[H, W, 3]`` of the projector's pixels: 0 is its lowest level, 1 its highest. Default:
            white.
        frames: Frames to take. Default: without end.
        exposure: Seconds of each exposure. Default: the longest of the rig file, or that at which white fills 70 % of
            the range.
        **options: As those of :func:`krylux.open`.

    Yields: ``counts`` ``uint16[H, W]`` or ``[H, W, 3]``; ``picture`` ``uint8[H, W, 3]`` in sRGB, where saturated pixels
        are red and those with a count of 0 blue; ``figures``, a dictionary of ``focus`` (higher is sharper; ``None``
        for the first frame), ``best_focus``, ``saturated`` and ``black`` (shares of the samples), ``brightest`` (a
        count), ``mean`` (a share of the range), ``per_second`` and ``exposure`` (seconds); ``range``, the counts
        without light, from which on they are saturated, and the highest; ``status``, the figures as a line.

    Raises:
        krylux.errors.OptionError: The source is no rig, or the pattern does not have the projector's pixels.
        krylux.errors.RigError: The rig fails.

    Examples:
        >>> for frame in krylux.rig.preview("bench.toml", frames=100):      # doctest: +SKIP
        ...     print(frame.status)
    """
    frames = _checks.maybe(_checks.count, frames, "frames")
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


def list(source: _checks.FilePath | None = None, *, display: str | None = None) -> Report:
    """Lists the monitors and cameras that a rig file may name, and what they can do.

    Args:
        source: A rig file, whose X server and camera are queried, too.
        display: The X server, such as ``":0"``. Default: that of the rig file, or of ``DISPLAY``.

    Returns: ``monitors``, dictionaries of ``name``, ``resolution``, ``place``, ``primary`` and ``frame_time``;
        ``cameras``, dictionaries of ``kind``, what identifies the camera, and ``abilities`` where they are known;
        ``virtual``, the ``projector`` and ``camera`` of a rig file whose devices are none of these, or ``None``;
        ``notes``, why a kind of device could not be searched for.

    Raises:
        krylux.errors.OptionError: The source is no rig file.
        krylux.errors.DataError: The rig file is malformed.
    """
    if source is not None and not os.fspath(source).lower().endswith(".toml"):
        raise _checks.refuse("source", f"{source} is no rig file", "give a rig file (.toml), or nothing")
    return _ask("list", None, {"file": source, "display": display})[0]
