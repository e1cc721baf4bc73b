"""A static site over many reports: a leaderboard, a page a method, a page a display, a page a study."""

from .build import write_site

__all__ = ["write_site"]
