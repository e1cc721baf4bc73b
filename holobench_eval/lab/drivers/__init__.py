"""Drivers of real panels and cameras; each imports its library only when it is opened."""
