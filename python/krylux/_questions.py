"""From the arguments of a verb to what the native part is asked: the same for an answer and for a plan of it."""

import os

import numpy as np

from . import _checks


def compensate_question(lab, asked):
    """``(target, question)`` of a compensation; ``asked`` has the arguments of :meth:`krylux.Lab.compensate` by name."""
    target = _checks.picture(asked["target"], "target", lab.shape, lab.channels)
    if target.min() < 0 or target.max() > 1:
        fault = f"its values are from {target.min():g} to {target.max():g}, but a target's are from 0 to 1"
        raise _checks.refuse("target", fault, "scale it, and say by peak what 1 stands for")
    if target.max() == 0:
        raise _checks.refuse("target", "it is black", "give an image with light in it")
    crosstalk, photos, model = asked["crosstalk"], asked["photos"], asked["model"]
    measure = isinstance(crosstalk, str) and crosstalk == "measure"
    if crosstalk is not None and lab.channels == 1:
        raise _checks.refuse("crosstalk", "gray light has no colours to mix", "open the source with channels=\"rgb\"")
    return target, {
        "method": asked["method"],
        "photos": lab._photos_of_run if photos is None else _checks.count(photos, "photos", 0),
        "rtol": _number(asked, "rtol", 0.0),
        "floor": _checks.finite(asked["floor"], "floor"),
        "lift": _number(asked, "lift"),
        "peak": _number(asked, "peak"),
        "precondition": asked["precondition"],
        "defocus": _number(asked, "defocus"),
        "out_of_focus": bool(asked["out_of_focus"]),
        "paper": bool(asked["paper"]),
        "measure_crosstalk": measure,
        "crosstalk": None if measure or crosstalk is None else _three_by_three(crosstalk),
        "unmix": bool(asked["unmix"]),
        "compare_methods": bool(asked["compare_methods"]),
        "model": None if model is None else os.fspath(model),
    }


def _number(asked, option, least=None):
    return _checks.maybe(_checks.finite, asked[option], option, least)


def _three_by_three(crosstalk):
    matrix = _checks.real_array(crosstalk, "crosstalk", np.float64)
    if matrix.shape != (3, 3):
        raise _checks.refuse("crosstalk", f"its shape is {matrix.shape}", "give an array of 3 × 3, or \"measure\"")
    return matrix.tolist()
