"""Progress and messages of long computations."""

import logging
import sys
from collections.abc import Callable

#: Bars or none, or a function of ``(stage, done, total, estimate)``.
Progress = bool | Callable[[str, int, int, str], object] | None

_LOGGER = logging.getLogger("krylux")
_LEVELS = {"warning": logging.WARNING, "note": logging.INFO, "info": logging.INFO, "detail": logging.DEBUG}


def log(level, message):
    """A message of krylux for the logger ``krylux``."""
    _LOGGER.log(_LEVELS[level], "%s", message)


class Bar:
    """Shows each stage of a computation as a bar of tqdm."""

    def __init__(self, tqdm):
        self._tqdm = tqdm
        self._bar = None
        self._stage = None

    def __call__(self, stage, done, total, estimate):
        if self._bar is None or stage != self._stage or done < self._bar.n:
            self.close()
            self._stage = stage
            self._bar = self._tqdm(total=total, desc=stage, leave=False)
        bar = self._bar
        bar.total = total
        if estimate:
            bar.set_postfix_str(estimate, refresh=False)
        bar.update(done - bar.n)
        if done >= total:
            self.close()

    def close(self):
        """Removes the bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def choose(progress):
    """The callback for the argument ``progress``.

    A function is called with ``(stage, done, total, estimate)``. ``True`` shows bars where tqdm is installed, ``None``
    does so only where somebody may see them: on a terminal and in a notebook. ``False`` is silent.
    """
    if callable(progress):
        return progress
    if progress is None:
        progress = "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())
    if not progress:
        return None
    try:
        from tqdm.auto import tqdm  # type: ignore
    except ImportError:
        return None
    return Bar(tqdm)
