"""Metrics, and the protocol that strings them together."""

from .base import Metric
from .catalogue import catalogue
from .protocol import VERSION, match, score
from .references import floor_captures

__all__ = ["VERSION", "Metric", "catalogue", "floor_captures", "match", "score"]
