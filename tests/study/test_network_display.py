"""A trained network is a display like any other in a study, and what it cannot be is refused in one line."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml

from holobench_eval.commands.displays import lines
from holobench_eval.commands.run import run
from holobench_eval.core.errors import UserError
from holobench_eval.display import Profile, load_profile
from holobench_eval.display.learned import LearnedBench
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.methods.calibrated.parametric import ParametricModel
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study.config import load_study
from holobench_eval.study.displays import condition
from holobench_eval.study.network_display import write_network
from holobench_eval.study.opening import open_display
from tests.study.studies import one_line, write_study
from tests.support.small_training import QUICK
from tests.support.studies.trained_study import compute

PANEL = (128, 160)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the display ``net.yaml``: a model as it is before it has learned, but for its aberrations."""
    monkeypatch.chdir(tmp_path)
    base = Profile("net", 1, 0, "Nominal light.", panel=load_profile("ideal").scaled(PANEL).panel)
    write_network(state(base), "parametric_model", {}, base, tmp_path)
    return tmp_path


def state(base: Profile) -> dict[str, Any]:
    approximator = ParametricModel().approximator(base.spec())
    with torch.no_grad():
        approximator.model.aberration += 0.3
    return {**approximator.learned(), "fell_back": False, "left_out": []}


def rewrite(path: Path, **changes: Any) -> None:
    """Exchange entries of a profile; those of its network by ``network``."""
    held = yaml.safe_load(path.read_text())
    held["network"] |= changes.pop("network", {})
    path.write_text(yaml.safe_dump({**held, **changes}))


def test_its_capture_is_what_the_method_predicts(folder):
    bench = open_display(condition("net.yaml", None, folder), seed=0)
    assert isinstance(bench, LearnedBench)
    target = torch.rand(3, *bench.spec.region.shape)
    handle = bench.for_method(Wirtinger(iterations=2), "w", target, "picture", 0)
    phase = Wirtinger(iterations=2).solve(target[None], handle)[0]
    model = ParametricModel().approximator(bench.spec)
    model.load_learned(state(load_profile("net.yaml")))
    predicted = model.image(bench.for_method(Wirtinger(), "w", target, "picture", 0).light)(phase)
    assert torch.allclose(bench.photograph(phase, target, "picture", 0).image, predicted, atol=1e-6)


def test_all_kinds_of_methods_run_on_it(folder):
    names = "double_phase", "online_camera", "hil_plus"
    rows = (json.dumps({"name": name, "params": QUICK.get(name, {})}) for name in names)
    training = "{dataset: dead_leaves, params: {count: 4}, held_out: 1}"
    config = write_study(folder / "study.yaml", *rows, display="{profiles: [net.yaml]}", training=training)
    assert compute(config).failed == 0


CONFIGS = {
    "a sweep": ({"sweeps": "[{condition: laser_power, values: [0.5]}]"}, "is a network, which nothing changes"),
    "an oracle": ({"methods": "[oracle]"}, "'oracle' looks into a simulated bench, and 'net.yaml' is a network"),
    "planes": ({"measure": "focus", "targets": "{dataset: focal_stacks}"}, "moves planes"),
    "another panel": ({"display": "{profiles: [net.yaml], panel: [100, 100]}"}, "has a network of its panel"),
}


@pytest.mark.parametrize(("entries", "fault"), CONFIGS.values(), ids=CONFIGS)
def test_a_study_that_it_cannot_be_in_is_refused(folder, entries, fault):
    given = {"display": "{profiles: [net.yaml]}", "methods": "[double_phase]"} | entries
    config = write_study(folder / "study.yaml", **given)
    with one_line(fault, at=f"{config}:"):
        load_study(config)


def test_a_file_that_is_not_there_is_told_when_the_profile_is_read(folder):
    (folder / "net.pt").unlink()
    with pytest.raises(UserError, match=r"^net\.yaml:\d+:\d+: .*cannot be read: No such file or directory$"):
        load_profile("net.yaml")


