import re

import pytest

from holobench_eval.report import Results, records_frame
from holobench_eval.report.build import print_figures
from holobench_eval.report.charts.look.medium import MEDIA
from holobench_eval.report.description import Description
from holobench_eval.report.section import Report
from tests.support import budget_study as budget


def printed(folder, medium):
    layout = budget.layout(pairs=tuple((label, "leto-aged") for label in budget.ROWS))
    records = [record for record in budget.study() if record["cell"]["condition"] == "leto-aged"]
    report = Report(Results(records_frame(records, layout), layout), [], folder / "none", {}, Description())
    return list(print_figures(report, folder / medium, medium))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("print")
    return [path for medium in MEDIA for path in printed(folder, medium)]


def test_every_chart_of_numbers_is_written_as_the_files_of_its_medium(files):
    names = ("quality-paired-leto-aged", "quality-captures")
    expected = {(key, f"{name}{end}") for key, medium in MEDIA.items() for name in names for end in medium.suffixes}
    assert {(path.parent.name, path.name) for path in files} == expected
    assert all(path.is_file() for path in files)


@pytest.mark.parametrize(
    ("medium", "points", "millimetres"), [("column", 7, 84), ("double", 7, 174), ("talk", 12, 325.12)]
)
def test_figures_are_as_wide_as_their_medium_in_type_that_can_be_read_and_stays_text(
    files, medium, points, millimetres
):
    for path in (path for path in files if path.parent.name == medium and path.suffix == ".svg"):
        text = path.read_text()
        # At 72 pixels an inch, in which matplotlib writes SVG, a pixel is a point.
        assert min(float(size) for size in re.findall(r"font(?:-size)?:[^;\"]*?([\d.]+)px", text)) >= points, path.name
        assert ">parametric_model" in text
        assert "<dc:date>" not in text
        width = float(re.search(r'width="([\d.]+)pt"', text).group(1)) / 72 * 25.4
        assert width == pytest.approx(millimetres, abs=0.3)
    for path in (path for path in files if path.parent.name == medium and path.suffix == ".pdf"):
        content = path.read_bytes()
        assert b"/FontFile2" in content, path.name  # TrueType and not outlines of letters
        assert b"CreationDate" not in content


def test_two_prints_have_equal_bytes(files, tmp_path):
    again = printed(tmp_path, "column")
    first = [path for path in files if path.parent.name == "column"]
    assert [path.name for path in again] == [path.name for path in first]
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in first]
