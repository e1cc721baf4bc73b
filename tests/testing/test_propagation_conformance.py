"""Right propagators pass the kit, and each well-known mistake fails the check that is there for it, with its cause."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from holobench_eval.optics import AngularSpectrum
from holobench_eval.testing.propagation_conformance import CHECKS, SHIPPED, check_propagator, finding, main
from holobench_eval.testing.propagator import Subject


def found(make, check, **claims):
    """What the one check whose name begins so finds."""
    (chosen,) = (each for each in CHECKS if each[0].startswith(check))
    return finding(Subject(make, **claims), *chosen)


class Written:
    """An angular spectrum written out here, with the mistakes that the kit is there to catch."""

    padding = 4
    flaw = ""

    def __init__(self, shape, pitch, wavelength, distance):
        self.shape, self.padded = shape, [self.padding * size for size in shape]
        fy, fx = (self.frequencies(size, pitch) for size in self.padded)
        f_squared = fy[:, None] ** 2 + fx**2
        phase = 2 * math.pi * distance * (torch.sqrt(1 / wavelength**2 - f_squared) - 1 / wavelength)
        kept = torch.ones_like(phase)
        if self.flaw == "float32 carrier":
            carried = 2 * math.pi / wavelength * distance * torch.sqrt(1 - wavelength**2 * f_squared).float()
            phase = carried.double() - 2 * math.pi * distance / wavelength
        if self.flaw == "paraxial":
            phase = -math.pi * wavelength * distance * f_squared
        if self.flaw == "limited":
            for f, size, axis in ((fy, self.padded[0], 1), (fx, self.padded[1], 0)):
                limit = 1 / (wavelength * math.hypot(1, 2 * distance / (size * pitch)))
                kept = kept * (f.abs() <= limit).unsqueeze(axis)
        if self.flaw == "low pass":
            kept = ((fy.abs() < 0.25 / pitch)[:, None] & (fx.abs() < 0.25 / pitch)).double()
        if self.flaw == "wrong sign":
            phase = -phase
        self.transfer = torch.polar(kept, phase)

    def frequencies(self, size, pitch):
        f = (torch.arange(size, dtype=torch.float64) - size // 2) / (size * pitch)
        if self.flaw == "half a sample":
            f = torch.linspace(-0.5 / pitch, 0.5 / pitch, size, dtype=torch.float64)
        return (torch.fft.fftshift if self.flaw == "shift" else torch.fft.ifftshift)(f)

    def filtered(self, field, transfer):
        spectrum = torch.fft.fft2(field, s=self.padded) * transfer
        return torch.fft.ifft2(spectrum)[: self.shape[0], : self.shape[1]]

    def forward(self, field):
        return self.filtered(field, self.transfer)


def written(**changes):
    return type("Changed", (Written,), changes)


def turned(self, field):
    return Written.forward(self, field).flip(0, 1).roll((1, 1), (0, 1))


MISTAKES = [
    ({"flaw": "half a sample", "padding": 2}, "centring", "half a sample off (linspace for fftfreq), padded 2x"),
    ({"flaw": "half a sample", "padding": 1}, "white field, 96", "half a sample off (linspace for fftfreq), padded 1x"),
    ({"flaw": "half a sample", "padding": 3}, "white field, 96", "half a sample off (linspace for fftfreq), padded 3x"),
    ({"flaw": "float32 carrier"}, "long direct sum", "float32"),
    ({"flaw": "low pass"}, "white field, 96", "a low pass: the band ends at 0.50 of that of the pixels on each axis"),
    ({"flaw": "shift", "padding": 3}, "white field, odd", "fftshift for ifftshift"),
    ({"flaw": "shift", "padding": 1}, "white field, odd", "fftshift for ifftshift"),
    ({"flaw": "paraxial"}, "white field, 96", "a paraxial (Fresnel) model"),
    ({"padding": 1}, "wrap-around beyond", "circular"),
    ({"padding": 1}, "white field, 96", "circular"),
    ({"padding": 1, "flaw": "limited"}, "wrap-around within", "circular"),
    ({"padding": 2}, "white field, far", "too little without a band limit"),
    ({"flaw": "wrong sign"}, "direct sum", "wrong sign"),
    ({"forward": turned}, "white field, 96", "turned"),
    ({"forward": lambda self, field: Written.forward(self, field) * field.numel()}, "energy", "a factor of 1.64e+04 "),
    ({"forward": lambda self, field: self.filtered(field, 0.9 * self.transfer)}, "energy", "a factor of 0.9 "),
    ({"forward": lambda self, field: Written.forward(self, field).roll(1, 1)}, "centring", "(0.00, 1.00) px aside"),
    ({"forward": lambda self, field: Written.forward(self, field).abs()}, "energy", "float"),
    ({"forward": lambda self, field: Written.forward(self, field)[None]}, "energy", "shape (1, 128, 128)"),
    ({"forward": lambda self, field: Written.forward(self, field) ** 3}, "white field, 96", "none of the mistakes"),
    ({"adjoint": Written.forward}, "adjointness", "adjoint: wrong sign"),
    ({"adjoint": Written.forward}, "phase gradient", "times the difference"),
    ({"adjoint": lambda self, field: 2 * self.filtered(field, self.transfer.conj())}, "adjointness", "a factor of 2 "),
]


@pytest.mark.parametrize(("changes", "check", "cause"), MISTAKES)
def test_a_well_known_mistake_fails_its_check_and_is_named(changes, check, cause):
    failed = found(written(**changes), check)
    assert failed.verdict == "FAIL"
    assert cause in failed.note
    assert "\n" not in failed.note


@pytest.mark.parametrize(
    ("factor", "cause"), [(0.0, "nothing but zeros"), (math.nan, "not finite"), (math.inf, "not finite")]
)
@pytest.mark.parametrize("own_adjoint", [False, True])
def test_zeros_and_what_is_not_finite_fail_every_check_as_what_they_are(factor, cause, own_adjoint):
    def forward(self, field):
        return Written.forward(self, field) * factor

    findings = check_propagator(written(forward=forward, **({"adjoint": forward} if own_adjoint else {})))
    assert {each.verdict for each in findings} == {"FAIL"}
    assert {cause in each.note for each in findings} == {True}


def test_the_same_propagator_without_a_mistake_passes():
    assert {each.verdict for each in check_propagator(Written)} == {"PASS"}
    assert {each.verdict for each in check_propagator(written(flaw="paraxial"), physics="paraxial")} == {"PASS"}


def test_shifts_that_differ_at_odd_sizes_alone_pass_at_even_ones():
    assert found(written(flaw="shift", padding=3), "white field, 96").verdict == "PASS"


def test_no_mistake_is_named_beside_the_one_that_explains_all():
    assert found(written(flaw="paraxial"), "white field, 96").note == "a paraxial (Fresnel) model"
    assert found(written(flaw="wrong sign"), "direct sum").note == "wrong sign of the distance or phase"


def test_an_exact_model_is_not_the_paraxial_one_that_it_claims_to_be():
    failed = found(Written, "white field, 96", physics="paraxial")
    assert failed.verdict == "FAIL"
    assert "an exact model" in failed.note


def test_a_low_pass_that_is_claimed_passes():
    assert found(written(flaw="low pass"), "white field, 96", band=0.4).verdict == "PASS"


def test_a_constant_phase_is_no_mistake_and_a_constant_amplitude_is_one():
    class Carrier(Written):
        def __init__(self, shape, pitch, wavelength, distance):
            super().__init__(shape, pitch, wavelength, distance)
            self.transfer = self.transfer * np.exp(2j * math.pi * distance / wavelength)

    assert {each.verdict for each in check_propagator(Carrier)} == {"PASS"}
    brighter = written(forward=lambda self, field: 1.01 * Written.forward(self, field))
    verdicts = {each.check: each.verdict for each in check_propagator(brighter)}
    assert verdicts["energy"] == "FAIL"
    assert [check for check in verdicts if "white" in check and verdicts[check] == "PASS"] == [
        "white field, far, 64x96 px at 12 mm"
    ]


@pytest.mark.parametrize("size", [1, 2, 4])
def test_a_propagator_in_single_precision_has_no_wrong_gradient(size):
    class Single(Written):
        padding = size  # unpadded, the loss hardly changes along a random direction

        def forward(self, field):
            return self.filtered(field, self.transfer.to(torch.complex64)).to(torch.complex64)

    assert found(Single, "phase gradient").value < 1e-4
    assert found(Single, "adjointness").verdict == "PASS"


class InNumpy(Written):
    def forward(self, field):
        spectrum = np.fft.fft2(field, self.padded) * self.transfer.numpy()
        return np.fft.ifft2(spectrum)[: self.shape[0], : self.shape[1]]


def test_numpy_without_an_adjoint_has_no_gradient_to_check():
    verdicts = {each.check: each for each in check_propagator(InNumpy)}
    for check in ("adjointness", "phase gradient"):
        assert verdicts.pop(check).verdict == "n/a"
    assert {each.verdict for each in verdicts.values()} == {"PASS"}


@pytest.mark.parametrize(
    ("forward", "reason"),
    [
        (InNumpy.forward, "numpy"),
        (lambda self, field: torch.from_numpy(InNumpy.forward(self, field)), "leaves torch"),
        (lambda self, field: Written.forward(self, field.detach()), "no gradient reaches the field"),
    ],
)
def test_the_reason_why_there_is_no_gradient_is_given(forward, reason):
    result = found(written(forward=forward), "phase gradient")
    assert result.verdict == "n/a"
    assert reason in result.note


def test_a_forward_that_is_not_linear_has_no_adjoint():
    def normalised(self, field):
        image = Written.forward(self, field)
        return image / image.abs().max()

    failed = found(written(forward=normalised), "adjointness")
    assert failed.verdict == "FAIL"
    assert "not linear" in failed.note


@pytest.mark.parametrize("error", [ValueError("two\nlines"), SystemExit(3), MemoryError()])
def test_an_exception_is_the_finding_of_one_check_and_not_the_end(error):
    def make(shape, pitch, wavelength, distance):
        if shape == (65, 95):
            raise error
        return AngularSpectrum(shape, pitch, wavelength, distance)

    findings = check_propagator(make)
    (failed,) = (each for each in findings if each.verdict == "FAIL")
    assert failed.check.startswith("white field, odd")
    assert f"raises {type(error).__name__}" in failed.note
    assert "\n" not in failed.note


def test_the_table_is_printed_with_causes_and_counted(capsys):
    assert main() == 0
    out = capsys.readouterr().out
    assert out.count("12 passed, 0 failed, 0 not applicable") == len(SHIPPED)
    assert "FAIL" not in out
    assert main({"mine": replace(SHIPPED["Fresnel"], physics="exact")}) == 1
    out = capsys.readouterr().out
    assert "cause: a paraxial (Fresnel) model" in out
    assert max(len(line) for line in out.splitlines()) <= 100
