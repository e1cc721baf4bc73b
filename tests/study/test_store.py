import json
import re
from collections.abc import Callable, Mapping
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.core.errors import StorageError, UserError
from holobench_eval.core.hashing import digest
from holobench_eval.core.io import file_name, write_atomically
from holobench_eval.study import identity
from holobench_eval.study import store as store_module
from holobench_eval.study.plan import Cell, Plan
from holobench_eval.study.store import SCHEMA, Record, Store, appears
from tests.study.studies import planned
from tests.support.studies.fake_study import write_config


@pytest.fixture(scope="module")
def grid(tmp_path_factory):
    return planned(write_config(tmp_path_factory.mktemp("study"), count=1))


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "out")


def record_of(grid: Plan, **values: Any) -> Record:
    return Record(grid.cells[-1].description(), "done", "Toy", **values)


def psnr(value: float, version: str | None = None) -> dict[str, Any]:
    """The scores of a record by one metric, of today's version."""
    return {"psnr": {"version": version or identity.versions()["psnr"], "values": {"psnr_linear": value}}}


def test_a_record_is_read_as_it_was_written_and_an_absent_one_is_none(store, grid):
    record = record_of(grid, scores=psnr(20.123456789012345), captures=3, seconds=0.1, saturated=1e-9)
    assert store.read(record.id) is None
    store.write(record)
    assert (store.read(record.id), record.id) == (record, grid.cells[-1].id)


def edited(content: dict[str, Any], **entries: Any) -> str:
    """A record with other entries, and a digest that fits."""
    changed = {key: value for key, value in (content | entries).items() if key != "sha256"}
    return json.dumps({**changed, "sha256": digest(changed)})


ENTRIES: dict[str, dict[str, Any]] = {
    "long": {"reason": "x" * 2_000_000},
    "later": {"schema": SCHEMA + 1},
    "earlier": {"schema": SCHEMA - 1},
    "schema": {"schema": str(SCHEMA)},
    "schema of another kind": {"schema": True},
    "state": {"state": "fine"},
    "huge": {"captures": 10**400},
    "negative": {"captures": -5},
    "part of a capture": {"captures": 1.5},
    "back in time": {"seconds": -1.0},
    "more than all": {"saturated": 1.5},
    "score": {"scores": {"psnr": {"version": "v2, 1", "values": {"<script>": 1.0}}}},
    "figure": {"figures": {"<script>": 1.0}},
    "score without a version": {"scores": {"psnr": {"values": {"psnr_linear": 1.0}}}},
    "truth": {"saturated": True},
    "label": {"label": None},
    "learned": {"learned": [1]},
    "alone": {"alone": 1},
}
FAULTS: dict[str, Callable[[str, dict[str, Any]], str]] = {  # of the text and the content of a record
    "truncated": lambda text, _: text[: len(text) // 2],
    "empty": lambda *_: "",
    "list": lambda *_: "[]",
    "foreign": lambda *_: '{"a": 1}',
    "nested": lambda *_: "[" * 200_000,
    "edited": lambda _, content: json.dumps({**content, "scores": psnr(99.0)}),
    "without a digest": lambda _, content: json.dumps({k: v for k, v in content.items() if k != "sha256"}),
    "moved": lambda _, content: edited(content, capture={**content["capture"], "noise": [9]}),
    "infinite": lambda text, _: text.replace('"captures": 0', '"captures": 1').replace(
        '"seconds": null', '"seconds": 1e999'
    ),
    **{name: lambda _, content, entries=entries: edited(content, **entries) for name, entries in ENTRIES.items()},
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_damaged_record_is_named(store, grid, fault):
    record = record_of(grid)
    store.write(record)
    path = store.path(record.id)
    text = path.read_text()
    path.write_text(FAULTS[fault](text, json.loads(text)))
    assert path.read_text() != text
    with pytest.raises(UserError, match=rf"^{re.escape(str(path))}: .*delete the file") as error:
        store.read(record.id)
    assert len(str(error.value)) < 400


def test_cells_without_a_record_are_missing_records_have_the_name_of_their_plan_and_others_are_left_alone(store, grid):
    store.write(Record(grid.cells[-1].description(), "done", "a name of an earlier config"))
    (store.folder / "foreign.json").write_text("nothing")
    found = store.load(grid)
    assert [record["state"] for record in found] == ["missing"] * 5 + ["done"]
    assert [record["label"] for record in found] == [label for label, _ in grid.labelled()]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"captures": 3.0}, "delete the file"),
        ({"memory_mib": -1.0}, "delete the file"),
        ({"scores": psnr(float("inf"))}, "finite numbers"),  # which JSON cannot hold
    ],
)
def test_what_could_not_be_read_is_not_written(store, grid, wrong, message):
    with pytest.raises(UserError, match=message):
        store.write(record_of(grid, **wrong))
    assert not list(store.folder.glob("*.json"))


