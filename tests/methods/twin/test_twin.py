"""A twin's display shows what it predicts, its numbers have errors, and drift is told apart from both."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import pytest
import torch
from torch import Tensor, nn
from torch.nn import functional

from holobench_eval.core.errors import UserError
from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import Profile, load_profile
from holobench_eval.display.api import DisplaySpec
from holobench_eval.display.estimates import QUANTITIES, joined
from holobench_eval.display.simulated.ground_truth import truth
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages.relay import finer_grid, sample, sampling_grid
from holobench_eval.methods.calibrated.approximator import PredictedCapture, Rates
from holobench_eval.methods.calibrated.patterns import random_phase
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.methods.twin.drift import TwinApproximator, taken
from holobench_eval.methods.twin.errors import LEFT, MISFIT, NUDGES, QUANTILE, estimates, unseen
from holobench_eval.methods.twin.model import TwinCamera, TwinModel, picked
from holobench_eval.methods.twin.to_profile import to_profile
from holobench_eval.methods.wirtinger import Wirtinger
from tests.support.open_loop import Bench
from tests.support.small_training import small_spec

PANEL = (96, 112)
LIGHT = torch.tensor([0.5, 0.7, 0.9])
AWAY = {
    **{"table": 0.15, "gain": 0.03, "crosstalk": 0.2, "amplitude": 0.1, "angle": 0.15, "undiffracted": 0.15},
    **{"aberration": 0.1, "brightness": 0.2, "specks": 0.5, "share": 0.5, "reach": 0.3, "offset": 0.01},
    **{"shading": 0.05, "blur": 0.2, "gamma": 0.1, "moved": 0.3},
}
M = TypeVar("M", bound=nn.Module)


def learned(module: M) -> M:
    """Every parameter away from its start value, another for each colour."""
    draw = torch.Generator().manual_seed(5)
    with torch.no_grad():
        for name, parameter in module.named_parameters():
            parameter += AWAY.get(name, 0.1) * torch.randn(parameter.shape, generator=draw)
    return module


def base(pupil: float | None, blaze: tuple[float, float]) -> Profile:
    profile = load_profile("ideal").scaled(PANEL)
    return replace(profile, panel=replace(profile.panel, pupil=pupil, blaze=blaze, region=0.8))


def named(profile: Profile, name: str) -> Profile:
    return replace(profile, name=name)


@torch.no_grad()
def both(
    model: TwinModel, camera: TwinCamera, path: Path, phase: Tensor, white: Tensor = LIGHT
) -> tuple[Tensor, Tensor]:
    """Prediction of the model and light on the camera of the display, in the region and the unit of a white pixel."""
    profile = load_profile(str(path))
    bench, sensor, shape = SimulatedBench(profile), profile.sensor, profile.panel.shape
    centres = torch.stack(torch.meshgrid(*map(torch.arange, shape), indexing="ij"), dim=-1).double()
    grid = finer_grid(sampling_grid(profile.relay.displaced(centres, shape), shape), [2 * side for side in shape], 2)
    seen = (sample(bench.integrated(each, c) / white[c], grid, 1) for c, each in enumerate(phase))
    light = [sensor.toned(each, c) + sensor.surrounding(c) for c, each in enumerate(seen)]
    return PredictedCapture(model, None, camera)(phase, white), bench.spec.region.crop(torch.stack(light))


def smooth() -> Tensor:
    draw = torch.Generator().manual_seed(1)
    return functional.interpolate(4 * torch.randn(1, 3, 8, 8, generator=draw), size=PANEL, mode="bicubic")[0]


def speckle() -> Tensor:
    return math.tau * torch.rand(3, *PANEL, generator=torch.Generator().manual_seed(2))


@pytest.mark.parametrize("blaze", [(0.0, 0.0), (0.125, 0.25)])
@pytest.mark.parametrize("pupil", [0.8, 0.45])
def test_the_display_agrees_with_the_twin_within_two_or_with_a_blaze_three_percent(tmp_path, pupil, blaze) -> None:
    display = base(pupil, blaze)
    model, camera = learned(TwinModel(display.spec())), learned(TwinCamera(display.spec()))
    path = to_profile(model, camera, named(display, "lab"), tmp_path)
    picture = Photographs(names=("coffee",)).load("coffee", display.spec().region.shape)[None].float()
    hologram = Wirtinger(iterations=50).solve(picture, Bench(display.spec()))[0]
    for phase in (smooth(), hologram, speckle()):
        predicted, shown = both(model, camera, path, phase)
        assert float((shown - predicted).norm() / predicted.norm()) < (0.03 if any(blaze) else 0.02)


@pytest.mark.parametrize("bits", [8, 1])
def test_a_display_of_one_wavelength_and_odd_sides_has_a_twin_too(tmp_path: Path, bits: int) -> None:
    display = base(0.8, (0.0, 0.0))
    panel = replace(display.panel, shape=(89, 103), wavelengths=(5.32e-7,), bits=bits)
    display = replace(display, name="lab", panel=panel)
    model, camera = learned(TwinModel(display.spec())), learned(TwinCamera(display.spec()))
    path, phase = to_profile(model, camera, display, tmp_path), smooth()[:1, :89, :103]
    predicted, shown = both(model, camera, path, phase, LIGHT[:1])
    assert float((shown - predicted).norm() / predicted.norm()) < 0.02


def test_each_part_of_a_twin_reaches_the_display(tmp_path: Path) -> None:
    display = base(0.8, (0.0, 0.0))
    model, camera = learned(TwinModel(display.spec())), learned(TwinCamera(display.spec()))
    with torch.no_grad():
        model.aberration.zero_()
    whole, before = both(model, camera, to_profile(model, camera, named(display, "lab"), tmp_path), smooth())
    draw = torch.Generator().manual_seed(6)
    for module in (model, camera):
        for name, parameter in module.named_parameters():
            if name == "drift":  # of the photographs, and of no display
                continue
            kept = parameter.detach().clone()
            with torch.no_grad():
                parameter += 3 * AWAY.get(name, 0.1) * torch.randn(parameter.shape, generator=draw)
            predicted, shown = both(model, camera, to_profile(model, camera, named(display, "lab"), tmp_path), smooth())
            apart = predicted - whole
            assert (shown - before - apart).norm() < 0.3 * apart.norm(), name
            with torch.no_grad():
                parameter.copy_(kept)


def test_a_display_made_of_an_untrained_twin_has_its_panel_and_one_of_another_panel_is_refused(tmp_path: Path) -> None:
    display = base(0.8, (0.0, 0.0))
    untrained = TwinModel(display.spec()), TwinCamera(display.spec())
    profile = load_profile(str(to_profile(*untrained, named(display, "lab"), tmp_path)))
    assert replace(profile.spec(), name="ideal") == display.spec()
    assert "sensor_area" not in {effect.name for effect in profile.effects()}
    with pytest.raises(UserError, match=r"^'lab': the model is not of this panel"):
        to_profile(*untrained, named(base(0.7, (0.0, 0.0)), "lab"), tmp_path)


def spec(name: str = "leto-aged") -> DisplaySpec:
    return load_profile(name).scaled((80, 96)).spec()


def halves(spec: DisplaySpec, apart: float = 0.0, hidden: tuple[str, ...] = ()) -> dict[str, Any]:
    """Halves whose crosstalk is so far apart [px]."""
    states = []
    for width in (0.4, 0.4 - apart / 2, 0.4 + apart / 2):
        model, camera = TwinModel(spec), TwinCamera(spec)
        with torch.no_grad():
            model.crosstalk.fill_(math.log(width))
            camera.share.fill_(0.0)
        states.append({"model": model.state_dict(), "terms": camera.state_dict()})
    whole, *halves = states
    return {**whole, "halves": halves, "unseen": list(hidden)}


@pytest.mark.parametrize("apart", [0.0, 0.1])
def test_an_error_is_that_of_the_halves_and_not_below_misfit(apart: float) -> None:
    found = {item.name: item.error for item in estimates(halves(spec(), apart), spec()) if item.colour == 1}
    usual = QUANTITIES["crosstalk"].error
    assert found["crosstalk"] == pytest.approx(max(QUANTILE * apart / 2, LEFT["crosstalk"] * usual), rel=1e-3)
    assert found["coma_x"] == pytest.approx(MISFIT * QUANTITIES["coma_x"].error)


def test_what_is_not_seen_is_told_without_an_error() -> None:
    rows = joined(estimates(halves(spec(), hidden=("coma_y",)), spec()), [])
    hidden = [row for row in rows if row.get("seen") is False]
    assert [row["name"] for row in hidden] == ["coma_y"] * 3
    assert all(row["error"] is None for row in hidden)


def test_light_is_what_the_camera_counts() -> None:
    state = halves(spec())
    before = {item.colour: item.value for item in estimates(state, spec()) if item.name == "light"}
    for each in (state, *state["halves"]):
        each["terms"]["gain"] = torch.full((3,), math.log(0.9))
    after = {item.colour: item.value for item in estimates(state, spec()) if item.name == "light"}
    assert after == pytest.approx({colour: 0.9 * value for colour, value in before.items()})


def test_what_a_twin_says_is_the_truth_of_its_profile(tmp_path: Path) -> None:
    base = Profile("lab", 1, 0, "", panel=load_profile("leto-aged").scaled((80, 96)).panel)
    model, camera, draw = TwinModel(base.spec()), TwinCamera(base.spec()), torch.Generator().manual_seed(4)
    with torch.no_grad():
        camera.share.fill_(-2.0)
        for parameter, size in ((model.table, 0.1), (model.undiffracted, 0.3), (camera.shading, 0.1)):
            parameter += size * torch.randn(parameter.shape, generator=draw)
        camera.gain.fill_(-0.1)
    state = {"model": model.state_dict(), "terms": camera.state_dict()}
    told = estimates({**state, "halves": [state] * 2, "unseen": []}, base.spec())
    known = truth(SimulatedBench(load_profile(str(to_profile(model, camera, base, tmp_path)))))
    for row in joined(told, known):
        if row["truth"] is not None:
            assert row["value"] == pytest.approx(row["truth"], abs=0.01), row["name"]


@torch.no_grad()
def samples(model: TwinModel, camera: TwinCamera) -> list[Sample]:
    """Speckle, with noise that nothing can explain."""
    draw, made = torch.Generator().manual_seed(3), []
    for length in (2.0, 4.0, 8.0):
        phase = random_phase(3, model.spec.shape, length, draw)
        image = PredictedCapture(model, None, camera)(phase, LIGHT)
        made.append(Sample(phase, image + 0.02 * torch.randn(image.shape, generator=draw), image, LIGHT))
    return made


def test_all_that_a_display_on_axis_has_is_seen_but_for_haze_that_it_has_not() -> None:
    model, camera = TwinModel(spec()), TwinCamera(spec())
    with torch.no_grad():
        model.undiffracted[:, 0] = 0.5
        camera.share.fill_(-12.0)
    assert unseen(model, camera, samples(model, camera)) == ["stray_reach"]


def test_unmodulated_light_that_a_blaze_moves_out_of_the_iris_is_not_seen() -> None:
    own = spec("leto-2020-01")
    model, camera = TwinModel(own), TwinCamera(own)
    assert unseen(model, camera, samples(model, camera))[:2] == ["undiffracted_fraction", "undiffracted_phase"]


@pytest.mark.parametrize("name", sorted(NUDGES))
def test_a_nudge_moves_its_quantity_by_its_amount(name: str) -> None:
    own, amount = spec(), QUANTITIES[name].error
    model, camera = TwinModel(own), TwinCamera(own)
    with torch.no_grad():
        model.undiffracted[:, 0] = 0.5
        camera.share.fill_(-1.0)
        before = {"model": {k: v.clone() for k, v in model.state_dict().items()}, "terms": camera.state_dict()}
        before["terms"] = {k: v.clone() for k, v in before["terms"].items()}
        NUDGES[name](model, camera, amount)
    after = {"model": model.state_dict(), "terms": camera.state_dict()}
    moved = [
        {
            item.name: item.value
            for item in estimates({**state, "halves": [state] * 2, "unseen": []}, own)
            if item.colour == 0
        }
        for state in (before, after)
    ]
    assert moved[1][name] - moved[0][name] == pytest.approx(amount, rel=0.3)  # light: without the unmodulated part


SPEC = small_spec(size=64, region=48)
COUNT, DRIFT, POWER = 24, (1.5, -1.0), 0.05  # photographs; px in 100 of them; rms


def photographs(drift: tuple[float, float], power: float) -> list[Sample]:
    """Of a nominal display: three of one hologram, and others between."""
    draw, camera = torch.Generator().manual_seed(1), TwinCamera(SPEC)
    shown = PredictedCapture(TwinModel(SPEC), None, camera)
    phases = [random_phase(1, SPEC.shape, 4.0, draw) for _ in range(COUNT)]
    phases[COUNT // 2] = phases[-1] = phases[0]
    light = torch.ones(1)
    samples = [Sample(phase, light, light, light, number) for number, phase in enumerate(phases)]
    with torch.no_grad():
        camera.drift.copy_(torch.tensor(drift))
        for number, sample in enumerate(samples):
            with taken(camera, sample):
                bright = 1 + power * float(torch.randn((), generator=draw))
                samples[number] = replace(sample, capture=bright * shown(sample.phase, light))
    return samples


def fitted(samples: list[Sample], exposed: bool = True, passes: int = 5) -> TwinApproximator:
    approximator = TwinApproximator(SPEC, Rates(model=3e-3, terms=5e-2))
    if exposed:
        approximator.steadied([samples[number] for number in (0, COUNT // 2, COUNT - 1)])
    for step in range(passes * COUNT):
        approximator.step(samples[step % COUNT], step / (passes * COUNT))
    return approximator


def test_a_picture_that_moves_is_found_and_left_out_of_the_display() -> None:
    samples = photographs(DRIFT, 0.0)
    approximator = fitted(samples, passes=8)
    assert approximator.terms.drift.tolist() == pytest.approx(DRIFT, abs=0.25)
    assert float(approximator.terms.moved.abs().max()) < 0.1
    with torch.no_grad():  # as it was registered
        predicted = approximator.image(samples[0].light)(samples[0].phase)
    assert float((predicted - samples[0].capture).norm() / samples[0].capture.norm()) < 0.05


def test_power_that_varies_is_told_by_one_hologram_and_not_learned_and_the_light_of_the_display_is_found() -> None:
    samples = [replace(sample, capture=0.7 * sample.capture) for sample in photographs((0.0, 0.0), POWER)]
    known, unknown = fitted(samples), fitted(samples, exposed=False)
    assert float(known.terms.power) == pytest.approx(POWER, rel=0.8)
    assert float(unknown.terms.power) == 0
    last = [float(each.step(sample, 1.0)["l1"]) for each in (known, unknown) for sample in samples[:8]]
    assert sum(last[:8]) < 0.5 * sum(last[8:])

    with torch.no_grad():
        predicted = torch.stack([known.image(sample.light)(sample.phase).mean() for sample in samples])
    wanted = torch.stack([sample.capture.mean() for sample in samples])
    assert float(predicted.mean() / wanted.mean()) == pytest.approx(1.0, abs=0.02)
    steady = fitted(photographs((0.0, 0.0), 0.0)).terms
    assert float(steady.power) < 1e-6
    assert steady.drift.abs().max() < 0.1


def test_captures_that_are_held_out_are_predicted_where_the_picture_was() -> None:
    samples, approximator = photographs(DRIFT, 0.0), TwinApproximator(SPEC, Rates(model=1e-3))
    with torch.no_grad():
        approximator.terms.drift.copy_(torch.tensor(DRIFT))
        for sample in samples[-4:]:
            assert torch.allclose(approximator.predicted(sample), sample.capture, atol=1e-5)


def test_pixels_are_picked_as_torch_samples_them() -> None:
    draw = torch.Generator().manual_seed(2)
    image, at = torch.rand(2, 9, 12, generator=draw), 16 * torch.rand(2, 5, 6, generator=draw) - 2
    grid = torch.stack([2 * at[1] / 11 - 1, 2 * at[0] / 8 - 1], -1).expand(2, -1, -1, -1)
    wanted = torch.nn.functional.grid_sample(image[:, None], grid, "bilinear", "border", align_corners=True)[:, 0]
    assert torch.allclose(picked(image, at), wanted, atol=1e-5)
