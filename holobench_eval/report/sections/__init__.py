"""Until all sections are stories: what is left of them."""
