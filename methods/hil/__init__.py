"""Learned hardware-in-the-loop phase retrieval (Chakravarthula et al. 2020), a station of the paper a file."""
