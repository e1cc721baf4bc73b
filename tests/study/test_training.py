import json
import shutil
import threading
import time
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import torch

from holobench_eval.core.io import TEMPORARY
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.ground_truth import truth
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.study import training
from holobench_eval.study.artifacts import PROVENANCE, STATE, Artifacts, FolderMemory, progress, read_log
from holobench_eval.study.executors import Serial
from holobench_eval.study.phases import phases_of
from holobench_eval.study.running.progress import Follower
from holobench_eval.study.store import Store
from holobench_eval.study.training import TrainingJob
from tests.study import studies
from tests.support import plugins
from tests.support.patience import killed_at, wait_until
from tests.support.studies import fake_study, trained_study
from tests.support.studies.fake_study import write_config
from tests.support.studies.trained_study import artifact_of, assert_refused, compute, holoeval, needs, rounds
from tests.support.studies.trained_study import write_inside as write

pytestmark = pytest.mark.usefixtures("no_physics")

BESIDE = ("methods: [", 'methods: ["trained.py:Even", ')
"""A method beside that needs no training."""


def states(records: list[dict[str, Any]]) -> list[tuple[str, str]]:
    return [(record["label"], record["state"]) for record in records if record["cell"]["condition"] != "reference"]


def gain(**params: object) -> tuple[str, str]:
    return '"trained.py:Gain"', json.dumps({"name": "trained.py:Gain", "params": params})


def test_a_spent_budget_fails_its_cells_alone(tmp_path, monkeypatch, capsys):
    config = write(tmp_path, BESIDE, gain(rounds=4), ("held_out: 1", "held_out: 1, captures: 3"))
    assert holoeval(monkeypatch, config) == 1
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "1 cell failed" in printed.out
    assert "failed: training Gain-ideal-128x128-" in printed.out
    assert rounds(tmp_path) == [0, 1, 2, 3]
    outcome = compute(config)
    assert states(outcome.records) == [("Even", "done"), ("Gain", "failed")]
    assert outcome.records[-1]["reason"] == "not trained: trained.py:Gain has used its 3 captures for training"
    table = pd.read_csv(tmp_path / "out" / "table.csv").query("category != 'floor'")
    assert table[["label", "n", "failed"]].values.tolist() == [["Even", 1, 0], ["Gain", 0, 1]]


def test_a_method_that_says_it_trains_without_captures_gets_none(tmp_path):
    config = write(tmp_path, gain())
    file = tmp_path / "trained.py"
    blind = "    def blind(self):\n        return True\n\n    def prepare(self"
    file.write_text(file.read_text().replace("    def prepare(self", blind))
    reason = compute(config).records[-1]["reason"]
    assert reason.endswith("has used its 0 captures for training")


def test_a_budget_that_is_enough_changes_nothing_but_the_name(tmp_path):
    free = write(tmp_path)
    compute(free)
    before = artifact_of(free)
    assert {"estimates", "missing"}.isdisjoint(json.loads((before / PROVENANCE).read_text()))  # a method tells none
    metered = write(tmp_path, ("held_out: 1", "held_out: 1, captures: 2"))
    assert compute(metered, "metered").failed == 0
    assert artifact_of(metered) != before
    assert same_state(artifact_of(metered), before)


def same_state(one: Path, other: Path) -> bool:
    """Whether two artifacts hold the same tensors, bit for bit."""
    first, second = (torch.load(place / STATE, weights_only=True)["state"] for place in (one, other))
    return first.keys() == second.keys() and all(torch.equal(first[name], second[name]) for name in first)


def test_a_training_that_fails_is_told_with_its_reason_and_tried_again_when_asked(tmp_path):
    lines: list[str] = []
    config = trained_study.write(tmp_path, BESIDE, gain(fail="no\n light"))
    outcome = compute(config, write=lines.append)
    assert states(outcome.records) == [("Even", "done"), ("Gain", "failed")]
    assert outcome.records[-1]["reason"].startswith("not trained: ValueError: no light (trained.py, line ")
    assert any(line.startswith("failed: training") and "ValueError: no light (trained.py, " in line for line in lines)
    assert "Traceback" in (artifact_of(config) / "failure.log").read_text()
    assert compute(config).computed == 0
    assert compute(config, retry_failed=True).computed == 1
    assert rounds(tmp_path) == [0, 1]  # what was kept before the failure is not done again


