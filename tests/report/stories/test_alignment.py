"""Alignments of given pictures: which are shown, and whether two aligners agree."""

from pathlib import Path

import numpy as np
import pytest

from holobench_eval.report.description import Description
from holobench_eval.report.stories.alignment import FIGURES, PARTS, agreement
from holobench_eval.report.story import Report
from holobench_eval.study.folders import FILES, alignment_name
from tests.support.synthetic_study import cell, record, results


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
    (part,), numbers = PARTS, results(records, measure=FILES, baseline=None)
    return list(part.figures(Report(numbers, records, output, {}, Description())))


def test_the_captures_of_the_lowest_correlation_are_shown_the_lowest_first_and_that_is_said(tmp_path: Path) -> None:
    correlations = [0.9 - 0.01 * index for index in range(FIGURES + 3)]
    pictures = figures(tmp_path, correlations)
    assert [path.name for path, _ in pictures] == [
        alignment_name("m", f"t{index}") for index in range(FIGURES + 2, 2, -1)
    ]
    assert pictures[0][1].startswith("m, t10, correlation 0.800: the outline of the target")
    for _, caption in pictures:
        assert "the 8 of 11 captures with the lowest correlation, the lowest first; the others are in" in caption


def test_all_are_shown_where_they_are_few(tmp_path: Path) -> None:
    pictures = figures(tmp_path, [0.9, 0.7, 0.8])
    lowest_first = (("t1", "0.700"), ("t2", "0.800"), ("t0", "0.900"))
    assert [caption.partition(":")[0] for _, caption in pictures] == [
        f"m, {t}, correlation {c}" for t, c in lowest_first
    ]
    assert not any("lowest" in caption for _, caption in pictures)


@pytest.mark.parametrize(
    ("second", "text"),
    [
        ({}, "Warning: the second aligner cannot judge any capture."),
        ({"t0": 20.1, "t1": 20.0}, "agrees within 0.2 dB on 2 captures; its largest difference is +0.10 dB."),
        ({"t0": 20.1, "t1": np.inf}, "on 1 capture; its largest difference is +0.10 dB. It cannot judge 1 capture."),
        ({"t0": 20.1, "t1": 19.5}, "differ by more than 0.2 dB (m, t1: -0.50 dB). These scores depend on"),
    ],
)
def test_scores_that_depend_on_the_aligner_are_warned_of(second: dict[str, float], text: str) -> None:
    records = [
        record("m", cell("m", name, "d"), {"psnr_linear": 20.0, "psnr_linear_second": second.get(name, np.nan)})
        for name in ("t0", "t1")
    ]
    assert text in agreement(results(records, measure=FILES, baseline=None))
