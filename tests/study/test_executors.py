from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.study import run as running
from holobench_eval.study.config import load_study
from holobench_eval.study.executors import Executor, Local, Serial, executor
from holobench_eval.study.plan import plan
from holobench_eval.study.progress import Lines
from tests.support.fake_study import lose_a_worker, noted_work, solves, write_config


def compute(config: Path, output: Path, chosen: Executor) -> list[dict[str, Any]]:
    study = load_study(config)
    watch, artifacts = Lines(lambda line: None), output.parent / "artifacts"
    return running.run(study, plan(study), output, chosen, watch, threads=1, artifacts=artifacts).records


def untimed(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{**record, "seconds": None, "memory_mib": None, "alone": None} for record in records]


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics")
def test_worker_processes_give_what_one_process_gives_but_for_the_cell_of_a_lost_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = write_config(tmp_path)
    serial = compute(config, tmp_path / "serial", Serial())
    monkeypatch.setattr(running, "step", lose_a_worker)
    local = compute(config, tmp_path / "local", Local(2))
    lost = [record["state"] == "failed" for record in local]
    assert [record["cell"]["target"] for record, gone in zip(local, lost, strict=True) if gone] == ["gray 1"]
    assert all(record["reason"].startswith("KilledWorker") for record in local if record["state"] != "done")
    kept = [record for record, gone in zip(serial, lost, strict=True) if not gone]
    assert untimed([record for record in local if record["state"] == "done"]) == untimed(kept)


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics")
def test_one_solution_of_every_row_is_timed_when_no_worker_does_anything_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    methods = tuple(f'{{name: "plugins.py:Toy", label: m{i}, params: {{value: {i}, pause: 0.2}}}}' for i in range(3))
    config = write_config(tmp_path, methods)
    config.write_text(f"{config.read_text()}timing: alone\n")
    monkeypatch.setattr(running, "step", noted_work)
    found = compute(config, tmp_path / "out", Local(2))
    solved = [record for record in found if record["seconds"] is not None]
    timed = [record for record in solved if record["alone"]]
    assert [(record["label"], record["cell"]["target"]) for record in timed] == [(f"m{i}", "gray 2") for i in range(3)]
    assert [record["alone"] for record in solved].count(False) == 6
    spans = [tuple(map(float, line.split()[1:])) for line in solves(tmp_path / "out")]
    overlapping = [any(a < end and start < b for a, b in spans if (a, b) != (start, end)) for start, end in spans]
    assert overlapping[-3:] == [False] * 3
    assert True in overlapping


def test_the_serial_executor_takes_a_job_when_it_starts_it() -> None:
    taken: list[int] = []

    def jobs() -> Any:
        for number in range(3):
            taken.append(number)
            yield number

    results = Serial().map(lambda number: number * 2, jobs())
    assert next(results) == (0, 0)
    assert taken == [0]


@pytest.mark.parametrize(
    ("name", "workers", "message"),
    [
        ("loca", None, "did you mean 'local'"),
        ("local", 0, "at least 1"),
        ("serial", 2, "--executor local"),
    ],
)
def test_an_executor_that_cannot_be_is_refused(name: str, workers: int | None, message: str) -> None:
    with pytest.raises(UserError, match=message):
        executor(name, workers)
