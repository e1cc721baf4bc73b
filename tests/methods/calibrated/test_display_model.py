"""Each number of the display model does to the light what it is named for, and a fit finds the numbers of a display."""

import copy
import math
import pickle
from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor
from torch.nn import functional

from holobench_eval.display import load_profile
from holobench_eval.display.api import DisplaySpec, Region
from holobench_eval.display.nominal import ideal_image
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages import Crosstalk, LookUpTable
from holobench_eval.methods.calibrated.display_model import KNOTS, MODES, DisplayModel
from holobench_eval.methods.calibrated.phase_gamma import corrected
from holobench_eval.optics import AngularSpectrum
from holobench_eval.optics.phase import TAU
from holobench_eval.optics.phasor import squared_modulus

NO_CROSSTALK = -20.0


def spec_of(size: int = 48, margin: int = 4, distance: float = 4e-3, pupil: float | None = None) -> DisplaySpec:
    """distance 0: what the model makes of the panel is what it gives, in the region."""
    region = Region(margin, margin, size - 2 * margin, size - 2 * margin)
    return DisplaySpec("small", (size, size), 6.4e-6, (636e-9, 446e-9), distance, 8, pupil, region)


def sharp(spec: DisplaySpec) -> DisplayModel:
    """A neutral model, without crosstalk."""
    model = DisplayModel(spec)
    with torch.no_grad():
        model.crosstalk.fill_(NO_CROSSTALK)
    return model


def random_phase(spec: DisplaySpec) -> Tensor:
    """Far beyond one turn to both sides."""
    return 30 * (torch.rand(2, *spec.shape, generator=torch.Generator().manual_seed(1)) - 0.5)


def smooth_phase(spec: DisplaySpec) -> Tensor:
    """Inside one turn."""
    coarse = torch.rand(1, 2, 5, 5, generator=torch.Generator().manual_seed(2))
    return 0.5 + 4 * functional.interpolate(coarse, spec.shape, mode="bicubic", align_corners=True)[0].clamp(0, 1)


def ideal(spec: DisplaySpec, panel: Tensor) -> Tensor:
    return spec.region.crop(torch.stack([spec.propagator(c).forward(one) for c, one in enumerate(panel)]))


def on_panel(phase: Tensor) -> Tensor:
    return torch.polar(torch.ones_like(phase), phase)


@pytest.mark.parametrize("pupil", [None, 0.8])
def test_a_neutral_model_without_crosstalk_is_the_ideal_display(pupil: float | None) -> None:
    spec = spec_of(pupil=pupil)
    phase = random_phase(spec)
    with torch.no_grad():
        field = sharp(spec)(phase)
    assert field.shape == (2, *spec.region.shape)
    assert torch.allclose(field, ideal(spec, on_panel(phase)), atol=1e-4)


def intensity_of(model: DisplayModel, phase: Tensor) -> Tensor:
    return squared_modulus(model(phase))


def test_a_neutral_model_keeps_a_constant_phase_exactly() -> None:
    spec = spec_of()
    phase = torch.tensor([0.5, 4.0]).view(2, 1, 1).expand(2, *spec.shape)
    with torch.no_grad():
        assert torch.allclose(DisplayModel(spec)(phase), ideal(spec, on_panel(phase)), atol=1e-4)


def test_a_neutral_model_dims_a_ramp_by_the_mean_over_its_three_blurred_samples() -> None:
    """Of a ramp, the Gaussian moves each sample by its mean offset alone: a factor, and no change of phase."""
    spec, slopes = spec_of(distance=0.0), (0.03, 0.08)
    rows, columns = (torch.arange(48.0).view(shape) for shape in ((-1, 1), (1, -1)))
    phase = (0.5 + slopes[0] * rows + slopes[1] * columns).expand(2, 48, 48)
    position = torch.tensor([-1.0, 0.0, 1.0]) / 3
    offset = torch.arange(-2.0, 3.0) - position[:, None]
    edges = [torch.erf((offset + side) / (0.3 * math.sqrt(2))) for side in (0.5, -0.5)]
    share = (edges[0] - edges[1]) / (edges[0] - edges[1]).sum(1, keepdim=True)
    moved = (share * torch.arange(-2.0, 3.0)).sum(1)
    assert float(moved[1]) == pytest.approx(0, abs=1e-6)
    assert float(moved[0]) == pytest.approx(-float(moved[2]), abs=1e-6)
    factor = math.prod((1 + 2 * math.cos(slope * float(moved[2]))) / 3 for slope in slopes)
    with torch.no_grad():
        field = DisplayModel(spec)(phase)
    assert torch.allclose(field, factor * spec.region.crop(on_panel(phase)), atol=1e-5)


