"""Sweeps of a display, draws of it and quality against cost: their numbers, and that they are drawn and filtered."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.report import Description, write_report
from holobench_eval.report.data.layout import Swept
from tests.support import synthetic_study as synthetic

from .conftest import Written
from .reading import Reader

TARGETS = synthetic.TARGETS[:4]
METHODS = {"Wirtinger": 19.0, "HIL": 21.0, "Double phase": 15.0}
DAYS = {30.0: "leto-aged, drift 30", 90.0: "leto-aged, drift 90"}
DRAWS = {str(index): f"leto-aged, draw {index}" for index in range(1, 5)}


def quality(label: str, target: str, condition: str) -> float:
    """HIL loses 0.1 dB a day, on one target 1 dB more, and half of the draws turn it from first to last."""
    drift = float(condition.rpartition(" ")[2]) if "drift" in condition else 0.0
    turned = condition in (DRAWS["1"], DRAWS["3"])
    lost = 0.1 * drift + (target == TARGETS[0]) * (drift > 0) + 10.0 * turned if label == "HIL" else 0.0
    return METHODS[label] + TARGETS.index(target) - lost


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Written:
    folder = tmp_path_factory.mktemp("charts")
    conditions = ["leto-aged", *DAYS.values(), *DRAWS.values()]
    layout = synthetic.layout(
        pairs=tuple((label, condition) for label in METHODS for condition in conditions),
        targets=TARGETS,
        privileged=frozenset(),
        reported={},
        sweeps=(
            Swept("drift", "leto-aged", tuple(DAYS.items())),
            Swept("draw", "leto-aged", tuple(DRAWS.items()), ({},) * len(DRAWS)),
        ),
    )
    records = [
        synthetic.record(
            label,
            synthetic.cell(synthetic.NAMES[label], target, condition, profile="leto-aged"),
            {"psnr_linear": quality(label, target, condition)},
        )
        for label, condition in layout.pairs
        for target in TARGETS
    ]
    write_report(layout, records, folder, {}, Description())
    return Written(folder, layout, (folder / "report.html").read_text())


def test_a_sweep_has_the_unchanged_display_at_its_place_and_paired_intervals(changed: Written) -> None:
    (sweep,) = changed.data["sweeps"]
    assert [point["value"] for point in sweep["points"]] == [0.0, *DAYS]
    mean = sum(quality("HIL", target, DAYS[90.0]) for target in TARGETS) / len(TARGETS)
    low, high = sweep["ends"][DAYS[90.0]]["HIL"]
    assert low < mean < high
    assert (low + high) / 2 == pytest.approx(mean, abs=1e-3)
    assert sweep["ends"][DAYS[90.0]]["Wirtinger"] == [20.5, 20.5]  # it loses nothing on any target


def test_shares_of_places_are_those_of_the_draws(changed: Written) -> None:
    (found,) = changed.data["ranks"]
    assert found["draws"] == len(DRAWS)
    assert found["methods"] == ["HIL", "Wirtinger", "Double phase"]
    assert found["shares"] == [[0.5, 0.0, 0.5], [0.5, 0.5, 0.0], [0.0, 0.5, 0.5]]


@pytest.fixture
def reader(browser: Any, changed: Written) -> Iterator[Reader]:
    found = Reader(browser.new_page(viewport={"width": 1000, "height": 800}), changed.folder / "report.html")
    found.page.goto(Path(found.file).as_uri())
    yield found
    assert not found.wrong
    found.page.close()


@pytest.mark.parametrize(("mark", "count"), [("row", 6), ("point", 9), ("share", 9)])
def test_every_chart_is_drawn_and_filtered_with_the_table(reader: Reader, mark: str, count: int) -> None:
    marks = reader.page.locator(f"#chart-list .{mark} > *")
    assert marks.count() == count
    reader.page.fill("#filter", "i")  # of the three, Double phase lacks the letter
    assert marks.count() == count - count // 3


def test_a_mark_is_read_out_when_it_is_reached_by_keys(reader: Reader) -> None:
    reader.page.locator("#chart-list .share > *").first.focus()
    texts = reader.page.locator("#chart-list .readout").all_inner_texts()
    assert texts[-1] == "HIL, place 1: 50 % of draws"


def test_a_study_without_pictures_says_so_and_hides_the_viewer(reader: Reader) -> None:
    assert not reader.page.is_visible("#canvas")
    assert "no pictures" in reader.page.inner_text("#picture-note")


def test_a_changed_display_has_a_table_of_its_own(reader: Reader) -> None:
    reader.page.select_option("#display", DAYS[90.0])
    assert "13.25" in reader.page.inner_text("#rows > tbody > tr:has-text('HIL')")
