"""A display that is made of a learned model shows what the model predicts."""

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
from holobench_eval.display import Profile, load_profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.methods.calibrated.approximator import PredictedCapture
from holobench_eval.methods.calibrated.display_model import DisplayModel
from holobench_eval.methods.calibrated.hybrid import FinePanel
from holobench_eval.methods.calibrated.terms import Haze, ImageTerms
from holobench_eval.methods.calibrated.to_profile import to_profile

PANEL = (96, 112)
LIGHT = torch.tensor([0.5, 0.7, 0.9])
AWAY = {
    **{"table": 0.15, "gain": 0.03, "crosstalk": 0.2, "amplitude": 0.1, "angle": 0.15, "undiffracted": 0.15},
    **{"aberration": 0.1, "brightness": 0.2, "fine": 0.05, "share": 0.5, "reach": 0.3, "offset": 0.01},
    **{"shading": 0.05, "blur": 0.2, "gamma": 0.1},
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


def at_levels(phase: Tensor, bench: SimulatedBench) -> Tensor:
    """Phases whose sum with the blaze is at the panel's levels, or a little above: the model rounds to none."""
    step = math.tau / 2**bench.spec.bits
    return torch.round((phase + bench.ramp) / step) * step - bench.ramp + 1e-4


@torch.no_grad()
def both(model: DisplayModel, terms: Haze, path: Path, phase: Tensor) -> tuple[Tensor, Tensor]:
    """Prediction of the model and light on the camera of the display, in the region and the unit of a white pixel."""
    profile = load_profile(str(path))
    bench, sensor = SimulatedBench(profile), profile.sensor
    phase = at_levels(phase, bench)
    light = [sensor.toned(each / LIGHT[c], c) + sensor.surrounding(c) for c, each in enumerate(bench.image(phase))]
    return PredictedCapture(model, None, terms)(phase, LIGHT), bench.spec.region.crop(torch.stack(light))


def smooth() -> Tensor:
    draw = torch.Generator().manual_seed(1)
    return functional.interpolate(4 * torch.randn(1, 3, 8, 8, generator=draw), size=PANEL, mode="bicubic")[0]


def speckle() -> Tensor:
    return math.tau * torch.rand(3, *PANEL, generator=torch.Generator().manual_seed(2))


@pytest.mark.parametrize("blaze", [(0.0, 0.0), (0.125, 0.25)])
@pytest.mark.parametrize("pupil", [None, 0.45])
@pytest.mark.parametrize(("kind", "terms_kind"), [(DisplayModel, Haze), (FinePanel, ImageTerms)])
def test_the_display_agrees_with_the_model_within_two_percent_of_the_light(
    tmp_path: Path,
    kind: type[DisplayModel],
    terms_kind: type[Haze],
    pupil: float | None,
    blaze: tuple[float, float],
) -> None:
    display = base(pupil, blaze)
    model, terms = learned(kind(display.spec())), learned(terms_kind(display.spec()))
    path = to_profile(model, terms, display, "lab", tmp_path)
    predicted, shown = both(model, terms, path, smooth())
    assert float((shown - predicted).norm() / predicted.norm()) < 0.02
    with torch.no_grad():  # without the circle of the discrete transform, patterns of the finest grain agree too
        model.aberration.zero_()
    predicted, shown = both(model, terms, to_profile(model, terms, display, "flat", tmp_path), speckle())
    assert float((shown - predicted).norm() / predicted.norm()) < 0.01


def test_each_part_of_a_model_reaches_the_display(tmp_path: Path) -> None:
    display = base(0.8, (0.0, 0.0))
    model, terms = learned(DisplayModel(display.spec())), learned(ImageTerms(display.spec()))
    with torch.no_grad():
        model.aberration.zero_()
    whole, _ = both(model, terms, to_profile(model, terms, display, "lab", tmp_path), smooth())
    draw = torch.Generator().manual_seed(6)
    for module in (model, terms):
        for name, parameter in module.named_parameters():
            kept = parameter.detach().clone()
            with torch.no_grad():
                parameter += 3 * AWAY.get(name, 0.1) * torch.randn(parameter.shape, generator=draw)
            predicted, shown = both(model, terms, to_profile(model, terms, display, "lab", tmp_path), smooth())
            apart, error = (predicted - whole).norm(), (shown - predicted).norm()
            assert error < 0.3 * apart, name
            with torch.no_grad():
                parameter.copy_(kept)


def test_a_display_made_of_an_untrained_model_has_its_panel_and_no_effect_of_the_bench_besides(tmp_path: Path) -> None:
    display = base(0.8, (0.0, 0.0))
    profile = load_profile(
        str(to_profile(DisplayModel(display.spec()), Haze(display.spec()), display, "lab", tmp_path))
    )
    assert replace(profile.spec(), name="ideal") == display.spec()
    assert {"sub_pixel_field", "sensor_area", "pose"}.isdisjoint(effect.name for effect in profile.effects())


def test_a_model_of_another_panel_is_refused(tmp_path: Path) -> None:
    spec = base(0.8, (0.0, 0.0)).spec()
    with pytest.raises(UserError, match=r"^'lab': the model is not of the panel of 'ideal'"):
        to_profile(DisplayModel(spec), Haze(spec), base(0.7, (0.0, 0.0)), "lab", tmp_path)
