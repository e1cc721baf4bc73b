"""The page is one file that loads nothing; its numbers, texts and pictures are those of the report's other files."""

import base64
import csv
import hashlib
import json
import re
import shutil
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from holobench_eval.core.hashing import digest
from holobench_eval.report import Description, Results, records_frame
from holobench_eval.report import page as module
from holobench_eval.report.markdown import table
from holobench_eval.report.page import FIRST, MOST_BYTES, files_of, json_text, keep_copies, pictures, sections
from holobench_eval.report.story import Report
from holobench_eval.study.store import Store
from tests.report.elements import Elements
from tests.support import synthetic_study as synthetic

from .conftest import HOSTILE, TARGETS, TITLE, Written


@pytest.fixture(scope="module")
def elements(written: Written) -> Elements:
    return Elements(written.text)


def test_names_from_files_open_no_element(written: Written, elements: Elements) -> None:
    assert elements.titles == [TITLE]
    assert elements.opens_nothing()
    assert "alert(" in written.text
    running = [text for attributes, text in elements.scripts if "type" not in attributes]
    assert len(running) == len(module.SCRIPTS)
    assert not [text for text in running if "alert(" in text]
    assert HOSTILE in written.data["methods"]  # in the data, a name is the same text


def test_json_holds_no_character_that_ends_a_script_and_reads_back() -> None:
    names = ["</script>", "<!--", "a & b", "\u2028\u2029", "]]>"]
    assert not re.search("[<>&\u2028\u2029]", json_text(names))
    assert json.loads(json_text(names)) == names


def test_every_element_that_loads_something_has_it_within_and_the_page_is_small(written, elements) -> None:
    assert all(value.startswith("data:") for value in elements.values("src", "srcset", "data", "action", "poster"))
    assert all(value.startswith(("#", "data:")) for value in elements.values("href"))
    assert not {"iframe", "object", "embed", "base", "form action"} & {tag for tag, _ in elements.found}
    assert re.search(
        r'aria-label="Answer">\s*<ul>\s*<li>No difference can be shown: .*</li>\s*<li>leto-aged: ', written.text
    )
    assert "<summary>Holes</summary>" in written.text  # of details.md
    assert (written.folder / "report.html").stat().st_size < MOST_BYTES


def test_the_policy_names_the_hash_of_every_script_and_of_the_style(written: Written, elements: Elements) -> None:
    style = re.search(r"<style>(.*?)</style>", written.text, re.DOTALL)
    assert style
    assert elements.policy.startswith("default-src 'none';")
    assert "unsafe" not in elements.policy
    for text in [style[1], *(text for attributes, text in elements.scripts if "type" not in attributes)]:
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in elements.policy


def test_tables_have_no_style_of_their_own_and_links_are_texts() -> None:
    shown = table(["method", "dB"], [["<b>|", "1.0"]])
    figure = "![Figure 1](figures/x.png)\n\n**Figure 1.** X."
    ((heading, text),) = sections(f"## Answer\n\n{shown}\n\n[5 more](details.md#limits)\n\n{figure}", "h2")
    assert heading == "Answer"
    assert '<td class="number">1.0</td>' in text
    assert "&lt;b&gt;|" in text
    assert "<p>5 more (details.md)</p>" in text
    assert "style" not in text
    assert "Figure" not in text


def number(text: str) -> float | None:
    return float(text) if text else None


def rows_of(written: Written, name: str) -> list[dict[str, str]]:
    with (written.folder / name).open(newline="") as file:
        # an apostrophe keeps a spreadsheet from running a name
        return [{key: text.removeprefix("'") for key, text in row.items()} for row in csv.DictReader(file)]


def test_numbers_are_those_of_table_records_and_board(written: Written) -> None:
    data, compared = written.data, 0
    rows = {(name, row["method"]): row for name, found in data["rows"].items() for row in found}
    for row in rows_of(written, "table.csv"):
        if row["condition"] in data["rows"]:
            cells = rows[row["condition"], row["label"]]["cells"]
            shared = [column[key] for column in data["columns"] for key in ("key", "low", "high") if key in column]
            for key in row.keys() & shared:
                assert cells[key] == number(row[key])
                compared += 1
    for row in rows_of(written, "records.csv"):
        if row["condition"] in data["rows"]:
            values = rows[row["condition"], row["label"]]["values"]
            assert values[data["targets"].index(row["target"])] == number(row["psnr_linear_db"])
    assert compared > 60
    for display in json.loads((written.folder / "board.json").read_text())["displays"]:
        for own in (row for group in display["groups"] for row in group["rows"]):
            cells = rows[display["name"], own["method"]]["cells"]
            assert cells["psnr_linear_db"] == own["score"]["mean"]
            assert cells.get("difference") == (own["difference"] and own["difference"]["mean"])


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    folder, facts = tmp_path_factory.mktemp("study"), synthetic.facts()
    records = synthetic.study(folder, size=32)
    return Report(Results(records_frame(records, facts), facts), records, folder, {}, Description())


