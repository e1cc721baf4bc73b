"""odak (github.com/kaanaksit/odak), ``odak.learn.wave.propagate_beam``; its log goes into the working directory."""

import math

from odak.learn.wave import propagate_beam


class BandLimited:
    """The default: band-limited angular spectrum, padded to twice the size."""

    kind = "Bandlimited Angular Spectrum"

    def __init__(self, shape, pitch, wavelength, distance):
        self.arguments = (2 * math.pi / wavelength, distance, pitch, wavelength, self.kind)

    def forward(self, field):
        """Propagate a complex field ``(H, W)``."""
        return propagate_beam(field, *self.arguments)


class AngularSpectrum(BandLimited):
    """Without the band limit."""

    kind = "Angular Spectrum"


class Fresnel(BandLimited):
    """The paraxial transfer function."""

    kind, physics = "Transfer Function Fresnel", "paraxial"