def test_a_file_that_cannot_be_replaced_leaves_no_rest(tmp_path):
    (tmp_path / "taken").mkdir()
    with pytest.raises(StorageError, match=r"taken cannot be written: .*directory; mend that"):
        write_atomically(tmp_path / "taken", b"x")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_a_run_makes_its_folder_locks_it_and_removes_the_rests_of_a_killed_run(tmp_path):
    store = Store(tmp_path / "a" / "b")
    with store.locked():
        (store.folder / ".writing-abc").write_text("half")
    with pytest.raises(RuntimeError), store.locked():
        raise RuntimeError
    with store.locked():  # free again after its run
        assert [path.name for path in store.folder.iterdir()] == [".lock"]
        with pytest.raises(UserError, match="another run"), Store(store.output).locked():
            pass


def test_names_of_files_stay_in_their_folder():
    assert file_name("astronaut-2.png") == "astronaut-2.png"
    for text in ("../../etc/passwd", "..", ".", "", "/", "a" * 300, "GS (100 steps)"):
        assert re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]{1,120}", file_name(text))


@given(st.text(max_size=12), st.text(max_size=12))
def test_different_names_get_different_files(one, other):
    assert (file_name(one) == file_name(other)) == (one == other)


def test_a_failure_never_replaces_a_score(store, grid):
    done = record_of(grid, scores=psnr(20.0))
    failed = Record(done.capture, "failed", "Toy", "ZeroDivisionError")
    for record in (failed, done, failed):
        store.write(record)
    assert store.read(done.id) == done


def test_the_state_of_a_cell_is_that_of_its_record_unless_it_is_to_be_timed_or_scored(store, grid):
    first, second, third, fourth, *rest = grid.cells
    store.write(Record(first.description(), "failed", "Toy", reason="ZeroDivisionError"))
    store.write(Record(second.description(), "done", "Toy", alone=False, scores=psnr(20.0)))
    store.write(Record(third.description(), "skipped", "Toy", reason="no camera"))
    store.write(Record(fourth.description(), "done", "Toy", alone=True, scores=psnr(20.0, "v2, 0")))

    def states(*timed: Cell, metrics: Mapping[str, str]) -> list[str]:
        return [*store.states(grid.cells, frozenset(cell.id for cell in timed), metrics).values()]

    missing = ["missing"] * len(rest)
    assert states(metrics={}) == ["failed", "done", "skipped", "done", *missing]
    assert states(second, third, fourth, metrics={}) == ["failed", "untimed", "skipped", "done", *missing]
    today = {"psnr": identity.versions()["psnr"]}
    assert states(metrics=today) == ["failed", "done", "skipped", "unscored", *missing]
    assert states(second, metrics=today | {"ssim": "v2, 1"}) == ["failed", "untimed", "skipped", "unscored", *missing]


def test_a_score_of_another_version_of_its_metric_is_a_hole(grid):
    old = psnr(20.0, "v2, 0") | {"ssim": {"version": identity.versions()["ssim"], "values": {"ssim_linear": 0.5}}}
    record = record_of(grid, scores=old, figures={"efficiency": 0.4})
    assert record.values() == {"ssim_linear": 0.5, "efficiency": 0.4}
    assert record.row(grid.cells[-1].facts())["scores"] == record.values()


def test_only_named_records_are_removed(store, grid):
    for cell in grid.cells:
        store.write(Record(cell.description(), "done", "Toy"))
    store.remove([grid.cells[0].id, "0" * 64])
    assert [name for name, state in store.states(grid.cells).items() if state == "missing"] == [grid.cells[0].id]


def test_the_largest_record_that_is_written_can_be_read_and_a_larger_is_refused(store, grid):
    store.write(record_of(grid, reason=""))
    room = 1_000_000 - store.path(grid.cells[-1].id).stat().st_size
    largest = record_of(grid, reason="x" * room)
    store.write(largest)
    assert store.path(largest.id).stat().st_size == 1_000_000
    assert store.read(largest.id) == largest
    with pytest.raises(UserError, match="not a record"):
        store.write(record_of(grid, reason="x" * (room + 1)))


def test_a_file_is_waited_for_until_it_is_late(tmp_path, monkeypatch):
    clock, file = iter(range(100)), tmp_path / "file"
    monkeypatch.setattr(store_module.time, "monotonic", lambda: float(next(clock)))
    monkeypatch.setattr(store_module.time, "sleep", lambda seconds: None)
    assert store_module.late() == store_module.LATE
    assert not appears(file, until=3.0)
    assert next(clock) == 5  # asked at 1, 2 and 3, and for the last time at 4
    file.touch()
    assert appears(file, until=0.0)
