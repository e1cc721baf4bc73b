from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.core.errors import StorageError, UserError
from holobench_eval.core.hashing import digest
from holobench_eval.core.io import file_name, write_atomically
from holobench_eval.study import store as store_module
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import Plan, plan
from holobench_eval.study.store import Record, Store, appears
from tests.support.fake_study import write_config


@pytest.fixture
def grid(tmp_path: Path) -> Plan:
    return plan(load_study(write_config(tmp_path, count=1)))


def record_of(grid: Plan, **values: Any) -> Record:
    return Record(grid.cells[-1].description(), "done", "Toy", **values)


def test_a_record_is_read_as_it_was_written(tmp_path: Path, grid: Plan) -> None:
    store = Store(tmp_path / "out")
    record = record_of(grid, scores={"psnr_linear": 20.123456789012345}, captures=3, seconds=0.1, saturated=1e-9)
    store.write(record)
    assert store.read(record.id) == record
    assert record.id == grid.cells[-1].id


def test_a_record_that_is_absent_is_none(tmp_path: Path) -> None:
    assert Store(tmp_path).read("0" * 64) is None


def corrupt(text: str) -> dict[str, str]:
    """Damaged files; those of edited entries have a digest that fits, or are of the schema that had none."""
    content = json.loads(text)

    def edited(**entries: Any) -> str:
        changed = {key: value for key, value in (content | entries).items() if key != "sha256"}
        return json.dumps({**changed, "sha256": digest(changed)})

    earlier = {key: value for key, value in content.items() if key not in ("schema", "sha256")}
    return {
        "truncated": text[: len(text) // 2],
        "empty": "",
        "list": "[]",
        "foreign": '{"a": 1}',
        "nested": "[" * 200_000,
        "long": json.dumps({**earlier, "reason": "x" * 2_000_000}),
        "edited": json.dumps({**content, "scores": {"psnr_linear": 99.0}}),
        "without a digest": json.dumps({key: value for key, value in content.items() if key != "sha256"}),
        "later": edited(schema=3),
        "schema": edited(schema="2"),
        "schema of another kind": edited(schema=True),
        "moved": edited(cell={**content["cell"], "repeat": 9}),
        "state": edited(state="fine"),
        "huge": json.dumps({**earlier, "captures": 10**400}),
        "negative": edited(captures=-5),
        "part of a capture": edited(captures=1.5),
        "back in time": edited(seconds=-1.0),
        "more than all": edited(saturated=1.5),
        "infinite": json.dumps(earlier).replace('"seconds": null', '"seconds": 1e999'),
        "score": edited(scores={"<script>": 1.0}),
        "truth": edited(saturated=True),
        "label": edited(label=None),
        "learned": edited(learned=[1]),
        "alone": edited(alone=1),
    }


FAULTS = [
    *("truncated", "empty", "list", "foreign", "nested", "long", "edited", "without a digest", "later", "schema"),
    "schema of another kind",
    *("moved", "state", "huge", "negative", "part of a capture", "back in time", "more than all", "infinite", "score"),
    *("truth", "label", "learned", "alone"),
]


def test_every_fault_is_tried(tmp_path: Path, grid: Plan) -> None:
    store, record = Store(tmp_path / "out"), record_of(grid)
    store.write(record)
    assert [*corrupt(store.path(record.id).read_text())] == FAULTS


@pytest.mark.parametrize("fault", FAULTS)
def test_a_damaged_record_is_named(tmp_path: Path, grid: Plan, fault: str) -> None:
    store, record = Store(tmp_path / "out"), record_of(grid)
    store.write(record)
    path = store.path(record.id)
    path.write_text(corrupt(path.read_text())[fault])
    with pytest.raises(UserError, match=rf"^{re.escape(str(path))}: .*delete the file") as error:
        store.read(record.id)
    assert len(str(error.value)) < 400


def test_a_record_of_an_earlier_version_says_not_what_was_at_work_beside_it(tmp_path: Path, grid: Plan) -> None:
    store, record = Store(tmp_path / "out"), record_of(grid, seconds=0.1, alone=True)
    store.write(record)
    content = json.loads(store.path(record.id).read_text())
    for added in ("alone", "schema", "sha256"):
        del content[added]
    store.path(record.id).write_text(json.dumps(content))
    read = store.read(record.id)
    assert read is not None
    assert (read.seconds, read.alone) == (0.1, None)
    assert [cell.id for cell in store.missing(grid.cells[-1:], timed=frozenset({record.id}))] == [record.id]


def test_a_planned_cell_without_a_record_is_shown_as_missing(tmp_path: Path, grid: Plan) -> None:
    store = Store(tmp_path / "out")
    store.write(record_of(grid))
    states = [record["state"] for record in store.load(grid)]
    assert states == ["missing"] * 5 + ["done"]


def test_records_of_other_studies_are_left_alone(tmp_path: Path, grid: Plan) -> None:
    store = Store(tmp_path / "out")
    store.folder.mkdir(parents=True)
    (store.folder / "foreign.json").write_text("nothing")
    assert len(store.missing(grid.cells)) == len(grid.cells)


def test_a_score_that_json_cannot_hold_is_not_written(tmp_path: Path, grid: Plan) -> None:
    with pytest.raises(UserError, match="finite numbers"):
        Store(tmp_path).write(record_of(grid, scores={"psnr_linear": float("inf")}))
    assert not list(Store(tmp_path).folder.glob("*.json"))


@pytest.mark.parametrize("wrong", [{"captures": 3.0}, {"memory_mib": -1.0}, {"reason": "x" * 2_000_000}])
def test_what_could_not_be_read_again_is_not_written(tmp_path: Path, grid: Plan, wrong: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="delete the file"):
        Store(tmp_path).write(record_of(grid, **wrong))
    assert not list(Store(tmp_path).folder.glob("*.json"))


def test_a_file_that_cannot_be_replaced_leaves_no_rest(tmp_path: Path) -> None:
    (tmp_path / "taken").mkdir()
    with pytest.raises(StorageError, match=r"taken cannot be written: .*directory; mend that"):
        write_atomically(tmp_path / "taken", b"x")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_rests_of_a_killed_run_are_removed(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.folder.mkdir()
    (store.folder / ".writing-abc").write_text("half")
    with store.locked():
        assert [path.name for path in store.folder.iterdir()] == [".lock"]


def test_the_lock_is_free_again_after_its_run(tmp_path: Path) -> None:
    store = Store(tmp_path)
    with pytest.raises(RuntimeError), store.locked():
        raise RuntimeError
    with store.locked(), pytest.raises(UserError, match="another run"), Store(tmp_path).locked():
        pass


def test_names_of_files_stay_in_their_folder() -> None:
    assert file_name("astronaut-2.png") == "astronaut-2.png"
    for text in ("../../etc/passwd", "..", ".", "", "/", "a" * 300, "GS (100 steps)"):
        assert re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]{1,120}", file_name(text))


@given(st.text(max_size=12), st.text(max_size=12))
def test_different_names_get_different_files(one: str, other: str) -> None:
    assert (file_name(one) == file_name(other)) == (one == other)


def test_a_failure_never_replaces_a_score(tmp_path: Path, grid: Plan) -> None:
    store = Store(tmp_path / "out")
    done = record_of(grid, scores={"psnr_linear": 20.0})
    failed = Record(done.cell, "failed", "Toy", "ZeroDivisionError")
    store.write(failed)
    store.write(done)
    store.write(failed)
    assert store.read(done.id) == done


def test_a_record_goes_under_the_name_that_its_plan_gives_to_the_method(tmp_path: Path, grid: Plan) -> None:
    store = Store(tmp_path / "out")
    store.write(Record(grid.cells[-1].description(), "done", "a name of an earlier config"))
    assert [record["label"] for record in store.load(grid)] == [label for label, _ in grid.labelled()]


def test_failed_cells_are_computed_again_where_that_is_asked_and_others_are_not(tmp_path: Path, grid: Plan) -> None:
    store, (first, second, third, *rest) = Store(tmp_path / "out"), grid.cells
    store.write(Record(first.description(), "failed", "Toy", "ZeroDivisionError"))
    store.write(Record(second.description(), "done", "Toy", alone=False))
    store.write(Record(third.description(), "skipped", "Toy", "no camera"))
    assert store.missing(grid.cells) == rest
    assert store.missing(grid.cells, retry_failed=True) == [first, *rest]
    assert store.missing(grid.cells, timed=frozenset({second.id, third.id})) == [second, *rest]
    store.write(Record(second.description(), "done", "Toy", alone=True))
    assert store.missing(grid.cells, timed=frozenset({second.id, third.id})) == rest


def test_only_named_records_are_removed(tmp_path: Path, grid: Plan) -> None:
    store = Store(tmp_path / "out")
    for cell in grid.cells:
        store.write(Record(cell.description(), "done", "Toy"))
    store.remove([grid.cells[0].id, "0" * 64])
    assert store.missing(grid.cells) == [grid.cells[0]]


def test_the_largest_record_that_is_written_can_be_read_and_a_larger_is_refused(tmp_path: Path, grid: Plan) -> None:
    store = Store(tmp_path / "out")
    store.write(record_of(grid, reason=""))
    room = 1_000_000 - store.path(grid.cells[-1].id).stat().st_size
    largest = record_of(grid, reason="x" * room)
    store.write(largest)
    assert store.path(largest.id).stat().st_size == 1_000_000
    assert store.read(largest.id) == largest
    with pytest.raises(UserError, match="not a record"):
        store.write(record_of(grid, reason="x" * (room + 1)))


def test_a_run_makes_its_folder_and_those_above_it(tmp_path: Path) -> None:
    store = Store(tmp_path / "a" / "b")
    for _ in range(2):
        with store.locked():
            assert store.folder.is_dir()


def test_what_belongs_to_a_cell_lies_beside_its_record_in_files_of_their_own(tmp_path: Path) -> None:
    store = Store(tmp_path)
    files = [store.path("ab"), store.log("ab"), store.thumbnail("ab"), store.target_thumbnail("ab")]
    assert [file.name for file in files] == ["ab.json", "ab.log", "ab.png", "target-ab.png"]
    assert {file.parent for file in files} == {store.folder}


def test_a_file_is_waited_for_until_it_is_late(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock, file = iter(range(100)), tmp_path / "file"
    monkeypatch.setattr(store_module.time, "monotonic", lambda: float(next(clock)))
    monkeypatch.setattr(store_module.time, "sleep", lambda seconds: None)
    assert store_module.late() == store_module.LATE
    assert not appears(file, until=3.0)
    assert next(clock) == 5  # asked at 1, 2 and 3, and for the last time at 4
    file.touch()
    assert appears(file, until=0.0)
