"""Records of every schema that was ever written stay readable; the folder of a new one is added with it."""

from __future__ import annotations

from pathlib import Path

import pytest

from holobench_eval.study.store import SCHEMA, Store

RELEASED = Path(__file__).parent / "released"


def test_every_schema_has_records_here() -> None:
    assert sorted(folder.name for folder in RELEASED.iterdir()) == [f"schema-{n + 1}" for n in range(SCHEMA)]


@pytest.mark.parametrize("number", range(1, SCHEMA + 1))
def test_records_of_a_released_schema_are_read(number: int) -> None:
    folder = RELEASED / f"schema-{number}"
    (path,) = (folder / "records").glob("*.json")
    record = Store(folder).read(path.stem)
    assert record is not None
    assert record.state == "done"
    assert record.scores
    assert record.id == path.stem