def test_a_reason_goes_when_the_training_succeeds(tmp_path):
    config = write(tmp_path)
    plugins = tmp_path / "trained.py"
    good = plugins.read_text()
    plugins.write_text(good.replace('return {"gain"', 'return None and {"gain"'))
    reason = compute(config).records[-1]["reason"]
    assert reason.endswith("prepare returned NoneType, not a mapping of tensors")
    plugins.write_text(good)
    assert compute(config, retry_failed=True).failed == 0
    assert not (artifact_of(config) / "failure.log").exists()


def test_a_target_among_the_training_images_is_refused(tmp_path, monkeypatch, capsys):
    config = write(tmp_path, ('"trained.py:Unseen"', '"trained.py:Pictures"'))
    assert_refused(holoeval(monkeypatch, config), capsys.readouterr(), "training image 'picture 0' is the scored")
    assert rounds(tmp_path) == []


def test_a_lost_worker_is_the_reason_of_a_training_that_fails(tmp_path):
    class Losing(Serial):
        def map(self, function: Any, jobs: Any) -> Any:
            for job in jobs:
                yield job, ConnectionError("the worker\n is gone") if isinstance(job, TrainingJob) else function(job)

    outcome = compute(write(tmp_path), executor=Losing())
    assert outcome.records[-1]["reason"] == "not trained: ConnectionError: the worker is gone"


def test_held_out_images_are_the_last_ones(tmp_path):
    config = write(tmp_path, ('"trained.py:Gain"', '"trained.py:Blind"'), ("held_out: 1", "held_out: 2"))
    compute(config)
    state = torch.load(artifact_of(config) / STATE, weights_only=True)["state"]
    assert state == {"held out": 2}


@pytest.mark.slow
def test_a_training_that_was_killed_ends_with_the_bits_and_the_captures_of_one_that_was_not(tmp_path):
    config = trained_study.write(tmp_path, gain(rounds=5, pause=0.15))
    place = artifact_of(config)
    killed_at(lambda: progress(place)[0] == 3, studies.compute_faked, config, tmp_path / "out")
    assert not (place / STATE).exists()
    (place / "unfinished" / f"{TEMPORARY}left").write_bytes(b"half")
    (place / f"{TEMPORARY}left").write_bytes(b"half")

    assert compute(config).failed == 0
    assert set(rounds(tmp_path)) == set(range(5))
    assert len(rounds(tmp_path)) <= 5 + 1  # the kill costs the round it cut short
    whole = tmp_path / "whole"
    whole.mkdir()
    again = trained_study.write(whole, gain(rounds=5, pause=0.15))
    compute(again)
    assert same_state(place, artifact_of(again))
    known = [json.loads((one / PROVENANCE).read_text()) for one in (place, artifact_of(again))]
    begun = len(rounds(tmp_path))
    assert known[0]["captures"] in (begun, begun - 1)  # the kill may come before the capture of the round it cuts short
    assert known[1]["captures"] == 5
    assert known[0]["description"] == known[1]["description"]
    assert known[0]["seconds"] >= 5 * 0.15 - 0.05  # the rounds before the kill count too
    logs = [read_log(one) for one in (place, artifact_of(again))]
    assert [[row["round"] for row in log] for log in logs] == [list("01234")] * 2
    assert [row["gain"] for row in logs[0]] == [row["gain"] for row in logs[1]]
    assert list(place.rglob(f"{TEMPORARY}*")) == []


def test_artifacts_that_several_runs_need_at_once_are_made_by_one_of_them(tmp_path):
    (needed,) = needs(write(tmp_path))
    artifacts, entered = Artifacts(tmp_path / "artifacts"), threading.Event()

    def wait() -> None:
        with artifacts.locked(needed):
            entered.set()

    with artifacts.locked(needed):
        other = threading.Thread(target=wait, daemon=True)
        other.start()
        assert not entered.wait(0.1)
    assert entered.wait(5)


def test_a_follower_tells_the_newest_line_of_every_training_and_none_twice(tmp_path):
    told: list[str] = []
    follower = Follower(0.01)
    logs = {name: FolderMemory(tmp_path / name) for name in ("one", "two")}
    follower.start([(name, log.folder) for name, log in logs.items()], told.append)

    for name, row, line in (
        ("one", {"round": 0, "step": 5, "l1": 0.25}, "round 0, step 5, l1 0.25"),
        ("two", {"round": 3}, "round 3"),
        ("one", {"round": 0, "step": 10, "fidelity": 20.5}, "round 0, step 10, fidelity 20.5"),
        ("two", {"round": 3, "step": 0, "share": 0.0, "seconds": 40.0}, "0% of the steps; round 3, step 0, seconds 40"),
        (
            "two",
            {"round": 3, "step": 9, "share": 0.25, "seconds": 60.0},
            "25% of the steps, at least 60 s left; round 3, step 9, seconds 60",
        ),
    ):
        logs[name].log(row)
        wait_until(lambda: f"{name}: {line}" in told)  # noqa: B023
    time.sleep(0.05)
    assert len(told) == 5
    for name, is_last in (("one", False), ("two", True)):
        follower.ended(name)
        assert follower.done.is_set() == is_last


