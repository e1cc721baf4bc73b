"""The pictures of alignments that a report shows."""

from __future__ import annotations

from pathlib import Path

from holobench_eval.report import Results, records_frame
from holobench_eval.report.description import Description
from holobench_eval.report.section import Report
from holobench_eval.report.sections.alignment import FIGURES, SECTIONS
from holobench_eval.study.folders import FILES, alignment_name
from tests.support.synthetic_study import cell, layout, record


def figures(output: Path, correlations: list[float]) -> list[tuple[Path, str]]:
    """The figures of captures with these correlations, of a method and targets t0, t1 ..."""
    (output / "figures").mkdir(parents=True)
    records, targets = [], tuple(f"t{index}" for index in range(len(correlations)))
    for name, correlation in zip(targets, correlations, strict=True):
        geometry = {"kind": "own", "correlation": correlation}
        described = cell("m", name, "d", geometry=geometry, capture_sha256="0")
        records.append(record("m", described, {"psnr_linear": 20.0}))
        (output / "figures" / alignment_name("m", name)).touch()
    given = layout(pairs=(("m", "d"),), targets=targets, measure=FILES, baseline=None, reported={})
    (section,) = SECTIONS
    return list(
        section.figures(Report(Results(records_frame(records, given), given), records, output, {}, Description()))
    )


def test_the_captures_of_the_lowest_correlation_are_shown_the_lowest_first_and_that_is_said(tmp_path: Path) -> None:
    correlations = [0.9 - 0.01 * index for index in range(FIGURES + 3)]
    found = figures(tmp_path, correlations)
    assert [path.name for path, _ in found] == [alignment_name("m", f"t{index}") for index in range(FIGURES + 2, 2, -1)]
    assert found[0][1].startswith("m, t10, correlation 0.800: the outline of the target")
    for _, caption in found:
        assert "the 8 of 11 captures with the lowest correlation, the lowest first; the others are in" in caption


def test_all_are_shown_where_they_are_few(tmp_path: Path) -> None:
    found = figures(tmp_path, [0.9, 0.7, 0.8])
    assert [caption.partition(":")[0] for _, caption in found] == [
        "m, t1, correlation 0.700",
        "m, t2, correlation 0.800",
        "m, t0, correlation 0.900",
    ]
    assert not any("lowest" in caption for _, caption in found)
