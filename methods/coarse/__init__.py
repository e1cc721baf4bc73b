"""Holograms for panels of few levels."""
