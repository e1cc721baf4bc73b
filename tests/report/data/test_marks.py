"""A row says what its number hides: a fallback that was taken, a network that predicts worse than none."""

from __future__ import annotations

from typing import Any

import pytest

from holobench_eval.report.data.board import board
from holobench_eval.report.data.phrases import marked
from holobench_eval.report.data.results import Results
from holobench_eval.report.data.tables import csv_text, read_records, records_frame
from holobench_eval.study.plan import REFERENCE
from tests.support.synthetic_study import TARGETS, cell, layout, record

DISPLAY = "leto-aged"
LABELS = ("U-Net", "Identity", "Wirtinger")


def results(network: float, identity: float, constant: float, measure: str = "prediction", **learned: Any) -> Results:
    """A study in which every target of a row has the same PSNR [dB]."""
    given = {"U-Net": network, "Identity": identity, "Wirtinger": 40.0}
    records = [
        record(label, cell(label.lower(), target, DISPLAY), {"psnr_linear": value})
        for label, value in given.items()
        for target in TARGETS
    ]
    for one in records:
        if one["label"] == "U-Net":
            one["learned"] = {"sha256": "2" * 64, "captures": 3, "seconds": 1.0, **learned}
    records += [
        record("floor_constant", cell("floor_constant", target, REFERENCE), {"psnr_linear": constant})
        for target in TARGETS
    ]
    shape = layout(
        pairs=tuple((label, DISPLAY) for label in LABELS),
        trained=frozenset({"U-Net", "Identity"}),
        identities=frozenset({"Identity"}),
        measure=measure,
        holograms="wirtinger",
        privileged=frozenset(),
        reported={},
    )
    return Results(records_frame(records, shape), shape)


@pytest.mark.parametrize(
    ("network", "identity", "constant", "mark"),
    [
        (20.0, 19.0, 18.0, ""),
        (17.0, 16.0, 18.0, ", not trained to convergence: below the constant image"),
        (18.5, 19.0, 18.0, ", not trained to convergence: below the ideal image"),
        (17.0, 19.0, 18.0, ", not trained to convergence: below the constant image and the ideal image"),
    ],
)
def test_a_network_that_predicts_worse_than_no_training_is_marked(
    network: float, identity: float, constant: float, mark: str
) -> None:
    found = results(network, identity, constant)
    assert marked(found, "U-Net", DISPLAY) == f"U-Net{mark}"
    assert marked(found, "Identity", DISPLAY) == "Identity"  # it has nothing to learn
    gray = {
        label: ("no better than gray",) * (value < constant)
        for label, value in zip(LABELS, (network, identity, 40), strict=True)
    }
    rows = {row.label: row.marks for row in board(found).displays[0].rows}
    assert rows == gray | {"U-Net": (*filter(None, [mark.removeprefix(", ")]), *gray["U-Net"])}


def test_pictures_are_not_compared_with_predictions() -> None:
    assert marked(results(17.0, 19.0, 18.0, measure="picture"), "U-Net", DISPLAY) == "U-Net"


def test_a_fallback_stands_in_the_row_and_survives_the_file_of_records() -> None:
    found = results(20.0, 19.0, 18.0, fell_back=True)
    assert marked(found, "U-Net", DISPLAY) == "U-Net, fell back to Wirtinger"
    again = Results(read_records(csv_text(found.frame)), found.layout)
    assert marked(again, "U-Net", DISPLAY) == "U-Net, fell back to Wirtinger"
    assert "fell_back" not in results(20.0, 19.0, 18.0).frame
