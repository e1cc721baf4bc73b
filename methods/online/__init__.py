"""Optimisation with the camera in the loop, one image at a time."""
