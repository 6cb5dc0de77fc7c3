"""The verbs that krylux declares, as methods; the stub beside this file describes them to type checkers."""

from . import _declared


class Asking:
    """The questions that a laboratory answers; the base of :class:`krylux.Lab`."""


_declared.add_verbs(Asking)
