"""A row says what its number hides: a fallback that was taken, a network that predicts worse than none."""

import math
from typing import Any

import pytest

from holobench_eval.report import Results, csv_text, read_records
from holobench_eval.report.board import board
from holobench_eval.report.phrases import marked, uncovered
from holobench_eval.study.plan import REFERENCE
from tests.support.synthetic_study import TARGETS, cell, record
from tests.support.synthetic_study import results as of_records

DISPLAY = "leto-aged"
LABELS = ("U-Net", "Identity", "Wirtinger")


def results(network: float, identity: float, constant: float, measure: str = "prediction", **learned: Any) -> Results:
    """A study in which every target of a row has the same PSNR [dB]."""
    rows = {"U-Net": (network, DISPLAY), "Identity": (identity, DISPLAY), "Wirtinger": (40.0, DISPLAY)}
    trained = {"learned": {"sha256": "2" * 64, "captures": 3, "seconds": 1.0, **learned}}
    records = [
        record(label, cell(label.lower(), target, on), {"psnr_linear": value}, **trained if label == "U-Net" else {})
        for label, (value, on) in (rows | {"floor_constant": (constant, REFERENCE)}).items()
        for target in TARGETS
    ]
    given = {"trained": frozenset({"U-Net", "Identity"}), "identities": frozenset({"Identity"})}
    return of_records(records, **given, measure=measure, holograms="wirtinger")


@pytest.mark.parametrize(
    ("network", "identity", "constant", "mark"),
    [
        (20.0, 19.0, 18.0, ""),
        (17.0, 16.0, 18.0, ", not trained to convergence: below the constant image"),
        (18.5, 19.0, 18.0, ", not trained to convergence: below the ideal image"),
        (17.0, 19.0, 18.0, ", not trained to convergence: below the constant image and the ideal image"),
    ],
)
def test_a_network_that_predicts_worse_than_no_training_is_marked(network, identity, constant, mark) -> None:
    found = results(network, identity, constant)
    assert marked(found, "U-Net", DISPLAY) == f"U-Net{mark}"
    assert marked(found, "Identity", DISPLAY) == "Identity"  # it has nothing to learn
    pictures = results(network, identity, constant, measure="picture")
    assert marked(pictures, "U-Net", DISPLAY) == "U-Net"  # which are not compared with predictions
    gray = {
        label: ("no better than gray",) * (value < constant)
        for label, value in zip(LABELS, (network, identity, 40), strict=True)
    }
    rows = {row.label: row.marks for row in board(found).displays[0].rows}
    assert rows == gray | {"U-Net": (*filter(None, [mark.removeprefix(", ")]), *gray["U-Net"])}


def test_a_gray_picture_scores_the_mean_of_what_is_known_of_it() -> None:
    found = results(20.0, 19.0, 18.0, measure="picture")
    assert found.floor(DISPLAY) == pytest.approx(18.0)
    values = found.values("Wirtinger", DISPLAY).copy()
    values[0] = math.nan
    assert found.floor(DISPLAY, less=values) == pytest.approx(18.0 - 40.0)
    assert found.floor(DISPLAY, less=values * math.nan) is None


def test_a_fallback_stands_in_the_row_and_survives_the_file_of_records() -> None:
    found = results(20.0, 19.0, 18.0, fell_back=True)
    assert marked(found, "U-Net", DISPLAY) == "U-Net, fell back to Wirtinger"
    again = Results(read_records(csv_text(found.frame)), found.facts)
    assert marked(again, "U-Net", DISPLAY) == "U-Net, fell back to Wirtinger"
    assert "fell_back" not in results(20.0, 19.0, 18.0).frame


@pytest.mark.parametrize(
    ("score", "seconds", "photographs", "mark"),
    [
        (30.0, 2.0, 0, ", dominated by Steps"),
        (30.0, 0.5, 0, ""),  # nothing is as fast
        (32.0, 2.0, 0, ""),  # nothing as fast is as good
        (30.0, 2.0, 9, ""),  # nothing is known of the display without photographs
    ],
)
def test_a_network_without_photographs_is_dominated_by_what_is_as_fast(score, seconds, photographs, mark) -> None:
    rows = {"Network": (score, seconds), "Steps": (31.0, 1.0), "Many steps": (40.0, 9.0)}
    learned = {"learned": {"sha256": "2" * 64, "captures": photographs, "seconds": 1.0}}
    records = [
        record(label, cell(label.lower(), target, DISPLAY), {"psnr_linear": value}, cpu_s=cost)
        | (learned if label == "Network" else {})
        for label, (value, cost) in rows.items()
        for target in TARGETS
    ]
    found = of_records(records, trained=frozenset({"Network"}))
    assert [marked(found, label, DISPLAY) for label in rows] == [f"Network{mark}", "Steps", "Many steps"]


def reading(label: str, *files: str) -> dict[str, Any]:
    return {"label": label, "uncovered": list(files)}


def test_files_that_no_cell_is_named_after_are_told_once_and_installed_ones_are_not() -> None:
    library = "/usr/lib/python3.11/site-packages/scipy/io/wavfile.py"
    records = [
        reading("mine", "/data/k.json", library),
        reading("mine", "/data/k.json"),
        reading("other", library),
        {"label": "x"},
    ]
    text = uncovered(records)
    assert text.startswith("Not covered: mine reads /data/k.json: a change there is not noticed")
    assert "scipy" not in text
    assert uncovered(records[2:]) == ""
    assert text.endswith("after one choose another --output.")
    assert uncovered([{**records[1], "learned": {"sha256": "a"}}]).endswith("another --output, with --retrain.")
    assert "\x1b" not in uncovered([reading("mine", "/data/\x1b[2J.json")])  # which a terminal would obey
