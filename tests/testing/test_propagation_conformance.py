import math

import pytest
import torch

from holobench_eval.optics import Fraunhofer
from holobench_eval.optics.convolution import Convolution
from holobench_eval.testing.propagation_conformance import PROPAGATORS, WAVELENGTH, check_propagator, main


@pytest.mark.parametrize("name", PROPAGATORS)
def test_every_propagator_conforms(name):
    failed = [finding for finding in check_propagator(PROPAGATORS[name]) if not finding.passed]
    assert not failed


class Flawed(Convolution):
    """An angular spectrum with the mistakes that the kit is there to catch."""

    flaw = ""

    def __init__(self, shape, pitch, wavelength, distance):
        padded = shape if self.flaw == "circular" else tuple(4 * size for size in shape)
        axes = []
        for size in padded:
            f = torch.fft.fftfreq(size, pitch, dtype=torch.float64)
            if self.flaw == "half bin":
                f = torch.fft.ifftshift(torch.linspace(-0.5 / pitch, 0.5 / pitch, size, dtype=torch.float64))
            axes.append(f)
        f_squared = axes[0][:, None] ** 2 + axes[1][None, :] ** 2
        if self.flaw == "float32 carrier":
            k = torch.tensor(2 * math.pi * distance / wavelength, dtype=torch.float32)
            phase = (
                k * torch.sqrt(1 - wavelength**2 * f_squared.float())
            ).double() - 2 * math.pi * distance / wavelength
        else:
            phase = 2 * math.pi * distance * (torch.sqrt(1 / wavelength**2 - f_squared) - 1 / wavelength)
        super().__init__(shape, torch.polar(torch.ones_like(phase), phase).to(torch.complex64))

    def adjoint(self, field):
        return super().forward(field) if self.flaw == "no adjoint" else super().adjoint(field)


@pytest.mark.parametrize(
    ("flaw", "check"),
    [
        ("half bin", "centring"),
        ("float32 carrier", "long direct sum"),
        ("circular", "wrap-around"),
        ("no adjoint", "adjointness"),
        ("no adjoint", "phase gradient"),
    ],
)
def test_a_well_known_mistake_is_caught(flaw, check):
    broken = type("Broken", (Flawed,), {"flaw": flaw})
    failed = [finding.check for finding in check_propagator(broken) if not finding.passed]
    assert any(name.startswith(check) for name in failed), failed


def test_the_table_is_printed(capsys):
    assert main() == 0
    out = capsys.readouterr().out
    assert "AngularSpectrum" in out
    assert "FAIL" not in out


def test_fraunhofer_is_unitary_and_images_a_tilt_at_its_frequency():
    model = Fraunhofer((32, 64), 6.4e-6, WAVELENGTH, 0.2)
    field = torch.polar(torch.ones(32, 64), 2 * math.pi * 5 / 64 * torch.arange(64).expand(32, 64))
    image = model.forward(field)
    assert torch.allclose(model.adjoint(image), field, atol=1e-5)
    assert int(image.abs().argmax()) == 16 * 64 + 32 + 5
    assert model.image_pitch[1] == pytest.approx(WAVELENGTH * 0.2 / (64 * 6.4e-6))
