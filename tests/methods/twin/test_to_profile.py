"""A display that is made of a twin shows what the twin predicts."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import pytest
import torch
from torch import Tensor, nn
from torch.nn import functional

from holobench_eval.core.errors import UserError
from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import Profile, load_profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages.relay import finer_grid, sample, sampling_grid
from holobench_eval.methods.calibrated.approximator import PredictedCapture
from holobench_eval.methods.twin.model import TwinCamera, TwinModel
from holobench_eval.methods.twin.to_profile import to_profile
from holobench_eval.methods.wirtinger import Wirtinger
from tests.support.open_loop import Bench

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
def test_the_display_agrees_with_the_twin_within_two_percent_and_three_with_a_blaze(
    tmp_path: Path, pupil: float, blaze: tuple[float, float]
) -> None:
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


def test_a_display_made_of_an_untrained_twin_has_its_panel(tmp_path: Path) -> None:
    display = base(0.8, (0.0, 0.0))
    untrained = TwinModel(display.spec()), TwinCamera(display.spec())
    profile = load_profile(str(to_profile(*untrained, named(display, "lab"), tmp_path)))
    assert replace(profile.spec(), name="ideal") == display.spec()
    assert "sensor_area" not in {effect.name for effect in profile.effects()}


def test_a_twin_of_another_panel_is_refused(tmp_path: Path) -> None:
    spec = base(0.8, (0.0, 0.0)).spec()
    with pytest.raises(UserError, match=r"^'lab': the model is not of this panel"):
        to_profile(TwinModel(spec), TwinCamera(spec), named(base(0.7, (0.0, 0.0)), "lab"), tmp_path)
