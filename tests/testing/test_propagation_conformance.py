"""Right propagators pass the kit, and each well-known mistake fails the check that is there for it."""

import math

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
    ({"flaw": "half a sample", "padding": 2}, "centring"),
    ({"flaw": "half a sample", "padding": 1}, "white field, 96"),
    ({"flaw": "half a sample", "padding": 3}, "white field, 96"),
    ({"flaw": "float32 carrier"}, "long direct sum"),
    ({"flaw": "low pass"}, "white field, 96"),
    ({"flaw": "shift", "padding": 3}, "white field, odd"),
    ({"flaw": "shift", "padding": 1}, "white field, odd"),
    ({"flaw": "paraxial"}, "white field, 96"),
    ({"padding": 1}, "wrap-around beyond"),
    ({"padding": 1}, "white field, 96"),
    ({"padding": 1, "flaw": "limited"}, "wrap-around within"),
    ({"padding": 2}, "white field, far"),
    ({"flaw": "wrong sign"}, "direct sum"),
    ({"forward": turned}, "white field, 96"),
    ({"forward": lambda self, field: Written.forward(self, field) * field.numel()}, "energy"),
    ({"forward": lambda self, field: self.filtered(field, 0.9 * self.transfer)}, "energy"),
    ({"forward": lambda self, field: Written.forward(self, field).roll(1, 1)}, "centring"),
    ({"forward": lambda self, field: Written.forward(self, field) ** 3}, "white field, 96"),
    ({"forward": lambda self, field: Written.forward(self, field) / field.abs().max()}, "adjointness"),
    ({"adjoint": Written.forward}, "adjointness"),
    ({"adjoint": Written.forward}, "phase gradient"),
    ({"adjoint": lambda self, field: 2 * self.filtered(field, self.transfer.conj())}, "adjointness"),
]


@pytest.mark.parametrize(("changes", "check"), MISTAKES)
def test_a_well_known_mistake_fails_its_check_by_its_figure(changes, check):
    failed = found(written(**changes), check)
    assert failed.verdict == "FAIL"
    assert failed.value > failed.bound
    assert not failed.note


@pytest.mark.parametrize(("changed", "words"), [(torch.abs, "float"), (lambda image: image[None], "(1, 128, 128)")])
def test_a_result_that_is_no_field_is_told_as_what_it_is(changed, words):
    failed = found(written(forward=lambda self, field: changed(Written.forward(self, field))), "energy")
    assert failed.verdict == "FAIL"
    assert words in failed.note


@pytest.mark.parametrize(
    ("factor", "words"), [(0.0, "nothing but zeros"), (math.nan, "not finite"), (math.inf, "not finite")]
)
@pytest.mark.parametrize("own_adjoint", [False, True])
def test_zeros_and_what_is_not_finite_fail_every_check_as_what_they_are(factor, words, own_adjoint):
    def forward(self, field):
        return Written.forward(self, field) * factor

    findings = check_propagator(written(forward=forward, **({"adjoint": forward} if own_adjoint else {})))
    assert {each.verdict for each in findings} == {"FAIL"}
    assert {words in each.note for each in findings} == {True}


def test_the_same_propagator_without_a_mistake_passes():
    assert {each.verdict for each in check_propagator(Written)} == {"PASS"}
    assert {each.verdict for each in check_propagator(written(flaw="paraxial"), physics="paraxial")} == {"PASS"}


def test_shifts_that_differ_at_odd_sizes_alone_pass_at_even_ones():
    assert found(written(flaw="shift", padding=3), "white field, 96").verdict == "PASS"


def test_an_exact_model_is_not_the_paraxial_one_that_it_claims_to_be():
    assert found(Written, "white field, 96", physics="paraxial").verdict == "FAIL"


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


def test_the_table_is_printed_and_counted(capsys):
    assert main() == 0
    out = capsys.readouterr().out
    assert out.count("12 passed, 0 failed, 0 not applicable") == len(SHIPPED)
    assert "FAIL" not in out
    assert main({"mine": Subject(InNumpy), "empty": Subject(written(forward=lambda self, field: 0 * field))}) == 1
    out = capsys.readouterr().out
    assert "reason: no adjoint, and no gradient through numpy" in out
    assert "reason: the result is nothing but zeros" in out
    assert max(len(line) for line in out.splitlines()) <= 100
