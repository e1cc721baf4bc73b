"""Sections that say what a display is like, not what a method makes of it."""
