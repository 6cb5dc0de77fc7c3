"""Checks of arguments. Each error names the argument, says what was expected, and what to do."""

from __future__ import annotations

import json
import operator as _operator
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import errors

FilePath = str | os.PathLike[str]


def refuse(option, fault, help, kind=errors.OptionError):
    """An exception about an argument, in the form of all of krylux's messages."""
    return kind(f"{option}: {fault}\n  help: {help}", option=option, help=help)


def closed(fault, help):
    """An exception about something that can no longer be used."""
    return errors.ClosedError(f"{fault}\n  help: {help}", help=help)


def real_array(value: Any, option: str, dtype: Any) -> NDArray[Any]:
    """A C-contiguous array of real, finite numbers in ``dtype``; copied only where it has to be."""
    try:
        array = np.asarray(value)
    except Exception as error:
        raise refuse(option, f"it is no array: {error}", "give a NumPy array", errors.ArrayError) from error
    if array.dtype.kind not in "fiub":
        fault = f"its data type is {array.dtype}, but real numbers are expected"
        raise refuse(option, fault, "convert it, e.g. by .astype('float32')", errors.ArrayError)
    array = np.ascontiguousarray(array, dtype=dtype)
    if not np.isfinite(array).all():
        wrong = int(np.count_nonzero(~np.isfinite(array)))
        raise refuse(option, f"{wrong} of its values are NaN or infinite", "replace them by finite numbers")
    return array


def picture(value: Any, option: str, size: tuple[int, int], channels: int | None = None) -> NDArray[np.float32]:
    """An array of ``H×W`` or ``H×W×3`` in single precision.

    ``size`` is ``(H, W)``; ``channels`` is the largest number of channels that is allowed.
    """
    array = real_array(value, option, np.float32)
    is_picture = array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 3)
    if not is_picture or array.shape[:2] != tuple(size):
        height, width = size
        fault = f"its shape is {array.shape}, but {height} × {width} pixels are expected"
        raise refuse(option, fault, f"give an array of shape ({height}, {width}) or ({height}, {width}, 3)")
    if channels == 1 and array.ndim == 3:
        raise refuse(option, "it is coloured, but the laboratory is gray",
                     "give an array of H×W, or open the source with channels=\"rgb\"")
    return array


def vector(value: Any, option: str, length: int) -> NDArray[np.float64]:
    """A contiguous vector in double precision; a picture of as many pixels is taken row by row."""
    array = real_array(value, option, np.float64)
    if array.size != length:
        fault = f"it has {array.size} entries (shape {array.shape}), but {length} are expected"
        raise refuse(option, fault, f"give a vector of {length} numbers")
    return array.reshape(length)


#: The largest number of photos, pixels or the like: that of the command line.
MOST = 2**24


def count(value, option, least=1, most=MOST):
    """A whole number from ``least`` to ``most``, whose bound keeps sums and products of such numbers small."""
    try:
        number = _operator.index(value)
    except TypeError as error:
        fault = f"{value!r} is no whole number"
        raise refuse(option, fault, f"give a whole number from {least} to {most}", errors.ArrayError) from error
    if not least <= number <= most:
        raise refuse(option, f"it is {number}", f"give a whole number from {least} to {most}")
    return number


def maybe(check, value, option, *bounds):
    """The value, checked where one is given."""
    return None if value is None else check(value, option, *bounds)


def vectors(number, option, length):
    """A number of vectors that fit into memory: Rust ends the program where memory is refused."""
    number = count(number, option)
    try:
        np.empty((number, length))
    except (MemoryError, ValueError) as error:
        fault = f"{number} vectors of {length} entries do not fit into memory"
        raise refuse(option, fault, "give a smaller number") from error
    return number


def size(value, option):
    """``(width, height)`` of a number, or of a pair of numbers."""
    try:
        pair = (value, value) if np.ndim(value) == 0 else tuple(value)
    except TypeError:
        pair = ()
    if len(pair) != 2:
        raise refuse(option, f"{value!r} is no size", "give a number of pixels, or (width, height)")
    return tuple(count(side, option) for side in pair)


def finite(value, option, least=None):
    """A finite number."""
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise refuse(option, f"{value!r} is no number", "give a number", errors.ArrayError) from error
    if not np.isfinite(number) or (least is not None and number < least):
        bound = "a finite number" if least is None else f"a finite number from {least} on"
        raise refuse(option, f"it is {number}", f"give {bound}")
    return number


def as_json(option, value):
    """A number, a text, a path, or a sequence of them, of Python or of NumPy, as JSON."""
    try:
        text = json.dumps(value, allow_nan=False, ensure_ascii=False, default=_plain)
        text.encode()
        return text
    except (TypeError, ValueError) as error:
        fault = f"{value!r} cannot be used: {error}"
        raise refuse(option, fault, "give finite numbers, texts, or sequences of them") from error


def _plain(value):
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value.tolist() if hasattr(value, "tolist") else list(value)