def cut(folder: Path) -> None:
    (folder / "net.pt").write_bytes((folder / "net.pt").read_bytes()[:-1])


def linked(folder: Path) -> None:
    outside = folder.parent / "outside.pt"
    (folder / "net.pt").rename(outside)
    (folder / "net.pt").symlink_to(outside)


def save(folder: Path, held: Any) -> None:
    """The file of a hostile hand, whose size and digest are right."""
    torch.save({"state": held}, folder / "net.pt")
    content = (folder / "net.pt").read_bytes()
    rewrite(folder / "net.yaml", network={"size": len(content), "sha256": hashlib.sha256(content).hexdigest()})


def rewritten(folder: Path, change: Callable[[torch.Tensor], torch.Tensor]) -> None:
    held = state(load_profile("net.yaml"))
    save(folder, held | {"model": {key: change(values) for key, values in held["model"].items()}})


ENDLESS: list[Any] = []
ENDLESS.append(ENDLESS)
EMPTY = {"model": {"table": torch.empty(3, 17, device="meta")}}


FAULTS: dict[str, tuple[Callable[[Path], None], str]] = {
    "another byte": (cut, "another file, or damaged"),
    "no file": (lambda folder: (folder / "net.pt").unlink(), "cannot be read"),
    "a link": (linked, "is a link that leaves the profile's folder"),
    "a place outside": (lambda folder: rewrite(folder / "net.yaml", network={"file": "../net.pt"}), "is not a file in"),
    "no state": (lambda folder: save(folder, [1]), "holds nothing that a method has learned"),
    "a list in itself": (lambda folder: save(folder, {"model": ENDLESS}), "not what parametric_model has learned"),
    "tensors without values": (lambda folder: save(folder, EMPTY), "not what parametric_model has learned"),
    "code": (lambda folder: save(folder, Wirtinger()), "damaged, or not a file of tensors"),
    "other shapes": (lambda folder: rewritten(folder, lambda values: values[..., :1]), "not what parametric_model has"),
    "no numbers": (lambda folder: rewritten(folder, lambda values: values * float("nan")), "that are not finite"),
    "other code": (lambda folder: rewrite(folder / "net.yaml", network={"version": "X 1"}), "learn it again"),
    "a method of a file": (lambda folder: rewrite(folder / "net.yaml", network={"method": "m.py:M"}), "expected a me"),
    "no predictor": (lambda folder: rewrite(folder / "net.yaml", network={"method": "sgd"}), "expected a method of"),
    "stages": (lambda folder: rewrite(folder / "net.yaml", crosstalk={"width": 0.4}), "has no effect beside a network"),
    "a huge size": (lambda folder: rewrite(folder / "net.yaml", network={"size": 10**9}), "100000000"),
}


@pytest.mark.parametrize(("spoil", "fault"), FAULTS.values(), ids=FAULTS)
def test_a_file_that_is_not_as_it_should_be_is_refused_in_one_line(folder, spoil, fault):
    spoil(folder)
    config = write_study(folder / "study.yaml", "double_phase", display="{profiles: [net.yaml]}")
    with one_line(fault):
        run(config)


def test_a_profile_that_is_like_it_has_its_network_from_there(folder):
    (folder / "below").mkdir()
    (folder / "below" / "like.yaml").write_text("like: ../net.yaml\nname: like\nversion: 1\ndescription: Alike.\n")
    assert isinstance(open_display(condition("below/like.yaml", None, folder), seed=0), LearnedBench)


def test_no_method_descends_through_it_and_no_bench_is_built_of_it(folder):
    through = "{name: through, params: {profile: net.yaml}}"
    config = write_study(folder / "study.yaml", through, display="{profiles: [ideal], panel: [128, 160]}")
    with pytest.raises(UserError, match="is a network, which has no stages to descend through"):
        load_study(config)
    with pytest.raises(UserError, match="is a network: it has no stages"):
        SimulatedBench(load_profile("net.yaml"))


def test_the_shelf_says_what_it_is(folder):
    assert [row[2] for row in lines([("net.yaml", "a file")])] == ["parametric_model"]
