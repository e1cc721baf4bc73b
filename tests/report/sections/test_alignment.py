"""The pictures of alignments that a report shows."""

from __future__ import annotations

from pathlib import Path

from holobench_eval.report.description import Description
from holobench_eval.report.section import Report
from holobench_eval.report.sections.alignment import FIGURES, SECTIONS
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
    (section,), found = SECTIONS, results(records, measure=FILES, baseline=None)
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
