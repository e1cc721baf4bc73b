"""A report keeps small copies of its pictures, and is whole again without the records."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from holobench_eval.report import Description, Results, records_frame
from holobench_eval.report.page import pictures as module
from holobench_eval.report.page.pictures import keep_copies, pictures
from holobench_eval.report.section import Report
from tests.support import synthetic_study as synthetic

TARGETS = synthetic.TARGETS[:4]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[synthetic.Record]]:
    folder = tmp_path_factory.mktemp("study")
    return folder, synthetic.study(folder, size=32, targets=TARGETS)


@pytest.fixture
def report(study: tuple[Path, list[synthetic.Record]], tmp_path: Path) -> Report:
    folder, records = study
    layout, output = synthetic.layout(targets=TARGETS), tmp_path / "report"
    shutil.copytree(folder, output)
    return Report(Results(records_frame(records, layout), layout), records, output, {}, Description())


def again(report: Report) -> Report:
    """The report from the same folder, whose records are gone."""
    shutil.rmtree(report.thumbnails.store.folder)
    return Report(report.results, report.records, report.output, {}, report.description)


def copies(report: Report) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in report.thumbnails.copies.glob("*.webp")}


def test_a_clone_shows_the_pictures_of_the_run_and_keeps_them(report: Report) -> None:
    shown = pictures(report, 10**9)[0]
    tile = report.thumbnails.tile("HIL", "ideal", "chelsea")
    keep_copies(report)
    clone = again(report)
    assert pictures(clone, 10**9)[0].keys() == shown.keys()
    copied = clone.thumbnails.tile("HIL", "ideal", "chelsea")
    assert copied.note == tile.note
    assert tile.picture is not None
    assert copied.picture is not None
    assert np.abs(copied.picture - tile.picture).mean() < 0.03
    kept = copies(clone)
    keep_copies(clone)  # without records
    assert copies(clone) == kept


def test_without_room_whole_targets_are_kept_and_nothing_of_an_earlier_run(
    report: Report, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_copies(report)
    everything = copies(report)
    room = sum(map(len, everything.values())) // 2
    (report.thumbnails.copies / "of-another-run.webp").write_bytes(b"x")
    monkeypatch.setattr(module, "MOST_BYTES", room)
    keep_copies(report)
    kept = copies(report)
    assert sum(map(len, kept.values())) <= room
    assert kept.items() < everything.items()
    clone = again(report)
    assert {target for *_, target in pictures(clone, 10**9)[0]} <= set(clone.thumbnails.targets("ideal"))


def test_a_folder_of_somebody_else_stays_as_it_is(report: Report) -> None:
    report.thumbnails.copies.mkdir()
    (report.thumbnails.copies / "mine.webp").write_bytes(b"x")
    keep_copies(report)
    assert copies(report) == {"mine.webp": b"x"}


def test_copies_whose_thumbnails_are_gone_stay_and_damaged_thumbnails_have_none(report: Report) -> None:
    keep_copies(report)
    kept = copies(report)
    first, second, *_ = sorted(report.thumbnails.store.folder.glob("*.png"))
    first.unlink()
    second.write_bytes(b"no picture")
    keep_copies(Report(report.results, report.records, report.output, {}, report.description))
    assert copies(report) == {name: content for name, content in kept.items() if name != f"{second.stem}.webp"}
