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
from holobench_eval.report import Description, Results, read_records, records_frame
from holobench_eval.report.markdown import Markdown, table
from holobench_eval.report.page import html
from holobench_eval.report.page import pictures as module
from holobench_eval.report.page.html import MOST_BYTES, json_text
from holobench_eval.report.page.pictures import TARGETS_IN_FULL, keep_copies, pictures
from holobench_eval.report.scores import parse
from holobench_eval.report.story import Part, Report
from holobench_eval.study.plan import REFERENCE
from holobench_eval.study.store import Store
from tests.report.elements import Elements
from tests.support import synthetic_study as synthetic

from .conftest import HOSTILE, TARGETS, TITLE, Written

MORE = Markdown("[5 more](details.md#limits)")


@pytest.fixture(scope="module")
def elements(written: Written) -> Elements:
    return Elements(written.text)


def test_names_from_files_open_no_element(written: Written, elements: Elements) -> None:
    assert elements.titles == [TITLE]
    assert elements.opens_nothing()
    assert "alert(" in written.text
    running = [text for attributes, text in elements.scripts if "type" not in attributes]
    assert len(running) == len(html.SCRIPTS)
    assert not [text for text in running if "alert(" in text]
    assert HOSTILE in written.data["methods"]  # in the data, a name is the same text


@pytest.mark.parametrize("text", ["</script>", "<!--", "a & b", "\u2028\u2029", "]]>"])
def test_json_holds_no_character_that_ends_a_script_and_reads_back(text: str) -> None:
    written = json_text({"name": text})
    assert not re.search("[<>&\u2028\u2029]", written)
    assert json.loads(written) == {"name": text}


def test_every_element_that_loads_something_has_it_within_and_the_page_is_small(written, elements) -> None:
    assert all(value.startswith("data:") for value in elements.values("src", "srcset", "data", "action", "poster"))
    assert all(value.startswith(("#", "data:")) for value in elements.values("href"))
    assert not {"iframe", "object", "embed", "base", "form action"} & {tag for tag, _ in elements.found}
    assert "<h2>Answer</h2>" in written.text
    assert (written.folder / "report.html").stat().st_size < MOST_BYTES


def test_the_policy_names_the_hash_of_every_script_and_of_the_style(written: Written, elements: Elements) -> None:
    style = re.search(r"<style>(.*?)</style>", written.text, re.DOTALL)
    assert style
    assert elements.policy.startswith("default-src 'none';")
    assert "unsafe" not in elements.policy
    for text in [style[1], *(text for attributes, text in elements.scripts if "type" not in attributes)]:
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in elements.policy


def test_tables_at_the_top_have_no_style_of_their_own_and_links_are_texts(written: Written) -> None:
    results = Results(read_records((written.folder / "records.csv").read_text()), written.layout)
    report = Report(results, [], written.folder, {}, Description())
    text = html.part_html(report, Part(1, lambda report, figures: [table(["method", "dB"], [["<b>|", "1.0"]]), MORE]))
    assert '<td class="number">1.0</td>' in text
    assert "&lt;b&gt;|" in text
    assert "<p>5 more (details.md)</p>" in text
    assert "style" not in text


def number(text: str) -> float | None:
    return float(text) if text else None


def rows_of(written: Written, name: str) -> list[dict[str, str]]:
    with (written.folder / name).open(newline="") as file:
        # an apostrophe keeps a spreadsheet from running a name
        return [{key: text.removeprefix("'") for key, text in row.items()} for row in csv.DictReader(file)]


def test_every_number_of_the_table_is_that_of_table_csv(written: Written) -> None:
    rows = {(row["label"], row["condition"]): row for row in rows_of(written, "table.csv")}
    compared = 0
    for condition, found in written.data["rows"].items():
        for row in found:
            expected = rows.pop((row["method"], condition))
            for key, cell in row["cells"].items():
                score = parse(key)
                if score.column in expected:
                    assert cell["value"] == number(expected[score.column])
                    assert cell.get("low") == number(expected.get(score.statistic("_lo"), ""))
                    assert cell.get("high") == number(expected.get(score.statistic("_hi"), ""))
                    compared += cell["value"] is not None
    assert compared > 60
    assert {condition for _, condition in rows} == {"reference"}  # the floor is beside the table


def test_the_value_of_every_target_is_that_of_records_csv(written: Written) -> None:
    names = written.data["targets"]
    compared = 0
    for row in rows_of(written, "records.csv"):
        if row["condition"] in written.data["values"]:
            values = written.data["values"][row["condition"]][row["label"]]
            for key, found in values.items():
                assert found[names.index(row["target"])] == number(row[parse(key).column])
                compared += 1
    assert compared > 100


