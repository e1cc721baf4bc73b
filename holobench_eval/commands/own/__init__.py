"""Commands for methods, displays and propagators of one's own."""
