"""Methods for sources of more than one wavelength, whose light adds up in intensity."""
