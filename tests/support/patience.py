"""How long tests wait for what must come."""

PATIENCE = 600.0
"""Seconds: far more than anything takes on the busiest machine, so that only what hangs runs out of it."""
