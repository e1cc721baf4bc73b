from pathlib import Path

import pytest
import torch

from holobench_eval.core.errors import CellError, UserError
from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.profile import PROFILES
from holobench_eval.methods.simulated.descent import expected_error
from holobench_eval.methods.simulated.oracle import Oracle
from holobench_eval.methods.simulated.through import Through
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study.config import load_study
from holobench_eval.study.opening import open_bench
from holobench_eval.study.plan import plan

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


def test_through_the_profile_of_the_display_it_goes_the_way_of_the_oracle_and_through_none_that_of_wirtinger(
    aged, profiles
):
    through = [Through(profile=f"{name}.yaml", rounds=1).in_folder(profiles) for name in ("leto-aged", "ideal")]
    methods = [Wirtinger(), Oracle(rounds=1), *through]
    for item in ("astronaut", "coffee"):
        target = Photographs().load(item, aged.spec.region.shape, 1).float()
        handle = aged.for_method(Oracle(), "oracle", target, item, 0)
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


def test_it_sees_no_capture_and_no_bench(aged):
    handle = aged.for_method(Through(), "through", torch.full((1, *aged.spec.region.shape), 0.5), "t", 0)
    with pytest.raises(CellError, match="privileged = True"):
        _ = handle.simulation
    with pytest.raises(CellError, match="declares no camera"):
        handle.capture(torch.zeros(1, 128, 128))


@pytest.mark.parametrize(
    ("profile", "faults"),
    [
        (
            "pluto-offaxis",
            r"its pitch \[m\] is 8e-06, not 6\.4e-06; .*; its blaze \[cycles/px\] is 0, 0\.25,",
        ),
        ("flc-1bit", "its number of bits is 1, not 8"),
        ("pluto-fourier", r"its list of wavelengths \[m\] is 5\.32e-07, not 5\.17e-07"),
    ],
)
def test_a_profile_of_another_panel_is_refused_in_a_line(aged, profile, faults):
    target = torch.full((1, *aged.spec.region.shape), 0.5)
    handle = aged.for_method(Through(), "through", target, "t", 0)
    with pytest.raises(CellError, match=f"^profile '{profile}' is no model of 'leto-aged': .*{faults}"):
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
