"""The run of a study: what is left of it, in which order, and what is told of it."""
