"""Displays that exist: drivers of panels and cameras, sessions of files, and what is checked before a measurement."""
