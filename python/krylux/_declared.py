"""Verbs whose options krylux declares: methods with signature and documentation, and the stub that describes them to type checkers."""

import inspect
import json
import os
import textwrap

from . import _checks, _krylux, answers

#: The class of each verb's answer.
_ANSWERS = {
    "compensate": answers.Compensation, "eigs": answers.Eigenpairs, "segment": answers.Segmentation,
    "separate": answers.Separation,
}


def add_verbs(cls):
    """Adds a method for each verb that krylux declares."""
    for verb, about, parameters in _krylux.verbs():
        setattr(cls, verb, _method(cls, verb, about, parameters))


def _method(cls, verb, about, parameters):
    signature = inspect.Signature([inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD), *(
        inspect.Parameter(name, _kind(index), default=_default(default))
        for index, (name, default, _, _) in enumerate(parameters)
    )])

    named = [name for name, _, kind, _ in parameters if kind.startswith("ArrayLike")]

    def method(*arguments, **options):
        (_, lab), *given = signature.bind(*arguments, **options).arguments.items()
        given, pictures = pictures_apart(lab, dict(given), named)
        arrays, facts, native = lab._native.ask(verb, asked(given), pictures)
        answer = answers.SingularTriplets if given.get("singular", False) else _ANSWERS[verb]
        return answer(arrays, facts, native, lab)

    method.__name__, method.__qualname__, method.__module__ = verb, f"{cls.__qualname__}.{verb}", cls.__module__
    method.__signature__ = signature
    method.__doc__ = _documentation(verb, about, parameters)
    return method


def pictures_apart(lab, options, names):
    """The options, and the pictures among them that are arrays and no files, which have the camera's pixels."""
    pictures = {
        name: _checks.picture(options[name], name, lab.shape, lab.channels)
        for name in names if options.get(name) is not None and not isinstance(options[name], (str, os.PathLike))
    }
    return {name: value for name, value in options.items() if name not in pictures}, pictures


def asked(options):
    """Keyword arguments as JSON by name; what stays at ``None`` is left to krylux."""
    return {name: _checks.as_json(name, value) for name, value in options.items() if value is not None}


def _kind(index):
    """The first parameter may be given without its name."""
    return inspect.Parameter.KEYWORD_ONLY if index else inspect.Parameter.POSITIONAL_OR_KEYWORD


def _default(text):
    value = json.loads(text)
    return tuple(value) if isinstance(value, list) else value


def _documentation(verb, about, parameters):
    lines = [f"{about}.", "", "Parameters", "----------"]
    for name, _, kind, text in parameters:
        lines += [f"{name} : {kind}", textwrap.fill(f"{text}.", 110, initial_indent="    ", subsequent_indent="    ")]
    return "\n".join([*lines, "", "Returns", "-------", f"krylux.answers.{_ANSWERS[verb].__name__}", ""])


def stub():
    """The lines of ``_asking.pyi`` that describe the declared verbs."""
    lines = []
    for verb, _, parameters in _krylux.verbs():
        lines += [f"    def {verb}(", "        self,"]
        for index, (name, default, kind, _) in enumerate(parameters):
            lines += ["        *,"] if index == 1 else []
            lines.append(f"        {name}: {kind} = {_default(default)!r},".replace("'", '"'))
        lines.append(f"    ) -> answers.{_ANSWERS[verb].__name__}: ...")
    return "\n".join(lines) + "\n"
