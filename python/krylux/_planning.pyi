from typing import Any, Literal

from ._asking import Asking
from .answers import Plan

class Planning(Asking):
    def plan(
        self, verb: Literal["segment", "compensate", "eigs"], *arguments: Any, trials: int = 3, **options: Any
    ) -> Plan: ...
