"""Holograms that other software has made."""
