"""Conditions at test time: what may have changed on a bench since methods were prepared for it."""

from .kinds import KINDS, Kind, Value, altered, checked

__all__ = ["KINDS", "Kind", "Value", "altered", "checked"]
