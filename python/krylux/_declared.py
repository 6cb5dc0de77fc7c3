"""Verbs whose options krylux declares: methods with signature and documentation, and the stub that describes them to type checkers."""

import difflib
import inspect
import json
import os
import textwrap

import numpy as np

from . import _checks, _krylux, answers

#: The class of each verb's answer.
_ANSWERS = {
    "audit": answers.Audit, "compensate": answers.Compensation, "eigs": answers.Eigenpairs, "import": answers.Imported,
    "probe": answers.Probing,
    "relight": answers.Relighting, "segment": answers.Segmentation, "separate": answers.Separation,
    "solve": answers.Solution,
}

#: Verbs whose methods are written by hand, since they take arrays as their first parameter, or have the name of a keyword of Python.
_BY_HAND = ("import", "relight", "solve")


def add_verbs(cls):
    """Adds a method for each verb that krylux declares."""
    for verb, about, parameters in _declared():
        setattr(cls, verb, _method(cls, verb, about, parameters))


def _declared():
    return [verb for verb in _krylux.verbs() if verb[0] not in _BY_HAND]


def ask(lab, verb, options, arrays=()):
    """The answer of a verb. ``arrays`` are ``(field, name, array)`` in place of files."""
    kind = answers.SingularTriplets if options.get("singular", False) else _ANSWERS[verb]
    return kind(*lab._native.ask(verb, asked(options), arrays), lab)


def _method(cls, verb, about, parameters):
    keyword, place = inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD
    # The first parameter may be given without its name.
    parameters_of = [inspect.Parameter("self", place), *(
        inspect.Parameter(name, keyword if index else place, default=_default(default), annotation=kind)
        for index, (name, default, kind, _) in enumerate(parameters)
    )]
    signature = inspect.Signature(parameters_of, return_annotation=f"answers.{_ANSWERS[verb].__name__}")
    named = [name for name, _, kind, _ in parameters if kind.startswith("ArrayLike")]

    def method(*arguments, **options):
        try:
            (_, lab), *given = signature.bind(*arguments, **options).arguments.items()
        except TypeError as error:
            raise TypeError(f"{verb}() {error}{_meant(options, signature.parameters)}") from None
        given, arrays = masks_apart(dict(given))
        given, pictures = pictures_apart(lab, given, named)
        return ask(lab, verb, given, arrays + pictures)

    method.__name__, method.__qualname__, method.__module__ = verb, f"Lab.{verb}", "krylux.lab"
    method.__signature__ = signature
    method.__doc__ = _documentation(about, parameters)
    return method


def _meant(options, known):
    """What an option that is not known may have been meant to be."""
    unknown = [name for name in options if name not in known]
    near = difflib.get_close_matches(unknown[0], known, 1) if unknown else []
    return f"; did you mean {near[0]!r}?" if near else ""


def pictures_apart(lab, options, names):
    """The options, and as ``(field, "", array)`` the pictures among them that are no files, which have the camera's pixels."""
    pictures = [
        (name, "", _checks.picture(options[name], name, lab.shape, lab.channels).astype(np.float64))
        for name in names if options.get(name) is not None and not isinstance(options[name], (str, os.PathLike))
    ]
    given = {name for name, _, _ in pictures}
    return {name: value for name, value in options.items() if name not in given}, pictures


def masks_apart(options):
    """The options, and as ``("mask", name, array)`` the arrays of a mask among them that is neither a name nor a file."""
    mask = options.get("mask")
    if mask is None or isinstance(mask, (str, os.PathLike)):
        return options, []
    if hasattr(mask, "tocsr"):
        mask = mask.tocsr().copy()
        mask.sum_duplicates()
        arrays = {"data": mask.data, "indices": mask.indices, "indptr": mask.indptr, "shape": mask.shape}
    else:
        try:
            masks, patterns = mask
        except (TypeError, ValueError):
            help = "give a sparse matrix of SciPy, or a pair of arrays of K×m masks and K×n patterns"
            raise _checks.refuse("mask", "it is no mask", help) from None
        arrays = {"masks": masks, "patterns": patterns}
    given = [("mask", name, _checks.real_array(array, "mask", np.float64))
             for name, array in arrays.items()]
    return {name: value for name, value in options.items() if name != "mask"}, given


def asked(options):
    """Keyword arguments as JSON by name; what stays at ``None`` is left to krylux."""
    return {name: _checks.as_json(name, value) for name, value in options.items() if value is not None}


def _default(text):
    value = json.loads(text)
    return tuple(value) if isinstance(value, list) else value


def _documentation(about, parameters):
    lines = [f"{about}.", "", "Args:"]
    lines += [textwrap.fill(f"{name}: {text}.", 110, initial_indent="    ", subsequent_indent="        ")
              for name, _, _, text in parameters]
    return "\n".join([*lines, ""])


def stub():
    """The lines of ``_asking.pyi`` that describe the declared verbs."""
    lines = []
    for verb, _, parameters in _declared():
        lines += [f"    def {verb}(", "        self,"]
        for index, (name, default, kind, _) in enumerate(parameters):
            lines += ["        *,"] if index == 1 else []
            lines.append(f"        {name}: {kind} = {_default(default)!r},".replace("'", '"'))
        lines.append(f"    ) -> answers.{_ANSWERS[verb].__name__}: ...")
    return "\n".join(lines) + "\n"
