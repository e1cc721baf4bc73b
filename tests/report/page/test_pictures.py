"""The pictures of the page: the stored bytes, all where they fit, else by the stated rule."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable
from pathlib import Path

import pytest

from holobench_eval.core.hashing import digest
from holobench_eval.report import Description, Results, records_frame
from holobench_eval.report.page.pictures import TARGETS_IN_FULL, pictures
from holobench_eval.report.section import Report
from holobench_eval.study.plan import REFERENCE
from holobench_eval.study.store import Store
from tests.support import synthetic_study as synthetic

from .conftest import TARGETS, Written


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    folder = tmp_path_factory.mktemp("study")
    records = synthetic.study(folder, size=16)
    results = Results(records_frame(records, synthetic.layout()), synthetic.layout())
    return Report(results, records, folder, {}, Description())


def held(report: Report, room: int) -> dict[str, set[tuple[str, str]]]:
    """By target, the (method, condition) whose captures a page with so much room has; of the target ("", REFERENCE)."""
    found, _ = pictures(report, room)
    return {
        target: {(label, condition) for label, condition, name in found if name == target}
        for target in report.results.targets
    }


def size(contents: Iterable[bytes]) -> int:
    return sum(len(base64.b64encode(content)) for content in contents)


@pytest.fixture(scope="module")
def whole(report: Report) -> int:
    """The room that all pictures take."""
    return size(pictures(report, 10**9)[0].values())


def test_the_page_holds_the_bytes_of_the_records(written: Written) -> None:
    store, data = Store(written.folder), written.data
    index = TARGETS.index("chelsea")
    described = synthetic.cell("hil", "chelsea", "ideal")
    for number, path in (
        (data["pictures"]["targets"]["ideal"][index], store.target_thumbnail("chelsea")),
        (data["pictures"]["cells"]["ideal"]["HIL"][index], store.thumbnail(digest(described))),
    ):
        text = re.search(rf'id="picture-{number}">(.*?)</script>', written.text)
        assert text
        assert base64.b64decode(text[1]) == path.read_bytes()


def test_a_cell_without_a_score_has_no_picture(written: Written) -> None:
    cells = written.data["pictures"]["cells"]["leto-aged"]
    lacking = [(name, index) for name, found in cells.items() for index, value in enumerate(found) if value is None]
    assert [index for _, index in lacking] == [TARGETS.index("coffee")]


def test_with_less_room_some_targets_are_full_and_others_have_best_baseline_and_oracle(
    report: Report, whole: int
) -> None:
    found = held(report, int(0.85 * whole))
    roles = {(name, condition) for name in ("HIL", "Wirtinger", "Oracle") for condition in synthetic.SEVERITY}
    full = [target for target, cells in found.items() if len(cells) >= 12]
    assert len(full) == TARGETS_IN_FULL
    first = pictures(report, int(0.85 * whole))[1]["first"]
    assert len(found[first]) == max(map(len, found.values()))  # the page begins with a target that has most
    for target in set(found) - set(full):
        assert found[target] == {("", REFERENCE), *roles}


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.8, 0.99, 1.0])
def test_no_page_takes_more_room_than_it_has_or_lacks_a_target_and_the_note_counts(
    report: Report, whole: int, share: float
) -> None:
    room, count = int(share * whole), 6 + 6 * 12 - 1
    found, shown = pictures(report, room)
    assert size(found.values()) <= room
    assert (len(found) == count) == (share == 1)
    assert f"holds {'all' if share == 1 else f'{len(found)} of'} {count} pictures" in shown["note"]
    for cells in held(report, room).values():
        assert not cells or ("", REFERENCE) in cells


def test_a_study_without_thumbnails_says_so(report: Report, tmp_path: Path) -> None:
    found, shown = pictures(Report(report.results, report.records, tmp_path, {}, Description()), 10**6)
    assert not found
    assert "no pictures" in shown["note"]
