import re

import pytest

from holobench_eval.report import Results, records_frame
from holobench_eval.report.charts.look.medium import MEDIA
from holobench_eval.report.description import Description
from holobench_eval.report.printing import print_figures
from holobench_eval.report.section import Report
from tests.support import budget_study as budget


def printed(folder, medium):
    layout = budget.layout()
    report = Report(Results(records_frame(budget.study(), layout), layout), [], folder / "none", {}, Description())
    return list(print_figures(report, folder / medium, medium))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("print")
    return [path for medium in MEDIA for path in printed(folder, medium)]


def test_every_chart_of_numbers_is_written_as_the_files_of_its_medium(files):
    names = ("quality-paired-leto-aged", "quality-paired-ideal", "quality-captures")
    expected = {(key, f"{name}{end}") for key, medium in MEDIA.items() for name in names for end in medium.suffixes}
    assert {(path.parent.name, path.name) for path in files} == expected
    assert all(path.is_file() for path in files)


def test_type_in_print_is_at_least_seven_points_and_stays_text(files):
    for path in files:
        if path.suffix == ".svg":
            text = path.read_text()
            # At 72 pixels an inch, in which matplotlib writes SVG, a pixel is a point.
            sizes = [float(size) for size in re.findall(r"font(?:-size)?:[^;\"]*?([\d.]+)px", text)]
            assert min(sizes) >= (12 if path.parent.name == "talk" else 7), path.name
            assert ">parametric_model" in text
            assert "<dc:date>" not in text
        elif path.suffix == ".pdf":
            content = path.read_bytes()
            assert b"/FontFile2" in content, path.name  # TrueType and not outlines of letters
            assert b"CreationDate" not in content


def test_figures_are_as_wide_as_their_columns(files):
    for path in files:
        if path.suffix == ".svg":
            width = float(re.search(r'width="([\d.]+)pt"', path.read_text()).group(1)) / 72 * 25.4
            assert width == pytest.approx(
                {"column": 84, "double": 174, "talk": 1280 / 100 * 25.4}[path.parent.name], abs=0.3
            )


def test_two_prints_have_equal_bytes(files, tmp_path):
    again = printed(tmp_path, "column")
    first = [path for path in files if path.parent.name == "column"]
    assert [path.name for path in again] == [path.name for path in first]
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in first]
