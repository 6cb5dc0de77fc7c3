from . import (
    answers as answers,
    errors as errors,
    images as images,
    krylov as krylov,
    lab as lab,
    operator as operator,
    paper as paper,
    rig as rig,
)
from .errors import Error as Error
from .images import compare as compare
from .lab import Lab as Lab, open as open
from .operator import LabOperator as LabOperator
from .paper import reproduce as reproduce

__all__ = [
    "Error",
    "Lab",
    "LabOperator",
    "__version__",
    "answers",
    "compare",
    "errors",
    "images",
    "krylov",
    "open",
    "paper",
    "reproduce",
    "rig",
]
__version__: str