@pytest.mark.parametrize("knot", [0, 5, KNOTS - 1])
def test_the_table_moves_the_driven_phase_around_its_knot_alone(knot: int) -> None:
    spec = spec_of(distance=0.0)
    model = sharp(spec)
    level = (torch.arange(40.0) / 40 * (KNOTS - 1)).expand(2, 40, 40)
    phase = functional.pad(level * TAU / (KNOTS - 1), (4, 4, 4, 4))
    with torch.no_grad():
        model.table[1, knot] = 0.7
        shown = model(phase)
    moved = (shown * spec.region.crop(on_panel(phase)).conj()).angle()
    assert moved[0].abs().max() < 1e-4
    expected = 0.7 * (1 - (level[1] - knot).abs()).clamp_min(0)
    assert torch.allclose(moved[1], expected, atol=1e-4)
    assert expected.max() > 0.3


def test_the_gain_scales_the_wrapped_phase_where_it_is() -> None:
    spec = spec_of(distance=0.0)
    model, phase = sharp(spec), random_phase(spec)
    with torch.no_grad():
        model.gain[1] = math.log(0.8)
        shown = model(phase)
        expected = torch.stack([phase[0], 0.8 * phase[1].remainder(TAU)])
        assert torch.allclose(shown, spec.region.crop(on_panel(expected)), atol=1e-4)
        model.gain.zero_()
        model.gain[:, :, 0] = 0.1
        change = (model(torch.ones_like(phase)) * torch.polar(torch.tensor(1.0), torch.tensor(-1.0))).angle()
    assert change[:, :, 0].min() > 0.05
    assert change[:, :, -1].abs().max() < 0.02


def test_crosstalk_turns_a_wrap_edge_into_a_ramp_as_wide_as_it_says() -> None:
    """The phase of the three samples of a pixel near the edge, where they are not far apart, is the blurred step's."""
    spec = spec_of(distance=0.0)
    phase = torch.full((2, *spec.shape), 1.0)
    phase[:, :, 24:] = 1.6
    model, middle = sharp(spec), spec.region.width // 2
    with torch.no_grad():
        assert torch.allclose(model(phase), spec.region.crop(on_panel(phase)), atol=1e-5)
        model.crosstalk[0] = math.log(0.4)
        model.crosstalk[1] = math.log(0.8)
        shown = model(phase)[:, 20].angle()
    for row, width in zip(shown, (0.4, 0.8), strict=True):
        for pixel in range(-3, 3):
            place = (pixel + 0.5 + torch.tensor([-1.0, 0.0, 1.0]) / 3).double()
            step = 1.3 + 0.3 * torch.erf(place / (width * math.sqrt(2)))
            assert float(row[middle + pixel]) == pytest.approx(float(step.mean()), abs=5e-3)


def test_amplitude_and_angle_multiply_the_illumination() -> None:
    spec = spec_of(distance=0.0)
    model, phase = sharp(spec), random_phase(spec)
    with torch.no_grad():
        model.amplitude[0] = math.log(0.5)
        model.angle[0] = 0.3
        model.angle[1] = torch.linspace(0, 1, model.angle.shape[-1])
        model.undiffracted[0, 0] = 0.2
        shown = model(phase)
    panel = spec.region.crop(on_panel(phase))
    lit = 0.5 * torch.polar(torch.tensor(1.0), torch.tensor(0.3))
    assert torch.allclose(shown[0], lit * (panel[0] + 0.2), atol=1e-4)
    tilt = spec.region.crop(torch.linspace(0, 1, 48).expand(48, 48))
    # the interpolation of a line bends a little at its ends
    assert torch.allclose(shown[1], panel[1] * torch.polar(torch.ones_like(tilt), tilt), atol=0.02)


