from . import answers as answers, errors as errors, krylov as krylov, lab as lab, operator as operator, rig as rig
from .errors import Error as Error
from .lab import Lab as Lab, open as open
from .operator import LabOperator as LabOperator

__all__ = ["Error", "Lab", "LabOperator", "__version__", "errors", "krylov", "open", "rig"]
__version__: str