def held(report: Report, room: int) -> dict[str, set[tuple[str, str]]]:
    """By target, the (method, condition) whose captures a page with so much room has; of the target ("", REFERENCE)."""
    found = pictures(report, files_of(report), room)
    return {
        target: {(label, condition) for label, condition, name in found if name == target}
        for target in report.results.targets
    }


def size(contents: Iterable[bytes]) -> int:
    return sum(len(base64.b64encode(content)) for content in contents)


@pytest.fixture(scope="module")
def whole(report: Report) -> int:
    """The room that all pictures take."""
    return size(pictures(report, files_of(report), 10**9).values())


def test_the_page_holds_the_bytes_of_the_records_and_a_cell_without_a_score_has_none(written: Written) -> None:
    store, shown, index = Store(written.folder), written.data["pictures"], TARGETS.index("chelsea")
    capture = store.thumbnail(digest(synthetic.cell("hil", "chelsea", "ideal")))
    for label, path in (("", store.target_thumbnail("chelsea")), ("HIL", capture)):
        text = re.search(rf'id="picture-{shown["ideal"][label][index]}">(.*?)</script>', written.text)
        assert text
        assert base64.b64decode(text[1]) == path.read_bytes()
    lacking = [index for found in shown["leto-aged"].values() for index, value in enumerate(found) if value is None]
    assert lacking == [TARGETS.index("coffee")]


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.8, 0.99, 1.0])
def test_no_page_takes_more_room_than_it_has_and_those_of_a_target_come_all_or_not(report, whole, share) -> None:
    room = int(share * whole)
    assert size(pictures(report, files_of(report), room).values()) <= room
    everything = held(report, whole)
    assert all(cells in (set(), everything[target]) for target, cells in held(report, room).items())
    assert (held(report, room) == everything) == (share == 1)


def test_targets_nearest_to_the_mean_differences_come_first(report: Report, whole: int) -> None:
    results = report.results
    gains = [results.values(m, d) - results.values("Wirtinger", d) for d in results.conditions for m in ("HIL", "SGD")]
    away = np.abs(gains - np.mean(gains, axis=1, keepdims=True)).mean(axis=0)
    found = held(report, int(whole * (FIRST + 0.5) / len(results.targets)))
    first = [target for target, cells in found.items() if cells]
    assert len(first) == FIRST
    assert np.mean([away[results.targets.index(name)] for name in first]) < away.mean()


@pytest.fixture
def copied(report: Report, tmp_path: Path) -> Report:
    shutil.copytree(report.output, tmp_path / "report")
    return Report(report.results, report.records, tmp_path / "report", {}, report.description)


def again(copied: Report) -> Report:
    """The report from the same folder, whose records are gone."""
    shutil.rmtree(copied.thumbnails.store.folder)
    return Report(copied.results, copied.records, copied.output, {}, copied.description)


def copies(copied: Report) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in copied.thumbnails.copies.glob("*.webp")}


def test_a_clone_shows_the_pictures_of_the_run_and_keeps_them(copied: Report) -> None:
    shown = pictures(copied, files_of(copied), 10**9)
    tile = copied.thumbnails.tile("HIL", "ideal", "chelsea")
    keep_copies(copied)
    clone = again(copied)
    assert pictures(clone, files_of(clone), 10**9).keys() == shown.keys()
    lossy = clone.thumbnails.tile("HIL", "ideal", "chelsea")
    assert lossy.note == tile.note
    assert np.abs(np.subtract(lossy.picture, tile.picture)).mean() < 0.03
    kept = copies(clone)
    keep_copies(clone)  # without records
    assert copies(clone) == kept


def test_without_room_whole_targets_are_kept_and_nothing_of_an_earlier_run(copied: Report, monkeypatch) -> None:
    keep_copies(copied)
    everything = copies(copied)
    room = sum(map(len, everything.values())) // 2
    (copied.thumbnails.copies / "of-another-run.webp").write_bytes(b"x")
    monkeypatch.setattr(module, "COPIED_BYTES", room)
    keep_copies(copied)
    kept = copies(copied)
    assert sum(map(len, kept.values())) <= room
    assert kept.items() < everything.items()
    clone = again(copied)
    assert {target for *_, target in files_of(clone)} <= set(clone.thumbnails.targets("ideal"))


def test_a_folder_of_somebody_else_stays_as_it_is(copied: Report) -> None:
    copied.thumbnails.copies.mkdir()
    (copied.thumbnails.copies / "mine.webp").write_bytes(b"x")
    keep_copies(copied)
    assert copies(copied) == {"mine.webp": b"x"}


def test_copies_whose_thumbnails_are_gone_stay_and_damaged_thumbnails_have_none(copied: Report) -> None:
    keep_copies(copied)
    kept = copies(copied)
    first, second, *_ = sorted(copied.thumbnails.store.folder.glob("*.png"))
    first.unlink()
    second.write_bytes(b"no picture")
    keep_copies(Report(copied.results, copied.records, copied.output, {}, copied.description))
    assert copies(copied) == {name: content for name, content in kept.items() if name != f"{second.stem}.webp"}
