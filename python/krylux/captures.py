"""Captures that others took, from arrays."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from . import _checks
from .lab import Lab, open as _open

#: A response: a name, an exponent, or points of level and light.
Response = str | float | Sequence[tuple[float, float]]


def import_captures(
    patterns: ArrayLike, photos: ArrayLike, *, folder: str | os.PathLike[str], map: str | ArrayLike = "found",
    exposure: float | Sequence[float] | None = None, black: ArrayLike | None = None, white: ArrayLike | None = None,
    pattern_response: Response = "linear", photo_response: Response = "linear", saturation: float | None = None,
    channels: Literal["luma", "rgb", "native"] = "native", overwrite: bool = False,
) -> Lab:
    """Writes captures into a folder with a ``captures.toml``, fits the light transport to them, and opens it.

    Args:
        patterns: ``[N, h, w]`` or ``[N, h, w, 3]``, from 0 to 1.
        photos: ``[N, H, W]`` or ``[N, H, W, 3]``, in any unit; or ``[T, N, H, W]`` of repeated takes, which tell the noise.
        folder: Where the arrays go. The folder is a source for the command line and for :func:`krylux.open`, too.
        map: ``"found"`` from the captures, ``"coaxial"``, ``"none"``, or ``[H, W, 2]`` with the projector's column and row for
            each camera pixel, NaN where there is none.
        exposure: Seconds of all photos, of each take, or of each photo. Photos are divided by it.
        black, white: Photos of black and of white.
        pattern_response, photo_response: The light of a value, both from 0 to 1: ``"linear"``, ``"srgb"``, an exponent, or points.
        saturation: Values of photos from here on are saturated, and left out.
        channels: As of :func:`krylux.open`.
        overwrite: Use a folder that holds captures.

    Returns: The laboratory. :meth:`krylux.Lab.imported` tells how well photos that were left out are predicted.

    Raises:
        krylux.errors.OptionError: Shapes that do not go together, or a folder that holds captures.
        krylux.Error: The captures make no model.
    """
    target = Path(folder)
    if (target / "captures.toml").exists() and not overwrite:
        raise _checks.refuse("folder", f"{os.fspath(folder)!r} holds captures", "give another folder, or overwrite=True")
    shown, taken = _checks.real_array(patterns, "patterns", np.float32), _checks.real_array(photos, "photos", np.float32)
    if shown.ndim not in (3, 4) or shown.ndim == 4 and shown.shape[-1] != 3:
        raise _checks.refuse("patterns", f"its shape is {shown.shape}", "give [N, h, w] or [N, h, w, 3]")
    is_taken_twice = taken.ndim == 5 or taken.ndim == 4 and taken.shape[-1] != 3
    takes = list(taken) if is_taken_twice else [taken]
    if any(take.ndim not in (3, 4) or len(take) != len(shown) for take in takes):
        raise _checks.refuse("photos", f"its shape is {taken.shape}, and patterns have {shown.shape}",
                             "give [N, H, W], [N, H, W, 3], or [T, N, H, W] with one photo of each pattern")
    target.mkdir(parents=True, exist_ok=True)
    np.save(target / "patterns.npy", shown)
    names = [f"photos-{take + 1}.npy" if is_taken_twice else "photos.npy" for take in range(len(takes))]
    for name, take in zip(names, takes, strict=True):
        np.save(target / name, take)
    keys: dict[str, Any] = {"files": names if is_taken_twice else names[0], "response": photo_response}
    for name, frame in (("black", black), ("white", white)):
        if frame is not None:
            np.save(target / f"{name}.npy", _checks.real_array(frame, name, np.float32))
            keys[name] = f"{name}.npy"
    keys |= {} if exposure is None else {"exposure": exposure}
    keys |= {} if saturation is None else {"saturation": saturation}
    if not isinstance(map, str):
        np.save(target / "map.npy", np.asarray(map, np.float64))
        map = "map.npy"
    lines = [f"map = {_toml(map)}", "", "[patterns]", 'files = "patterns.npy"', f"response = {_toml(pattern_response)}", "",
             "[photos]", *(f"{key} = {_toml(value)}" for key, value in keys.items())]
    (target / "captures.toml").write_text("\n".join(lines) + "\n")
    return _open(target, channels=channels)


def _toml(value: Any) -> str:
    """A text, a number or a list as TOML, which writes them as JSON does."""
    return json.dumps(np.asarray(value).tolist() if isinstance(value, (np.ndarray, np.generic)) else value)
