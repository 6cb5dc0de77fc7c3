"""Cameras and projectors written in Python, behind the rig traits."""

import json
import os
import time

import numpy as np

from . import _checks


class ProgramRig:
    """A projector and a camera written in Python, as a source for :func:`krylux.open`.

    Each frame has to be exposed after ``capture`` was called, or to say when: see the text of :mod:`krylux.rig`.

    Parameters
    ----------
    projector, camera : object
        The devices; the text of :mod:`krylux.rig` says which members they have.
    measurement : dict, optional
        The ``[measurement]`` table of a rig file, such as ``{"exposures": [0.01], "takes": 4}``.
    calibration : path, optional
        The folder that a calibration was written to. Default: the devices are taken as ideal.

    Raises
    ------
    krylux.errors.OptionError
        A device lacks a member, or one has an unusable value.

    Examples
    --------
    >>> lab = krylux.open(krylux.rig.ProgramRig(MyProjector(), MyCamera()), folder="out/mine")  # doctest: +SKIP
    """

    def __init__(self, projector, camera, *, measurement=None, calibration=None):
        self.projector = projector
        self.camera = camera
        self.measurement = dict(measurement or {})
        self.calibration = None if calibration is None else os.path.abspath(calibration)
        _require(projector, "projector", ("size", "show"))
        _require(camera, "camera", ("size", "exposures", "configure", "capture"))

    def _description(self):
        projector, camera = self.projector, self.camera
        return {
            "projector": {
                "name": str(getattr(projector, "name", "projector")),
                "size": _checks.size(projector.size, "projector.size"),
                "channels": _checks.count(getattr(projector, "channels", 1), "projector.channels"),
                "bits": _checks.count(getattr(projector, "bits", 8), "projector.bits"),
                "frame_time": float(getattr(projector, "frame_time", 0.0)),
            },
            "camera": {
                "name": str(getattr(camera, "name", "camera")),
                "size": _checks.size(camera.size, "camera.size"),
                "channels": _checks.count(getattr(camera, "channels", 1), "camera.channels"),
                "bits": _checks.count(getattr(camera, "bits", 8), "camera.bits"),
                "exposures": [_checks.finite(seconds, "camera.exposures", 0.0) for seconds in camera.exposures],
            },
        }

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
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_toml_value(one) for one in np.asarray(value).tolist()) + "]"
    raise _checks.refuse("measurement", f"{value!r} has no form in a rig file", "give numbers, texts, or lists of them")


# It is found, pickled and documented there.
ProgramRig.__module__ = "krylux.rig"
