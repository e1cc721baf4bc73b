from dataclasses import replace
from pathlib import Path

import pytest
import torch

from holobench_eval.core.errors import CellError, UserError
from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.profile import PROFILES
from holobench_eval.display.simulated.stages.lut import Flicker
from holobench_eval.methods.descent import adam
from holobench_eval.methods.losses import intensity_l2
from holobench_eval.methods.simulated import descent
from holobench_eval.methods.simulated.descent import expected_error, squared_error
from holobench_eval.methods.simulated.oracle import Oracle
from holobench_eval.methods.simulated.through import Through
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics import match
from holobench_eval.study.config import load_study
from holobench_eval.study.opening import open_bench
from holobench_eval.study.plan import plan


def bench_loss(phase, target, bench):
    return intensity_l2(bench.simulation.expected(phase, target)[0], target)


def test_the_oracle_corrects_what_the_nominal_model_does_not_know(bench, scene):
    target = scene(channels=3)
    blind, knowing = Wirtinger().solve(target, bench)[0], Oracle().solve(target, bench)[0]
    assert (bench_loss(knowing, target[0], bench) < 0.2 * bench_loss(blind, target[0], bench)).all()


def test_the_oracle_never_falls_behind_its_start(bench, scene):
    target = scene()
    start = bench_loss(Wirtinger(iterations=9).solve(target, bench)[0], target[0], bench)
    # a step that can only make it worse
    phase = Oracle(iterations=3, step=10.0, start_iterations=9).solve(target, bench)[0]
    assert bench_loss(phase, target[0], bench) <= start * (1 + 1e-5)


def test_a_better_phase_of_another_method_is_picked_up_in_the_colour_where_it_is_better(bench, scene):
    target = scene(channels=3)
    short = Oracle(iterations=1, step=1e-6, rounds=1)  # a descent that finds nothing
    good = Oracle(rounds=2).solve(target, bench)[0]
    own = short.solve(target, bench)[0]
    planted = torch.stack([torch.zeros_like(good[0]), good[1], torch.zeros_like(good[2])])
    phase = short.solve(target, replace(bench, starts=(torch.zeros_like(good), planted)))[0]
    assert torch.allclose(phase[1], good[1], atol=1e-4)
    assert torch.allclose(phase[[0, 2]], own[[0, 2]], atol=1e-4)


def test_rounds_go_on_until_they_bring_less_than_the_tolerance(bench, scene, monkeypatch):
    calls = []
    monkeypatch.setattr(descent, "adam", lambda *args, **kwargs: calls.append(1) or adam(*args, **kwargs))
    Oracle(iterations=4, tolerance=10.0).solve(scene(), bench)
    assert len(calls) == 1
    Oracle(iterations=4, tolerance=0.01, rounds=6).solve(scene(), bench)
    assert len(calls) == 1 + 6


@pytest.fixture(scope="module")
def shown():
    """A target on `leto-aged`, and a phase that the noise of the camera matters for."""
    display = open_bench(load_profile("leto-aged"), (128, 128), 1)
    target = torch.rand(1, 3, 6, 6, generator=torch.Generator().manual_seed(2))
    target = torch.nn.functional.interpolate(target, display.spec.region.shape, mode="bilinear")
    handle = display.for_method(Oracle(), "oracle", target[0], "t", 0)
    return target[0], Oracle(iterations=60, start_iterations=60, rounds=1).solve(target, handle)[0]


@pytest.mark.parametrize("name", ["ideal", "leto-aged"])
def test_the_expected_error_is_the_mean_over_captures(name, shown):
    target, phase = shown
    display = open_bench(replace(load_profile(name), flicker=Flicker()), (128, 128), 1)
    captures = [display.photograph(phase, target, "t", repeat).image for repeat in range(4)]
    errors = torch.stack([(match(one, target)[0] - target).square().mean() for one in captures])
    expected = expected_error(phase, display.simulation, target).mean()
    assert abs(float(10 * (expected / errors.mean()).log10())) < (1e-3 if name == "ideal" else 0.02)


def test_two_gains_stand_for_all_of_flicker(shown):
    target, phase = shown
    profile = load_profile("leto-aged")
    bench = open_bench(profile, (128, 128), 1).simulation
    draws = torch.randn(50, generator=torch.Generator().manual_seed(4)).tolist()
    with torch.no_grad():
        errors = [
            squared_error(phase, bench, target, 1 + sign * profile.flicker.rms * draw)
            for draw in draws
            for sign in (1, -1)
        ]
    scale = torch.tensor(draws).square().mean()  # of the drawn numbers, whose variance is not 1
    at_rest = squared_error(phase, bench, target).mean()
    excess = (torch.stack(errors).mean() - at_rest) / scale
    assert abs(float(10 * ((at_rest + excess) / expected_error(phase, bench, target).mean()).log10())) < 0.05


CONFIG = """\
title: Through a model
display: {profiles: [ideal], panel: [128, 128]}
targets: {dataset: charts, params: {names: [gray_ramp]}}
methods: [{name: through, params: {profile: lab/mine.yaml}}]
"""


