"""Checks of values from files that say what was meant: lengths in metres, and whatever else is a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

POWERS = (-3, -6, -9)  # of ten: millimetres, micrometres, nanometres


class Check:
    """A mark of an annotated type, which says in words what is wrong with a value."""

    def fault(self, value: Any) -> str:
        """What is wrong with a value of the type; empty for a right one."""
        raise NotImplementedError

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """What pydantic asks for: the check, after those of the type."""
        from pydantic_core.core_schema import no_info_after_validator_function

        return no_info_after_validator_function(self._checked, handler(source))

    def _checked(self, value: Any) -> Any:
        if fault := self.fault(value):
            raise ValueError(fault)
        return value


@dataclass(frozen=True)
class Metres(Check):
    """A length in a range [m]; one in another unit is refused with its value in metres.

    Examples
    --------
    >>> Metres(200e-9, 2000e-9).fault(532.0)
    '532 is not in 200e-9 to 2e-6 m; lengths are in metres: 532e-9'
    >>> Metres(1e-3, 10.0).fault(2000000.0)
    '2000000 is not in 1e-3 to 10 m; lengths are in metres: 2000000e-6'
    """

    low: float
    high: float

    def fault(self, value: float) -> str:
        """See ``Check``."""
        if self.low <= value <= self.high:
            return ""
        meant = (power for power in POWERS if self.low <= value * 10.0**power <= self.high)
        remedy = next((f"; lengths are in metres: {value:.10g}e{power}" for power in meant), "")
        return f"{value:.10g} is not in {metres(self.low)} to {metres(self.high)} m{remedy}"

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> Any:
        """What pydantic asks for: the range, for editors and pages."""
        return {**handler(schema), "minimum": self.low, "maximum": self.high}


def metres(value: float) -> str:
    """A length as files have it: ``532e-9``, ``6.4e-6``, ``0.1``.

    Examples
    --------
    >>> metres(5.32e-7), metres(6.4e-6), metres(0.1)
    ('532e-9', '6.4e-6', '0.1')
    """
    power = next((power for power in POWERS if value >= 10.0**power), POWERS[-1])
    return f"{value:g}" if value >= 0.01 else f"{value / 10.0**power:g}e{power}"