@pytest.mark.parametrize(("colour", "pupil"), [(0, None), (1, 0.8)])
def test_defocus_is_a_change_of_distance(colour: int, pupil: float | None) -> None:
    """sqrt(3) (2 r^2 - 1) over the iris against -pi lambda dz f^2: the quadratic terms are equal."""
    near = spec_of(96, 16, pupil=pupil)
    moved = 0.15 * near.distance
    edge = (pupil or 1.0) / 2 / near.pitch
    radians = -math.pi * near.wavelengths[colour] * moved * edge**2 / (2 * math.sqrt(3))
    # light in the middle alone, so that nothing crosses the region's border
    y, x = torch.meshgrid(*(torch.linspace(-1, 1, 96),) * 2, indexing="ij")
    model = sharp(near)
    spot = torch.exp(-((x / 0.15).square() + (y / 0.2).square()))
    model.illumination = lambda: spot.expand(2, 96, 96)  # type: ignore[method-assign]
    phase = (2 + 1.5 * torch.sin(12 * x + 5 * y)).expand(2, 96, 96)
    further = AngularSpectrum(near.shape, near.pitch, near.wavelengths[colour], near.distance + moved, pupil=pupil)
    expected = near.region.crop(further.forward(spot * on_panel(phase[colour]))).abs().square()
    with torch.no_grad():
        before = intensity_of(model, phase)[colour]
        model.aberration[colour, MODES.index("defocus")] = radians
        after = intensity_of(model, phase)[colour]
    assert (before - expected).norm() > 0.05 * expected.norm()
    assert (after - expected).norm() < 0.1 * (before - expected).norm()


def detuned(spec: DisplaySpec) -> DisplayModel:
    """A model in double precision, away from its neutral point."""
    model = DisplayModel(spec).double()
    draw = torch.Generator().manual_seed(4)
    with torch.no_grad():
        for value in model.parameters():
            value.add_(0.1 * torch.randn(value.shape, dtype=torch.float64, generator=draw))
    return model


NUMBERS = ("table", "gain", "crosstalk", "amplitude", "angle", "undiffracted", "aberration", "brightness")


def test_these_are_all_the_numbers() -> None:
    assert {name for name, _ in DisplayModel(spec_of()).named_parameters()} == set(NUMBERS)


