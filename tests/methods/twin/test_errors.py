"""What a twin says of its display has an error, and what no capture shows has none."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import torch

from holobench_eval.display import Profile, load_profile
from holobench_eval.display.api import DisplaySpec
from holobench_eval.display.estimates import QUANTITIES, joined
from holobench_eval.display.simulated.ground_truth import truth
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.methods.calibrated.approximator import PredictedCapture
from holobench_eval.methods.calibrated.patterns import random_phase
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.methods.twin.errors import LEFT, MISFIT, NUDGES, QUANTILE, estimates, unseen
from holobench_eval.methods.twin.model import TwinCamera, TwinModel
from holobench_eval.methods.twin.to_profile import to_profile

LIGHT = torch.tensor([0.5, 0.7, 0.9])


def spec(name: str = "leto-aged") -> DisplaySpec:
    return load_profile(name).scaled((80, 96)).spec()


def learned(spec: DisplaySpec, apart: float = 0.0, hidden: tuple[str, ...] = ()) -> dict[str, Any]:
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
    found = {item.name: item.error for item in estimates(learned(spec(), apart), spec()) if item.colour == 1}
    usual = QUANTITIES["crosstalk"].error
    assert found["crosstalk"] == pytest.approx(max(QUANTILE * apart / 2, LEFT["crosstalk"] * usual), rel=1e-3)
    assert found["coma_x"] == pytest.approx(MISFIT * QUANTITIES["coma_x"].error)


def test_what_is_not_seen_is_told_without_an_error() -> None:
    rows = joined(estimates(learned(spec(), hidden=("coma_y",)), spec()), [])
    hidden = [row for row in rows if row.get("seen") is False]
    assert [row["name"] for row in hidden] == ["coma_y"] * 3
    assert all(row["error"] is None for row in hidden)


def test_light_is_what_the_camera_counts() -> None:
    state = learned(spec())
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
