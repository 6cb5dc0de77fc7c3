"""The exceptions of krylux.

Each message names the argument, the file or the device at fault, says what was expected, and what to do. The
attributes hold the same parts by themselves. Exceptions that a program's own code raises inside of krylux, such as
those of a camera written in Python, come out unchanged.
"""


class Error(Exception):
    """The base of all errors of krylux.

    Args:
        message: What is wrong, and what to do.
        help: What to do, by itself.
        option, path, device, what: The argument, the file, the device or the quantity at fault.

    Attributes:
        help, option, path, device, what: As the parameters.
    """

    def __init__(self, message: str, *, help: str | None = None, option: str | None = None, path: str | None = None,
                 device: str | None = None, what: str | None = None) -> None:
        super().__init__(message)
        self.help, self.option, self.path, self.device, self.what = help, option, path, device, what


class SceneError(Error):
    """A scene file is malformed or uses a feature that is not supported."""


class DataError(Error, ValueError):
    """A data file (pattern, image, matrix, run) is malformed, has the wrong shape, or does not hold what is asked for."""


class OptionError(Error, ValueError):
    """The value of an argument cannot be used; ``option`` is the argument's name."""


class ParameterError(OptionError, KeyError):
    """A scene has no such parameter, or the parameter has no value; ``option`` is its path."""

    # KeyError would show the message in quotes.
    __str__ = Exception.__str__


class ArrayError(OptionError, TypeError):
    """An array has a data type that cannot be used; ``option`` is the argument's name."""


class ReadError(Error, OSError):
    """A file cannot be read."""


class WriteError(Error, OSError):
    """A file cannot be written."""


class DeviceError(Error):
    """The graphics device refused a request, ran out of memory or was lost."""


class NoAdapterError(DeviceError):
    """There is no Vulkan adapter: neither the driver of a GPU nor a software driver is installed."""


class RigError(Error):
    """A projector or camera refused a request, returned no usable data, or was disconnected."""


class SaturatedError(RigError):
    """Some pixel of a camera has the highest count at every available exposure."""


class JournalError(Error):
    """A journal of photos cannot be read or written, is in use, or lacks a record. Its photos are not changed."""


class UnfinishedPathsError(DeviceError):
    """Some light paths did not report that they finished, so the photo would be wrong."""


class Interrupted(Error):
    """An observer stopped the computation."""


class DimensionError(Error, ValueError):
    """A size differs from the required one."""


class NumericalError(Error, ArithmeticError):
    """A numerical method cannot continue, for example because of NaN or a breakdown."""


class ClosedError(Error, ValueError):
    """The laboratory is closed."""


class ForkedError(Error):
    """The laboratory belongs to the process from which this one was forked."""


class InternalError(Error):
    """A fault of krylux itself. The interpreter and other laboratories are not affected."""
