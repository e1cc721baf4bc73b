from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.study import cost
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from tests.study.test_run import compute
from tests.support.fake_study import write_config

pytestmark = pytest.mark.usefixtures("no_physics")

METHODS = """
from dataclasses import dataclass
from typing import ClassVar

import torch


@dataclass(frozen=True)
class Greedy:
    \"\"\"Captures for ever; hands in a phase of ``good`` first and of 9 after every other capture.\"\"\"

    good: float = 2.0
    keeps: bool = True
    camera: ClassVar[bool] = True

    def solve(self, target, bench):
        phase = torch.full((target.shape[1], *bench.spec.shape), self.good)
        while True:
            if self.keeps:
                bench.keep(phase)
            bench.capture(phase)
            phase.fill_(9.0)  # what was handed in is a copy
            self = Greedy(self.good, keeps=False)


@dataclass(frozen=True)
class Modest:
    \"\"\"Takes as many captures as it may, and no more.\"\"\"

    value: float = 2.0
    camera: ClassVar[bool] = True

    def solve(self, target, bench):
        phase = torch.full((*target.shape[:2], *bench.spec.shape), self.value)
        for _ in range(bench.budget or 1):
            bench.capture(phase[0])
        return phase


@dataclass(frozen=True)
class Deaf:
    \"\"\"Goes on after the display has ended it; hands in a phase of 2 and returns one of 9.\"\"\"

    camera: ClassVar[bool] = True

    def solve(self, target, bench):
        phase = torch.full((*target.shape[:2], *bench.spec.shape), 2.0)
        bench.keep(phase)
        try:
            while True:
                bench.capture(phase[0])
        except Exception:
            return phase.fill_(9.0)


@dataclass(frozen=True)
class Lying:
    \"\"\"Says of itself that the display has ended it.\"\"\"

    camera: ClassVar[bool] = True

    def solve(self, target, bench):
        from holobench_eval.core.errors import BudgetError

        bench.keep(torch.zeros(target.shape[1], *bench.spec.shape))
        raise BudgetError("the best of all methods")
"""


def study_of(folder: Path, *methods: str) -> Path:
    (folder / "camera.py").write_text(METHODS)
    return write_config(folder, tuple(f"{{name: camera.py:{method}}}" for method in methods), count=1)


def records(config: Path, output: Path) -> list[dict[str, Any]]:
    return [record for record in compute(config, output).records if record["cell"]["condition"] != "reference"]


def test_a_method_over_its_budget_is_stopped_and_its_best_hologram_so_far_is_scored(tmp_path: Path) -> None:
    config = study_of(tmp_path, "Greedy, captures: 3", "Modest, captures: 3")
    greedy, modest = records(config, tmp_path / "out")
    assert (greedy["state"], greedy["captures"]) == ("done", 3)
    assert greedy["stopped"] == "Greedy has used its 3 captures"
    assert greedy["scores"] == modest["scores"]
    assert (modest["captures"], modest["stopped"]) == (3, "")


def test_a_method_that_does_not_heed_the_end_of_its_budget_is_stopped_all_the_same(tmp_path: Path) -> None:
    deaf, modest = records(study_of(tmp_path, "Deaf, captures: 3", "Modest, captures: 3"), tmp_path / "out")
    assert (deaf["stopped"], deaf["captures"]) == ("Deaf has used its 3 captures", 3)
    assert deaf["scores"] == modest["scores"]


def test_only_the_display_ends_a_budget(tmp_path: Path) -> None:
    (record,) = records(study_of(tmp_path, "Lying"), tmp_path / "out")
    assert (record["state"], record.get("stopped", "")) == ("failed", "")


def test_a_method_that_kept_nothing_fails_when_its_budget_ends(tmp_path: Path) -> None:
    config = study_of(tmp_path, "Greedy, captures: 2, params: {keeps: false}")
    (record,) = records(config, tmp_path / "out")
    assert record["state"] == "failed"
    assert record["reason"] == "Greedy has used its 2 captures"


def test_a_budget_makes_another_phase_and_no_budget_leaves_its_name_as_it_was(tmp_path: Path) -> None:
    free, tight = "Modest", "Modest, label: tight, captures: 2"
    cells = {task.label: task.cells[0] for task in plan(load_study(study_of(tmp_path, free, tight))).tasks}
    assert "captures" not in cells["Modest"].phase
    assert cells["tight"].phase == {**cells["Modest"].phase, "captures": 2}
    assert cells["tight"].id != cells["Modest"].id


def test_a_time_is_kept_for_each_budget(tmp_path: Path) -> None:
    many = ("Modest", "Modest, label: two, captures: 2", "Modest, label: three, captures: 3")
    tasks = [task for task in plan(load_study(study_of(tmp_path, *many))).tasks if not task.is_floor]
    assert len({cost.key(task, 1, 1) for task in tasks}) == 3


@pytest.mark.parametrize(
    ("method", "message"),
    [
        ('"plugins.py:Toy", captures: 3', r":6:\d+: .*plugins.py:Toy' takes no captures .*remove 'captures'"),
        ("camera.py:Modest, captures: 0", r":6:\d+: .*captures"),
        ("camera.py:Modest, captures: many", r":6:\d+: .*captures"),
    ],
)
def test_a_budget_that_means_nothing_is_refused_in_its_place(tmp_path: Path, method: str, message: str) -> None:
    (tmp_path / "camera.py").write_text(METHODS)
    with pytest.raises(UserError, match=message):
        load_study(write_config(tmp_path, (f"{{name: {method}}}",), count=1))
