"""Conditions at test time: what may have changed on a bench since methods were prepared for it."""

from .kind import Kind, Value
from .kinds import KINDS, altered, checked

__all__ = ["KINDS", "Kind", "Value", "altered", "checked"]