@pytest.mark.parametrize("name", [*NUMBERS, "phase"])
def test_the_gradient_of_every_number_equals_finite_differences(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = spec_of(pupil=0.8)
    precise = [spec.propagator(channel, dtype=torch.complex128) for channel in range(2)]
    monkeypatch.setattr(DisplayModel, "_propagator", lambda self, channel, offset: precise[channel])
    model, phase = detuned(spec), smooth_phase(spec).double().requires_grad_()
    weights = torch.rand(2, *spec.region.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(3))

    def value() -> Tensor:
        return (weights * intensity_of(model, phase)).sum()

    number = phase if name == "phase" else model.get_parameter(name)
    (gradient,) = torch.autograd.grad(value(), number)
    direction = torch.randn(number.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(5))
    h, sides = 1e-6, []
    with torch.no_grad():
        for sign in (1, -1):
            number += sign * h * direction
            sides.append(float(value()))
            number -= sign * h * direction
    assert (sides[0] - sides[1]) / (2 * h) == pytest.approx(float((gradient * direction).sum()), rel=1e-4)


def test_a_held_model_gives_what_a_learning_one_gives_and_the_same_gradient() -> None:
    spec = spec_of()
    learning, held = DisplayModel(spec), DisplayModel(spec).requires_grad_(False)
    draw = torch.Generator().manual_seed(3)
    for ours, theirs in zip(learning.parameters(), held.parameters(), strict=True):
        with torch.no_grad():
            ours += 0.1 * torch.randn(ours.shape, generator=draw)
            theirs.copy_(ours)
    results = []
    for model in (learning, held, held):
        phase = random_phase(spec).requires_grad_()
        intensity = intensity_of(model, phase)
        (gradient,) = torch.autograd.grad(intensity.square().sum(), phase)
        results.append((intensity.detach(), gradient))
    (expected, slope), *others = results
    for intensity, gradient in others:
        assert torch.allclose(intensity, expected, rtol=1e-4, atol=1e-5)
        assert (gradient - slope).norm() < 1e-4 * slope.norm()


@pytest.mark.parametrize(
    "change",
    [
        lambda values: values.data.add_(1),
        lambda values: values.data.copy_(torch.ones_like(values)),
        lambda values: values.numpy().fill(1),
    ],
    ids=["data.add_", "data.copy_", "numpy"],
)
def test_a_held_model_notices_changes_that_torch_does_not_count(change: Callable[[Tensor], object]) -> None:
    spec = spec_of()
    held, phase = DisplayModel(spec).requires_grad_(False), random_phase(spec)
    before = intensity_of(held, phase)
    change(held.brightness)
    assert torch.allclose(intensity_of(held, phase), math.e * before, rtol=1e-4)


def test_a_held_model_follows_its_parameters_to_another_precision() -> None:
    spec = spec_of()
    held, phase = DisplayModel(spec).requires_grad_(False), random_phase(spec)
    held(phase)
    assert torch.equal(held.double()(phase.double()), DisplayModel(spec).double()(phase.double()))


@pytest.mark.parametrize("made", [False, True])
def test_a_model_held_in_inference_mode_gives_gradients_later(made: bool) -> None:
    """made: its parameters are made in that mode, too."""
    spec = spec_of()
    phase = random_phase(spec)
    with torch.inference_mode(made):
        held = DisplayModel(spec).requires_grad_(False)
    with torch.inference_mode():
        held(phase)
    results = []
    for model in (held, DisplayModel(spec).requires_grad_(False)):
        own = phase.clone().requires_grad_()
        results += torch.autograd.grad(intensity_of(model, own).square().sum(), own)
    assert torch.equal(*results)


def test_a_copy_of_a_held_model_does_not_carry_the_maps() -> None:
    spec = spec_of()
    held, phase = DisplayModel(spec).requires_grad_(False), random_phase(spec)
    size = len(pickle.dumps(held))
    shown = held(phase)
    assert len(pickle.dumps(held)) == size
    for other in (copy.deepcopy(held), pickle.loads(pickle.dumps(held))):
        assert other._held is None
        assert torch.equal(other(phase), shown)
    assert held._held is not None


PANEL = (128, 128)
GAMMA = 1.2


def bench_with(blaze: tuple[float, float], **stages: object) -> SimulatedBench:
    ideal = load_profile("ideal").scaled(PANEL)
    return SimulatedBench(replace(ideal, panel=replace(ideal.panel, blaze=blaze, pupil=0.45), **stages))


def bumps() -> Tensor:
    rows, columns = (torch.arange(side, dtype=torch.float32) for side in PANEL)
    wave = 2.5 * torch.sin(rows[:, None] / 9) * torch.cos(columns[None] / 7) + rows[:, None] / 20
    return wave.expand(3, -1, -1)


def unexplained(bench: SimulatedBench, model: DisplayModel) -> tuple[float, float]:
    """Squared error of the model and of the ideal image, at the best brightness, relative to the picture's power."""
    phase = bumps()
    with torch.no_grad():
        seen = bench.spec.region.crop(bench.image(phase))
        images = model(phase).abs().square(), ideal_image(phase, bench.spec)
    return tuple(
        float(1 - (image * seen).sum() ** 2 / (image.square().sum() * seen.square().sum())) for image in images
    )


@pytest.mark.parametrize("blaze", [(0.0, 0.0), (0.0, 0.25), (0.2, 0.0)])
def test_the_display_model_with_the_true_crosstalk_explains_the_picture_with_and_without_a_blaze(blaze) -> None:
    bench = bench_with(blaze, sampling=3, crosstalk=Crosstalk(width=0.36))
    model = DisplayModel(bench.spec)
    with torch.no_grad():
        model.crosstalk.fill_(math.log(0.36))
    known, ideal = unexplained(bench, model)
    assert known < 0.2 * ideal  # along a blaze, the light of a pixel also changes over the band


@pytest.mark.parametrize("blaze", [(0.0, 0.0), (0.0, 0.25)])
def test_the_display_model_with_the_true_table_explains_the_picture_with_and_without_a_blaze(blaze) -> None:
    bench = bench_with(blaze, lut=LookUpTable(gamma=(GAMMA, GAMMA, GAMMA)))
    model = DisplayModel(bench.spec)
    levels = torch.linspace(0, 1, KNOTS)
    with torch.no_grad():
        model.crosstalk.fill_(math.log(1e-3))
        model.table.copy_(TAU * (levels**GAMMA - levels).expand(3, -1))
    known, ideal = unexplained(bench, model)
    assert known < 0.1 * ideal


@pytest.mark.parametrize("blaze", [(0.0, 0.0), (0.0, 0.25)])
def test_the_inverse_gamma_undoes_that_of_the_panel_with_and_without_a_blaze(blaze) -> None:
    plain = bench_with(blaze)
    curved = bench_with(blaze, lut=LookUpTable(gamma=(GAMMA, GAMMA, GAMMA)))
    phase = bumps()
    with torch.no_grad():
        wanted, wrong = plain.image(phase), curved.image(phase)
        right = curved.image(corrected(phase, 1 / GAMMA, curved.spec))
    assert (right - wanted).square().mean() < 0.02 * (wrong - wanted).square().mean()
