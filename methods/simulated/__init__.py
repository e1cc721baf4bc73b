"""Phase retrieval through a simulated bench: that of the display itself, or that of a profile."""
