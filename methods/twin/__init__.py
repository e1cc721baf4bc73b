"""A model of a display that is close enough to stand in its place."""
