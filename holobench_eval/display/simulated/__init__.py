"""A display that behaves like hardware: a profile, and every stage between a phase and a camera count."""
