"""Names and meanings of the columns of a report's files."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from holobench_eval.metrics.catalogue import catalogue
from holobench_eval.report.data.columns import File, column, file_name, frame_name

REPORTS = Path(__file__).parents[3] / "reports"


def header(path: Path) -> list[str]:
    with path.open(newline="") as file:
        return next(csv.reader(file))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("psnr_linear", "psnr_linear_db"),
        ("psnr_linear_lo", "psnr_linear_lo_db"),
        ("psnr_linear_blur0.5", "psnr_linear_blur0.5px_db"),
        ("ssim_srgb", "ssim_srgb"),
        ("ssim_linear_blur1_hi", "ssim_linear_blur1px_hi"),
        ("reported_psnr", "reported_psnr_db"),
        ("reported_1-lpips", "reported_1-lpips"),
        ("seconds", "solving_s"),
        ("method", "label"),
        ("name", "method"),
        ("registration_residual_px", "registration_residual_px"),
    ],
)
def test_a_unit_is_the_last_part_of_a_name_in_a_file_and_the_name_in_frames_comes_back(
    name: str, expected: str
) -> None:
    assert file_name(name) == expected
    assert frame_name(expected) == name


@pytest.mark.parametrize("file", ["records.csv", "table.csv"])
def test_every_column_of_the_committed_reports_has_an_entry(file: File) -> None:
    reports = sorted(REPORTS.glob(f"*/{file}"))
    assert len(reports) > 10
    names = {name for path in reports for name in header(path)}
    written = {name if column(file, name) else file_name(frame_name(name)) for name in names}
    assert len(written) > 50
    assert [name for name in sorted(written) if column(file, name) is None] == []


@pytest.mark.parametrize("end", ["", "_lo", "_hi"])
def test_every_metric_of_the_catalogue_has_an_entry_with_its_unit(end: str) -> None:
    for metric in catalogue():
        for domain in metric.domains:
            found = column("table.csv", file_name(f"{metric.name}_{domain}{end}"))
            assert found is not None
            assert (found.unit, found.kind) == (metric.unit, "number")
            assert not metric.unit or found.name.endswith(f"_{metric.unit.lower()}")


def test_a_column_that_the_dictionary_lacks_is_found_out() -> None:
    assert column("records.csv", "glare") is None
    assert column("records.csv", "psnr_linear_glare_db") is None
    assert column("tests.csv", "psnr_linear_db") is None
    assert column("records.csv", "psnr_linear_lo_db") is None


def test_an_entry_says_what_a_difference_is_a_difference_of() -> None:
    found = column("tests.csv", "difference_lo_db")
    assert found is not None
    assert (found.unit, found.kind) == ("dB", "number")
    assert "not adjusted" in found.meaning
