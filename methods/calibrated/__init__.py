"""Calibrated methods: a differentiable model of the display is learned from captures, then held for every hologram."""
