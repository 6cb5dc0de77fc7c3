from os import PathLike
from typing import Any, Literal, Self

from ._asking import Asking
from .answers import Plan
from .rig import Report

class OnRigs(Asking):
    def plan(
        self, verb: Literal["segment", "compensate", "eigs"], *arguments: Any, trials: int = 3, **options: Any
    ) -> Plan: ...
    def through_rig(
        self,
        rig: str | PathLike[str],
        *,
        folder: str | PathLike[str] | None = None,
        resume: bool = False,
        overwrite: bool = False,
    ) -> Self: ...
    def calibrate(
        self, *, takes: int = 2, map: Literal["gray-code", "checkerboard"] | None = None, flat_field: bool = False
    ) -> Report: ...
