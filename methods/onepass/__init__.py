"""Networks that give the phase of a hologram in one pass."""
