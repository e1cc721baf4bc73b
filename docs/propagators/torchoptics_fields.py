"""torchoptics (M. J. Filipovich & A. I. Lvovsky, arXiv:2411.18591), ``Field.propagate_to_z``."""

from torchoptics import Field


class Default:
    """As it comes: the package chooses the method, and pads by twice the size on each side."""

    method, padding = "AUTO", None  # samples on each side, in sizes of the field

    def __init__(self, shape, pitch, wavelength, distance):
        self.grid = {"wavelength": wavelength, "spacing": pitch}
        self.distance = distance
        self.pad = None if self.padding is None else [round(self.padding * size) for size in shape]

    def forward(self, field):
        """Propagate a complex field ``(H, W)``."""
        light = Field(field, **self.grid)
        return light.propagate_to_z(self.distance, propagation_method=self.method, asm_pad=self.pad).data


class AngularSpectrum(Default):
    """Its angular spectrum at any distance."""

    method = "ASM"


class Twofold(AngularSpectrum):
    """Its angular spectrum, padded to twice the size."""

    padding = 0.5


class DirectIntegration(Default):
    """Its direct integration (Rayleigh-Sommerfeld) at any distance."""

    method = "DIM"


class Fresnel(AngularSpectrum):
    """Its paraxial angular spectrum."""

    method, physics = "ASM_FRESNEL", "paraxial"
