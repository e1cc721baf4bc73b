"""The pictures of the page: the stored bytes, all where they fit, else by the stated rule."""

from __future__ import annotations

import base64
import re
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
    return Report(
        Results(records_frame(records, synthetic.layout()), synthetic.layout()), records, folder, {}, Description()
    )


def held(report: Report, room: int) -> dict[str, set[tuple[str, str]]]:
    """By target, the (method, condition) whose captures a page with so much room has; of the target ("", REFERENCE)."""
    found, _ = pictures(report, room)
    return {
        target: {(label, condition) for label, condition, name in found.numbers if name == target}
        for target in report.results.targets
    }


def base64_length(content: bytes) -> int:
    return len(base64.b64encode(content))


def size(report: Report) -> int:
    return sum(map(base64_length, pictures(report, 10**9)[0].contents))


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


def test_all_pictures_are_held_where_they_fit(report: Report) -> None:
    everything, note = pictures(report, size(report))
    assert len(everything.contents) == 6 + 6 * 12 - 1
    assert note["note"].startswith("This page holds all 77 pictures")


def test_with_less_room_some_targets_are_full_and_others_have_best_baseline_and_oracle(report: Report) -> None:
    found = held(report, int(0.85 * size(report)))
    roles = {(name, condition) for name in ("HIL", "Wirtinger", "Oracle") for condition in synthetic.SEVERITY}
    full = [target for target, cells in found.items() if len(cells) >= 12]
    assert len(full) == TARGETS_IN_FULL
    first = pictures(report, int(0.85 * size(report)))[1]["first"]
    assert len(found[first]) == max(map(len, found.values()))  # the page begins with a target that has most
    for target in set(found) - set(full):
        assert found[target] == {("", REFERENCE), *roles}


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.7, 0.99])
def test_no_page_takes_more_room_than_it_has_and_the_note_counts(report: Report, share: float) -> None:
    room = int(share * size(report))
    found, shown = pictures(report, room)
    assert sum(map(base64_length, found.contents)) <= room
    assert f"holds {len(found.contents)} of 77 pictures" in shown["note"]


def test_a_capture_is_never_held_without_its_target(report: Report) -> None:
    for share in (0.2, 0.5, 0.8):
        for cells in held(report, int(share * size(report))).values():
            assert not cells or ("", REFERENCE) in cells


def test_a_study_without_thumbnails_says_so(report: Report, tmp_path: Path) -> None:
    bare = Report(report.results, report.records, tmp_path, {}, Description())
    found, shown = pictures(bare, 10**6)
    assert not found.contents
    assert "no pictures" in shown["note"]
