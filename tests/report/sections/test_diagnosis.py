"""Estimates stand beside the truth in the report, and what the model's form lacks is said."""

from __future__ import annotations

import math

import pytest

from holobench_eval.display.estimates import estimate, joined
from holobench_eval.report.data.trainings import Training
from holobench_eval.report.sections.diagnosis import diagnoses, difference, missing
from holobench_eval.study.artifacts import TrainingRecord

FOUND = [
    *(estimate("lut_exponent", colour, value) for colour, value in enumerate((1.27, 1.24, 1.21))),
    *(estimate("undiffracted_phase", colour, 3.1) for colour in range(3)),
    *(estimate("crosstalk", colour, 0.6) for colour in range(3)),
]
TRUTH = [
    *(estimate("lut_exponent", colour, value) for colour, value in enumerate((1.28, 1.25, 1.22))),
    *(estimate("undiffracted_phase", colour, -3.1) for colour in range(3)),
    *(estimate("crosstalk", colour, 0.45) for colour in range(2)),
]


def trained(**facts: object) -> Training:
    record = TrainingRecord({"description": {"profile": "leto-aged"}, **facts}, ())
    return Training("parametric", ("parametric",), "leto-aged", record)


def lines(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()]


def test_each_quantity_has_its_estimates_truths_largest_difference_and_stated_error() -> None:
    ((whose, shown, verdict),) = diagnoses([trained(estimates=joined(FOUND, TRUTH))])
    assert whose == "parametric on leto-aged"
    header, _, exponent, phase, crosstalk = lines(shown)
    assert header[2:] == ["red", "green", "blue", "largest difference", "stated error"]
    assert exponent[2:] == ["1.270 (1.280)", "1.240 (1.250)", "1.210 (1.220)", "0.010", "0.04"]
    assert phase[1:3] == ["rad", "3.100 (-3.100)"]
    assert phase[5] == "0.083"  # the shorter way around
    assert crosstalk[2:6] == ["0.600 (0.450)", "0.600 (0.450)", "0.600 (–)", "0.150"]
    assert verdict == "6 of 8 numbers are within their stated errors; outside: crosstalk."


def test_estimates_that_are_all_right_are_said_to_be() -> None:
    ((_, _, verdict),) = diagnoses([trained(estimates=joined(FOUND[:6], TRUTH))])
    assert verdict == "All 6 numbers are within their stated errors."
    ((_, _, verdict),) = diagnoses([trained(estimates=joined(FOUND, []))])
    assert verdict.startswith("None of these has a ground truth")


def test_a_difference_of_phases_goes_the_shorter_way() -> None:
    assert difference({"value": 3.1, "truth": -3.1, "unit": "rad"}) == pytest.approx(6.2 - math.tau)
    assert difference({"value": 3.1, "truth": -3.1, "unit": "px"}) == pytest.approx(6.2)


def test_methods_that_lack_the_same_are_told_once() -> None:
    both = [trained(missing=["flicker | strong", "noise"]), trained(missing=["flicker | strong", "noise"])]
    assert missing(both) == ["leto-aged contains effects that parametric cannot represent: flicker | strong; noise."]
    assert missing([trained(missing=[])]) == ["leto-aged contains no effect that parametric cannot represent."]


@pytest.mark.parametrize(
    "facts",
    [
        {},
        {"estimates": "many", "missing": "much"},
        {"estimates": [1, {"name": 2, "value": 1.0}, {"name": "x"}, {"name": "x", "value": 1, "colour": []}]},
        {"estimates": [{"name": "x", "value": math.nan, "colour": 0}, {"name": "x", "value": True}], "missing": [1]},
        {"estimates": [{"name": "x", "value": 10**400, "colour": 0}]},
    ],
)
def test_provenance_of_strangers_shows_nothing_and_stops_nothing(facts: dict[str, object]) -> None:
    assert (diagnoses([trained(**facts)]), missing([trained(**facts)])) == ([], [])
    unknown = Training("x", ("x",), "y", None)
    assert (diagnoses([unknown]), missing([unknown])) == ([], [])


def test_numbers_of_a_stranger_are_shown_with_what_is_known_of_them() -> None:
    rows = [{"name": "hue_of", "value": 2, "colour": None}, {"name": "hue_of", "value": 1.0, "colour": 7, "error": "x"}]
    ((_, shown, verdict),) = diagnoses([trained(estimates=rows)])
    header, _, hue = lines(shown)
    assert header == ["quantity", "unit", "colour 7", "all", "largest difference", "stated error"]
    assert hue == ["hue of", "", "1.000", "2.000", "–", "–"]
    assert verdict.startswith("None of these")
    rows = [{"name": "hue_of", "value": 2, "colour": 0}, {"name": "width", "value": 1.0, "colour": None}]
    ((_, shown, _),) = diagnoses([trained(estimates=rows)])  # the only laser has no column of its own
    assert lines(shown)[0] == ["quantity", "unit", "all", "largest difference", "stated error"]
