"""Until all answers are stories: what is left of them."""
