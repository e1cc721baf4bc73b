"""Sections from made-up records: focal stacks, alignments, and estimates beside the truth."""

import math
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from holobench_eval.display.estimates import estimate, joined
from holobench_eval.report import Results
from holobench_eval.report.charts.tiles import noted
from holobench_eval.report.scores import parse
from holobench_eval.report.data.trainings import Training
from holobench_eval.report.description import Description
from holobench_eval.report.section import Report
from holobench_eval.report.sections import alignment
from holobench_eval.report.sections.alignment import FIGURES
from holobench_eval.report.sections.diagnosis import diagnoses, difference, missing
from holobench_eval.report.sections.focus import SECTIONS, by_plane
from holobench_eval.study.artifacts import TrainingRecord
from holobench_eval.study.folders import FILES, alignment_name
from tests.support import synthetic_study as synthetic
from tests.support.synthetic_study import cell, record, results

PLANES = {
    f"{scene}@{plane:g}mm": (scene, plane) for scene in ("shapes", "motorcycle", "room") for plane in (-2.0, 0.0, 2.0)
}
SECONDS = {"lens": 2.0, "joint": 5.0, "quick": 0.1}


def results_of(quality: dict[str, float], noise: float = 0.2, **changes: Any) -> Results:
    """A study in which every method has a mean quality, less at the outer planes for the joint hologram."""
    records = []
    for label, mean in quality.items():
        for index, (target, (_, plane)) in enumerate(PLANES.items()):
            value = mean - (abs(plane) if label == "joint" else 0.0) + noise * (index % 3)
            scores = {"psnr_linear": value + 1, "psnr_linear_blur1": value + 2}
            scores |= {"psnr_linear_infocus": value, "ssim_linear_infocus": 0.5}
            described = synthetic.cell(label, target, "bench", measure="focus")
            records.append(synthetic.record(label, described, scores, seconds=SECONDS[label]))
    given = {"headline": "psnr_linear_infocus", "baseline": "lens", "measure": "focus", "planes": PLANES}
    return synthetic.results(records, **(given | {"stacked": frozenset({"joint"})} | changes))


def lines(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()]


def test_a_table_has_a_column_a_plane_and_the_seconds_of_a_hologram_and_of_a_scene() -> None:
    header, _, lens, joint = lines(by_plane(results_of({"lens": 20.0, "joint": 19.0}, noise=0.0), "bench"))
    assert header[2:] == ["-2 mm", "0 mm", "2 mm", "all planes", "seconds a hologram", "seconds a scene"]
    assert lens[:2] + lens[5:] == ["lens", "one plane", "20.00", "2", "6"]
    assert joint[1] == "all planes"
    assert [cell[:5] for cell in joint[2:6]] == ["17.00", "19.00", "17.00", "17.67"]
    assert joint[6:] == ["5", "5"]


def test_views_have_a_column_a_place_and_one_hologram_a_scene() -> None:
    results = results_of({"lens": 20.0, "joint": 19.0}, noise=0.0, measure="views")
    header, _, lens, joint = lines(by_plane(results, "bench"))
    assert header[2:] == ["-2", "0", "2", "all places", "seconds a hologram", "seconds a scene"]
    assert [lens[1], *lens[6:]] == ["the middle view", "2", "2"]
    assert [joint[1], *joint[6:]] == ["all views", "5", "5"]


def test_scores_in_focus_are_named_so_and_lead_the_tables_which_other_studies_lack() -> None:
    (section,) = SECTIONS
    for planes in (PLANES, {}):
        studied = results_of({"lens": 20.0}, planes=planes)
        assert section.applies(Report(studied, [], Path(), {}, Description())) == bool(planes)
    assert parse("psnr_linear_infocus").axis == "PSNR in focus, linear light [dB]"
    leading = [score.key for score in results_of({"lens": 20.0}).leading]
    assert leading[:3] == ["psnr_linear_infocus", "ssim_linear_infocus", "psnr_linear"]
    scores = [parse(key) for key in leading[:2]]
    cell = pd.Series({score.column: value for score, value in zip(scores, (16.384, 0.4), strict=True)})
    assert noted(scores, cell) == "in focus: PSNR 16.38 dB   SSIM 0.400"


def figures(output: Path, correlations: list[float]) -> list[tuple[Path, str]]:
    """The figures of captures with these correlations, of a method and targets t0, t1 ..."""
    (output / "figures").mkdir(parents=True)
    records = []
    for index, correlation in enumerate(correlations):
        name = f"t{index}"
        geometry = {"kind": "own", "correlation": correlation}
        described = cell("m", name, "d", geometry=geometry, capture_sha256="0")
        records.append(record("m", described, {"psnr_linear": 20.0}))
        (output / "figures" / alignment_name("m", name)).touch()
    (section,), found = alignment.SECTIONS, results(records, measure=FILES, baseline=None)
    return list(section.figures(Report(found, records, output, {}, Description())))


def test_the_captures_of_the_lowest_correlation_are_shown_the_lowest_first_and_that_is_said(tmp_path: Path) -> None:
    correlations = [0.9 - 0.01 * index for index in range(FIGURES + 3)]
    found = figures(tmp_path, correlations)
    assert [path.name for path, _ in found] == [alignment_name("m", f"t{index}") for index in range(FIGURES + 2, 2, -1)]
    assert found[0][1].startswith("m, t10, correlation 0.800: the outline of the target")
    for _, caption in found:
        assert "the 8 of 11 captures with the lowest correlation, the lowest first; the others are in" in caption


def test_all_are_shown_where_they_are_few(tmp_path: Path) -> None:
    found = figures(tmp_path, [0.9, 0.7, 0.8])
    lowest_first = (("t1", "0.700"), ("t2", "0.800"), ("t0", "0.900"))
    assert [caption.partition(":")[0] for _, caption in found] == [f"m, {t}, correlation {c}" for t, c in lowest_first]
    assert not any("lowest" in caption for _, caption in found)


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


def test_a_difference_of_phases_goes_the_shorter_way_and_methods_that_lack_the_same_are_told_once() -> None:
    assert difference({"value": 3.1, "truth": -3.1, "unit": "rad"}) == pytest.approx(6.2 - math.tau)
    assert difference({"value": 3.1, "truth": -3.1, "unit": "px"}) == pytest.approx(6.2)
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
