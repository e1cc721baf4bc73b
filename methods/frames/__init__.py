"""Holograms of several frames that share one exposure."""
