"""Captures of a solution and of a training over all attempts."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.study.artifacts import PROVENANCE, progress, read_log
from holobench_eval.study.phases import phases_of
from holobench_eval.study.store import Store
from tests.study.studies import compute
from tests.support.fake_study import write_config
from tests.support.trained_study import artifact_of, write
from tests.support.trained_study import compute as compute_trained

pytestmark = pytest.mark.usefixtures("no_physics")

METHOD = """
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import torch


@dataclass(frozen=True)
class Mine:
    camera: ClassVar[bool] = True

    def solve(self, target, bench):
        phase = torch.zeros(*target.shape[:2], *bench.spec.shape)
        for _ in range(2):
            bench.capture(phase[0])
        if Path(__file__).with_name("fail").exists():
            raise ValueError("no light")
        return phase
"""


@pytest.fixture
def records(tmp_path: Path) -> Callable[..., list[dict[str, Any]]]:
    """Runs a study of one target with a method that takes two captures; its record."""
    (tmp_path / "mine.py").write_text(METHOD)
    config = write_config(tmp_path, ('"mine.py:Mine"',), count=1)
    config.write_text(f"{config.read_text()}isolation: none\n")

    def run(**options: Any) -> list[dict[str, Any]]:
        found = compute(config, tmp_path / "out", **options).records
        return [record for record in found if record["label"] == "Mine"]

    return run


def test_a_failed_cell_has_its_captures_and_a_retry_those_of_both_and_a_new_solution_after_a_score_its_own(
    tmp_path: Path, records: Callable[..., list[dict[str, Any]]]
) -> None:
    fault, found = tmp_path / "fail", list[tuple[str, int]]()
    fault.touch()
    for number in range(3):
        if number == 2:
            fault.unlink()
        found += [(record["state"], record["captures"]) for record in records(retry_failed=True)]
    assert found == [("failed", 2), ("failed", 4), ("done", 6)]
    assert list((tmp_path / "out").rglob("*.captures")) == []
    for folder in (Store(tmp_path / "out").folder, phases_of(tmp_path / "out").folder):
        shutil.rmtree(folder)
    assert [record["captures"] for record in records()] == [2]


def test_a_training_that_is_tried_again_has_the_captures_of_both_and_one_that_is_made_anew_its_own(
    tmp_path: Path,
) -> None:
    config = write(tmp_path)
    plugins = tmp_path / "trained.py"
    dark = 'if number == 1 and Path(__file__).with_name("dark").exists():\n                raise ValueError("dark")\n'
    text = plugins.read_text().replace('return {"capture"', f'{dark}            return {{"capture"')
    future = "from __future__ import annotations\n"
    plugins.write_text(text.replace(future, f"{future}from pathlib import Path\n"))
    (tmp_path / "dark").touch()
    assert compute_trained(config).failed == 1
    assert progress(artifact_of(config))[0] == 2
    (tmp_path / "dark").unlink()
    assert compute_trained(config, retry_failed=True).failed == 0
    assert captures(config) == 3
    assert [row["captures"] for row in read_log(artifact_of(config))] == ["1", "3"]
    compute_trained(config, retrain=True)
    assert captures(config) == 2


def captures(config: Path) -> int:
    """Of the one artifact of a study."""
    return int(json.loads((artifact_of(config) / PROVENANCE).read_text())["captures"])