def test_means_and_differences_are_those_of_the_board(written: Written) -> None:
    (lacking,) = (row for row in written.data["rows"]["leto-aged"] if "3 of 4 targets" in row["marked"])
    assert "gain" not in lacking["cells"]
    drawn = json.loads((written.folder / "board.json").read_text())
    for display in drawn["displays"]:
        own = {row["method"]: row for group in display["groups"] for row in group["rows"]}
        for row in written.data["rows"][display["name"]]:
            assert row["cells"]["psnr_linear"]["value"] == own[row["method"]]["score"]["mean"]
            if own[row["method"]]["difference"]:
                assert row["cells"]["gain"]["value"] == own[row["method"]]["difference"]["mean"]


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


def test_with_less_room_some_targets_are_full_and_others_have_best_baseline_and_oracle(report, whole) -> None:
    found = held(report, int(0.85 * whole))
    roles = {(name, condition) for name in ("HIL", "Wirtinger", "Oracle") for condition in synthetic.SEVERITY}
    full = [target for target, cells in found.items() if len(cells) >= 12]
    assert len(full) == TARGETS_IN_FULL
    first = pictures(report, int(0.85 * whole))[1]["first"]
    assert len(found[first]) == max(map(len, found.values()))  # the page begins with a target that has most
    for target in set(found) - set(full):
        assert found[target] == {("", REFERENCE), *roles}


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.8, 0.99, 1.0])
def test_no_page_takes_more_room_than_it_has_or_lacks_a_target_and_the_note_counts(report, whole, share) -> None:
    room, count = int(share * whole), 6 + 6 * 12 - 1
    found, shown = pictures(report, room)
    assert size(found.values()) <= room
    assert (len(found) == count) == (share == 1)
    assert f"holds {'all' if share == 1 else f'{len(found)} of'} {count} pictures" in shown["note"]
    for cells in held(report, room).values():
        assert not cells or ("", REFERENCE) in cells


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[synthetic.Record]]:
    folder = tmp_path_factory.mktemp("study")
    return folder, synthetic.study(folder, size=32, targets=TARGETS)


@pytest.fixture
def copied(study: tuple[Path, list[synthetic.Record]], tmp_path: Path) -> Report:
    folder, records = study
    layout, output = synthetic.layout(targets=TARGETS), tmp_path / "report"
    shutil.copytree(folder, output)
    return Report(Results(records_frame(records, layout), layout), records, output, {}, Description())


def again(copied: Report) -> Report:
    """The report from the same folder, whose records are gone."""
    shutil.rmtree(copied.thumbnails.store.folder)
    return Report(copied.results, copied.records, copied.output, {}, copied.description)


def copies(copied: Report) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in copied.thumbnails.copies.glob("*.webp")}


def test_a_clone_shows_the_pictures_of_the_run_and_keeps_them(copied: Report) -> None:
    shown = pictures(copied, 10**9)[0]
    tile = copied.thumbnails.tile("HIL", "ideal", "chelsea")
    keep_copies(copied)
    clone = again(copied)
    assert pictures(clone, 10**9)[0].keys() == shown.keys()
    copied = clone.thumbnails.tile("HIL", "ideal", "chelsea")
    assert copied.note == tile.note
    assert tile.picture is not None
    assert copied.picture is not None
    assert np.abs(copied.picture - tile.picture).mean() < 0.03
    kept = copies(clone)
    keep_copies(clone)  # without records
    assert copies(clone) == kept


def test_without_room_whole_targets_are_kept_and_nothing_of_an_earlier_run(copied: Report, monkeypatch) -> None:
    keep_copies(copied)
    everything = copies(copied)
    room = sum(map(len, everything.values())) // 2
    (copied.thumbnails.copies / "of-another-run.webp").write_bytes(b"x")
    monkeypatch.setattr(module, "MOST_BYTES", room)
    keep_copies(copied)
    kept = copies(copied)
    assert sum(map(len, kept.values())) <= room
    assert kept.items() < everything.items()
    clone = again(copied)
    assert {target for *_, target in pictures(clone, 10**9)[0]} <= set(clone.thumbnails.targets("ideal"))


def test_a_folder_of_somebody_else_stays_as_it_is_and_a_study_without_thumbnails_says_so(copied, tmp_path) -> None:
    found, shown = pictures(Report(copied.results, copied.records, tmp_path, {}, Description()), 10**6)
    assert not found
    assert "no pictures" in shown["note"]
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
