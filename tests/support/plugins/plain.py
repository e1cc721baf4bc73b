"""A method with all functions that a study may ask."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Mine:
    level: float = 1.0

    def solve(self, target, bench):
        return target

    def available(self):
        return None

    def files(self, target):
        return []

    def external(self):
        return {}