@pytest.fixture(scope="module")
def profiles(tmp_path_factory):
    """A folder with two profiles of the shipped names, in green alone."""
    folder = tmp_path_factory.mktemp("profiles")
    for name in ("leto-aged", "ideal"):
        (folder / f"{name}.yaml").write_text(f"like: {name}\npanel: {{wavelengths: [5.17e-7]}}\n")
    return folder


@pytest.fixture(scope="module")
def aged(profiles):
    return open_bench(load_profile("leto-aged.yaml", profiles), (128, 128), 1)


def test_through_its_profile_it_goes_the_way_of_the_oracle_and_through_none_that_of_wirtinger(aged, profiles):
    through = [Through(profile=f"{name}.yaml", rounds=1).in_folder(profiles) for name in ("leto-aged", "ideal")]
    methods = [Wirtinger(), Oracle(rounds=1), *through]
    target = Photographs().load("astronaut", aged.spec.region.shape, 1).float()
    handle = aged.for_method(Oracle(), "oracle", target, "astronaut", 0)
    phases = [method.solve(target[None], handle)[0] for method in methods]
    errors = torch.stack([expected_error(phase, aged.simulation, target).mean() for phase in phases])
    blind, best, model, nominal = (-10 * errors.log10()).tolist()
    assert blind + 0.8 * (best - blind) < model < best + 0.1
    assert abs(nominal - blind) < 0.5


def test_on_the_model_it_is_never_worse_than_wirtinger(profiles):
    model = open_bench(load_profile("ideal.yaml", profiles), (128, 128), 0)
    target = torch.zeros(1, *model.spec.region.shape)
    target[:, 20:80, 30:60] = 0.8
    handle = model.for_method(Through(), "through", target, "t", 0)
    idle = Through(profile="ideal.yaml", iterations=1, rounds=1, step=1e-6)  # a descent that finds nothing
    phases = [method.solve(target[None], handle)[0] for method in (idle.in_folder(profiles), Wirtinger())]
    through, converged = (expected_error(phase, model.simulation, target) for phase in phases)
    assert (through <= converged * 1.001).all()


def test_it_sees_no_capture_and_no_bench_and_a_profile_of_another_panel_is_refused(aged):
    target = torch.full((1, *aged.spec.region.shape), 0.5)
    handle = aged.for_method(Through(), "through", target, "t", 0)
    with pytest.raises(CellError, match="privileged = True"):
        _ = handle.simulation
    with pytest.raises(CellError, match="declares no camera"):
        handle.capture(torch.zeros(1, 128, 128))
    faults = {
        "pluto-offaxis": r"its pitch \[m\] is 8e-06, not 6\.4e-06; .*; its blaze \[cycles/px\] is 0, 0\.25,",
        "flc-1bit": "its number of bits is 1, not 8",
        "pluto-fourier": r"its list of wavelengths \[m\] is 5\.32e-07, not 5\.17e-07",
    }
    for profile, fault in faults.items():
        with pytest.raises(CellError, match=f"^profile '{profile}' is no model of 'leto-aged': .*{fault}"):
            Through(profile=profile).solve(target[None], handle)


def test_a_config_names_the_profile_from_its_folder_and_is_refused_where_the_profile_does_not_fit(tmp_path):
    config, mine = tmp_path / "study.yaml", tmp_path / "lab" / "mine.yaml"
    config.write_text(CONFIG)
    with pytest.raises(UserError, match=r"study.yaml:4:.*no such file: .*lab/mine.yaml"):
        load_study(config)
    mine.parent.mkdir()
    mine.write_text("like: pluto-offaxis\nname: mine\n")
    with pytest.raises(UserError, match=r"study.yaml:4:\d+: profile 'lab/mine.yaml' is no model of 'ideal': its pitch"):
        load_study(config)
    mine.write_text("like: ideal\nname: mine\n")
    assert load_study(config).methods[0].params["profile"] == "lab/mine.yaml"


def test_another_version_of_the_profile_or_of_one_it_is_like_is_another_phase(tmp_path):
    config, folder = tmp_path / "study.yaml", tmp_path / "lab"
    config.write_text(CONFIG)
    folder.mkdir()
    (folder / "base.yaml").write_text((Path(PROFILES) / "ideal.yaml").read_text())
    (folder / "mine.yaml").write_text("like: base.yaml\nname: mine\n")

    def phase():
        (cell,) = [cell for label, cell in plan(load_study(config)).labelled() if label == "through"]
        return cell.phase_id

    first = phase()
    assert phase() == first
    (folder / "mine.yaml").write_text("like: base.yaml\nname: mine\nseed: 7\n")
    second = phase()
    with (folder / "base.yaml").open("a") as base:
        base.write("sampling: 3\n")
    assert len({first, second, phase()}) == 3


def test_another_simulated_bench_is_another_phase_of_it_alone(tmp_path, monkeypatch):
    config = tmp_path / "study.yaml"
    config.write_text(CONFIG.replace("{profile: lab/mine.yaml}}", "{profile: leto-aged}}, wirtinger"))

    def phases():
        return {label: cell.phase_id for label, cell in plan(load_study(config)).labelled()}

    before = phases()
    monkeypatch.setattr("holobench_eval.study.plan.HARNESS", "another")
    after = phases()
    assert after["through"] != before["through"]
    assert after["wirtinger"] == before["wirtinger"]