TELLING = """

@dataclass(frozen=True)
class Telling(Gain):
    form: ClassVar[frozenset[str]] = FORM

    def estimates(self, learned, spec):
        return [estimate("phase_gain", colour, float(learned["gain"][colour])) for colour in range(3)]
"""


@pytest.fixture
def known(monkeypatch):
    """The fake display has a truth: that of the ideal one."""
    profile = load_profile("ideal").scaled((64, 64))
    monkeypatch.setattr(fake_study.FakeBench, "profile", profile, raising=False)
    monkeypatch.setattr(training, "truth", lambda _: truth(SimulatedBench(profile)))


def provenance(folder: Path, form: str) -> dict[str, Any]:
    """Of the training of a method that tells something."""
    config = write(folder, ("trained.py:Gain", "trained.py:Telling"))
    plugins = folder / "trained.py"
    imports = f"from holobench_eval.display.estimates import estimate\n\nFORM = frozenset({form})\n"
    plugins.write_text(plugins.read_text().replace("LOG = ", f"{imports}LOG = ", 1) + TELLING)
    assert compute(config).failed == 0
    return dict(json.loads((artifact_of(config) / PROVENANCE).read_text()))


@pytest.mark.usefixtures("known")
@pytest.mark.parametrize(("form", "missing"), [("[]", ["phase in steps of 2 pi / 256"]), ("['quantisation']", [])])
def test_estimates_are_kept_beside_the_truth_and_what_is_missing(tmp_path, form, missing):
    kept = provenance(tmp_path, form)
    rows = kept["estimates"]
    assert [(row["name"], row["colour"]) for row in rows] == [("phase_gain", colour) for colour in range(3)]
    assert [row["truth"] for row in rows] == pytest.approx([1, 1, 1], abs=1e-5)
    assert all(isinstance(row["value"], float) and row["value"] != row["truth"] for row in rows)
    assert kept["missing"] == missing


PHOTOGRAPHING = plugins.text("photographing")


def test_a_retry_has_the_captures_of_both_and_a_new_solution_after_a_score_its_own(tmp_path):
    (tmp_path / "mine.py").write_text(PHOTOGRAPHING)
    config = write_config(tmp_path, ('"mine.py:mine"',), count=1)
    config.write_text(f"{config.read_text()}isolation: none\n")
    fault, store, found = tmp_path / "fail", Store(tmp_path / "out"), list[tuple[str, int]]()

    def retry() -> None:
        record = studies.compute(config, store.output, retry_failed=True).records[-1]
        found.append((record["state"], record["captures"]))

    fault.touch()
    retry()
    retry()
    fault.unlink()
    retry()
    assert list(store.output.rglob("*.captures")) == []
    for folder in (store.folder, phases_of(store.output).folder):
        shutil.rmtree(folder)
    retry()
    assert found == [("failed", 2), ("failed", 4), ("done", 6), ("done", 2)]


def test_a_training_that_is_tried_again_has_the_captures_of_both_and_one_made_anew_its_own(tmp_path):
    config = write(tmp_path)
    plugins = tmp_path / "trained.py"
    dark = 'if number == 1 and Path(__file__).with_name("dark").exists():\n                raise ValueError("dark")\n'
    text = plugins.read_text().replace('return {"capture"', f'{dark}            return {{"capture"')
    plugins.write_text(text)
    (tmp_path / "dark").touch()
    assert compute(config).failed == 1
    assert progress(artifact_of(config))[0] == 2
    (tmp_path / "dark").unlink()
    assert compute(config, retry_failed=True).failed == 0
    assert captures(config) == 3
    assert [row["captures"] for row in read_log(artifact_of(config))] == ["1", "3"]
    compute(config, retrain=True)
    assert captures(config) == 2


def captures(config: Path) -> int:
    """Of the one artifact of a study."""
    return int(json.loads((artifact_of(config) / PROVENANCE).read_text())["captures"])
