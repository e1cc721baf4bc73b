"""A learned model tells the same numbers however its gauge freedoms were used up, and tells those of its display."""

import cmath
import math
from dataclasses import replace

import pytest
import torch

from holobench_eval.display import load_profile
from holobench_eval.display.api import DisplaySpec
from holobench_eval.display.estimates import focusing, joined, reach, zernike_waves
from holobench_eval.display.simulated.ground_truth import truth
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages import Crosstalk, LookUpTable, Propagation, ZeroOrder
from holobench_eval.methods.calibrated.diagnosis import diagnose
from holobench_eval.methods.calibrated.display_model import KNOTS, MODES, SOURCE_GRID, DisplayModel
from holobench_eval.methods.calibrated.patterns import random_phase
from holobench_eval.methods.hil.plus import HILPlus
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.optics.phase import TAU

COLOUR = 1


@pytest.fixture(scope="module")
def spec() -> DisplaySpec:
    return load_profile("ideal").spec((64, 64))


def told(model: DisplayModel) -> dict[str, float]:
    return {one.name: one.value for one in diagnose(model) if one.colour == COLOUR}


@torch.no_grad()
def bent(spec: DisplaySpec, gain: float, offset: float, ratio: complex) -> DisplayModel:
    """A table of exponent 1.2 and stroke 0.9, at any slope and constant; ``ratio`` of unmodulated light at level 0."""
    model, level = DisplayModel(spec), torch.linspace(0, 1, KNOTS)
    model.gain[COLOUR] = math.log(gain)
    model.table[COLOUR] = TAU * ((0.9 * level**1.2 + offset) / gain - level)
    turned = ratio * cmath.exp(1j * TAU * offset)
    model.undiffracted[COLOUR] = torch.tensor([turned.real, turned.imag])
    return model


def test_a_neutral_model_tells_an_ideal_display(spec: DisplaySpec) -> None:
    found = told(DisplayModel(spec))
    assert "undiffracted_phase" not in found
    for name, value in found.items():
        wanted = {"lut_exponent": 1, "phase_gain": 1, "light": 1, "crosstalk": 0.3}.get(name, 0)
        assert value == pytest.approx(wanted, abs=1e-5), name


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (1.3, 0.0), (0.8, 0.25), (1.1, -0.4)])
def test_slope_and_constant_of_the_table_are_not_told(spec: DisplaySpec, gain: float, offset: float) -> None:
    ratio = 0.5 * cmath.exp(-0.7j)
    found = told(bent(spec, gain, offset, ratio))
    assert found["lut_exponent"] == pytest.approx(1.2, abs=1e-3)
    assert found["phase_gain"] == pytest.approx(0.9, abs=1e-3)
    assert found["undiffracted_fraction"] == pytest.approx(0.2)
    assert found["undiffracted_phase"] == pytest.approx(-0.7, abs=1e-3)


@torch.no_grad()
def test_amplitude_and_brightness_are_told_as_light(spec: DisplaySpec) -> None:
    model = DisplayModel(spec)
    model.amplitude.fill_(0.4)
    model.brightness.fill_(-0.8)
    assert told(model)["light"] == pytest.approx(1, abs=1e-5)
    model.undiffracted[COLOUR, 0] = 0.5
    assert told(model)["light"] == pytest.approx(1.25, abs=1e-5)
    model.brightness += math.log(0.9)
    assert told(model)["light"] == pytest.approx(0.9 * 1.25, abs=1e-5)


@torch.no_grad()
def test_a_curved_beam_and_the_aberration_that_undoes_it_tell_nothing(spec: DisplaySpec) -> None:
    model = DisplayModel(spec)
    side = torch.linspace(-1, 1, SOURCE_GRID)
    beam = 0.5 * side[:, None] ** 2 - 0.3 * side[:, None] * side[None, :] + 0.1 * side[None, :] ** 2
    model.angle[COLOUR] = beam
    alone = told(model)
    assert abs(alone["defocus"]) > 0.005
    edges = torch.linspace(-1, 1, 64, dtype=torch.float64)
    fine = 0.5 * edges[:, None] ** 2 - 0.3 * edges[:, None] * edges[None, :] + 0.1 * edges[None, :] ** 2
    lens = focusing(fine, reach(spec.wavelengths[COLOUR], spec.distance, spec.pitch, spec.pupil))
    model.aberration[COLOUR] = -TAU * torch.tensor([zernike_waves(lens)[name] for name in MODES])
    for name in MODES:
        assert told(model)[name] == pytest.approx(0, abs=0.02 * abs(alone["defocus"])), name


@torch.no_grad()
def test_coefficients_are_told_in_waves(spec: DisplaySpec) -> None:
    model = DisplayModel(spec)
    model.aberration[COLOUR, MODES.index("coma_x")] = TAU * 0.05
    found = told(model)
    assert found["coma_x"] == pytest.approx(0.05, abs=1e-6)
    assert found["coma_y"] == pytest.approx(0, abs=1e-6)


def seen(bench: SimulatedBench, count: int) -> list[Sample]:
    """Captures without noise of speckle-like patterns."""
    samples, spec = [], bench.spec
    for number in range(count):
        draw = torch.Generator().manual_seed(number)
        phase = random_phase(len(spec.wavelengths), spec.shape, (1.5, 3.0)[number % 2], draw)
        shown = torch.stack([spec.region.crop(bench.image(phase)[colour]) for colour in range(len(phase))])
        samples.append(Sample(phase, shown, shown, torch.ones(len(phase))))
    return samples


def test_a_model_that_learned_from_speckle_patterns_tells_its_display_within_the_stated_errors() -> None:
    profile = replace(
        load_profile("ideal"),
        sampling=3,
        lut=LookUpTable(gamma=(1.2, 1.1, 0.95), gain=(0.9, 0.95, 1.05)),
        crosstalk=Crosstalk(0.4),
        zero_order=ZeroOrder(0.12, 0.8),
        propagation=Propagation(distance_error=0.01, aberration={"astigmatism_0": 0.06, "coma_x": -0.04}),
    )
    bench = SimulatedBench(profile.scaled((64, 64)))
    samples = seen(bench, 8)
    approximator, steps = HILPlus().approximator(bench.spec), 240
    for step in range(steps):
        approximator.step(samples[step % len(samples)], step / steps)
    rows = joined(diagnose(approximator.model), truth(bench))
    assert len(rows) == 3 * 12
    off = {(row["name"], row["colour"]): difference(row) for row in rows}
    outside = {key: value for key, value in off.items() if value > 1}
    assert not outside


def difference(row: dict[str, object]) -> float:
    """In units of the stated error."""
    value, known, error = (row[key] for key in ("value", "truth", "error"))
    return abs(value - known) / error
