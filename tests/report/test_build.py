import random
import re

import numpy as np
import pytest
from skimage.io import imread

from holobench_eval.report import Results, records_frame, write_report
from holobench_eval.report.build import print_figures
from holobench_eval.report.charts.look import MEDIA
from holobench_eval.report.description import Description, Display
from holobench_eval.report.story import Report
from tests.support import budget_study as budget
from tests.support import synthetic_study as synthetic
from tests.support.reports import files, whole

PROVENANCE = {"package": "0.1.0", "python": "3.11.2", "cpu": "a processor", "threads": 1}
PROVENANCE |= {"packages": {"torch": "2.13.0"}}
TARGETS = synthetic.TARGETS[1:4]
FACTS = synthetic.facts(targets=TARGETS)
DESCRIPTION = Description(
    displays=(Display("leto-aged", "Version 1. An aged panel.", ("crosstalk: width = 0.45",)),),
    config_file="configs/table3.yaml",
    config_text="title: Made-up captures\n",
)


def minimal(records, **changes):
    """The records of one display and three methods, and the facts for them: little to draw."""
    kept = [r for r in records if r["cell"]["condition"] != "ideal" and r["label"] not in ("SGD", "HIL", "Oracle")]
    pairs = tuple((label, "leto-aged") for label in ("Double phase", "GS", "Wirtinger"))
    return kept, synthetic.facts(**({"targets": TARGETS, "pairs": pairs, "reported": {}} | changes))


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    return folder, synthetic.study(folder, size=48, targets=TARGETS)


@pytest.fixture(scope="module")
def report(records):
    folder, found = records
    return whole(write_report(FACTS, found, folder, PROVENANCE, DESCRIPTION)[0])


def test_a_report_is_written_with_tables_and_every_figure(records, report):
    folder, _ = records
    linked = re.findall(r"!\[Figure \d+\]\((.*?)\)", report)
    assert linked == [
        "figures/quality-paired-leto-aged.png",
        "figures/answer-pictures.jpg",
        "figures/quality-paired-ideal.png",
    ]
    for name in linked:
        picture = imread(folder / name)
        assert min(picture.shape[:2]) > 200
        assert len({tuple(pixel) for pixel in picture[::5, ::5].reshape(-1, picture.shape[2])}) > 20
    for name in ("records.csv", "table.csv", "tests.csv", "board.json", "columns.md", "table.tex"):
        assert (folder / name).is_file()


def test_two_equal_runs_give_equal_bytes_whatever_the_order_of_the_records(records, tmp_path):
    folder, found = records
    kept, facts = minimal(found)
    written = []
    for number, order in enumerate((kept, random.Random(1).sample(kept, len(kept)))):
        output = tmp_path / str(number)
        output.mkdir()
        (output / "records").symlink_to(folder / "records")
        of_the_run = {"started": str(number), "revision": f"{number}bc", "command": f"holoeval run {number}.yaml"}
        write_report(facts, order, output, PROVENANCE | of_the_run, DESCRIPTION)
        (output / "records").unlink()
        written.append(files(output))
    assert written[0].keys() == written[1].keys()
    assert [name for name in written[0] if written[0][name] != written[1][name]] == []


def test_a_reader_finds_what_was_measured_what_failed_and_how_to_do_it_again(report):
    for phrase in (
        "3 targets, 6 methods, 2 displays: 36 cells, 1 without a score.",
        "crosstalk: width = 0.45",
        "| Wirtinger | `wirtinger` | iterations=200 |",
        "**Knows the display: the best phase known**",
        "Chakravarthula et al. 2020, Table 3",
        "**LPIPS:** left out, since no package",
        "leto-aged 0.070 px, ideal 0.070 px",
        "holoeval run configs/table3.yaml",
        "| torch | 2.13.0 |",
        "| GS | leto-aged | coffee | 0 | failed | registration residual 1.32 px",
        "GS, 2 of 3 targets",
    ):
        assert phrase in report, phrase


def test_figures_of_an_earlier_run_do_not_stay(records, tmp_path):
    kept, facts = minimal(records[1])
    names = ("comparison-old-9.jpg", "stages-old.png", "stages-leto-aged.png")
    *stale, sheet = (tmp_path / "figures" / name for name in names)
    for file in (*stale, sheet):
        synthetic.save_picture(file, np.full((8, 8, 3), 0.5))
    text = whole(write_report(facts, kept, tmp_path, {}, Description())[0])
    assert not any(file.exists() for file in stale)
    assert sheet.exists()
    assert "(figures/stages-leto-aged.png)" in text


def test_missing_thumbnails_stop_nothing_and_two_targets_are_reported_without_tests(records, tmp_path):
    kept, facts = minimal(records[1], targets=TARGETS[:1] + TARGETS[2:])
    kept = [record for record in kept if record["cell"]["target"] != TARGETS[1]]
    text = whole(write_report(facts, kept, tmp_path, {}, Description())[0])
    assert "answer-pictures" not in text
    assert "No description of the displays was recorded." in text
    assert "The environment was not recorded." in text
    assert re.search(r"\| Double phase \| leto-aged \| \+[0-9.]+ \| [0-2] of 2 \| – \| no test \|", text)


def test_hostile_names_stay_text(records, tmp_path):
    evil = "<img src=x onerror=alert(1)> | **b** [l](javascript:1)"
    pairs = tuple((label, "leto-aged") for label in ("Double phase", "GS", evil))
    kept, facts = minimal(records[1], title=evil, baseline=evil, pairs=pairs)
    renamed = [record | {"label": evil} if record["label"] == "Wirtinger" else record for record in kept]
    description = Description(config_text="```\n<script>\n```", config_file="x.yaml")
    text = whole(write_report(facts, renamed, tmp_path, {}, description)[0])
    body = text.replace("```\n<script>\n```", "")
    assert "<img" not in body
    assert not re.search(r"(?<!\\)\]\(javascript", body)
    assert "****" not in text
    assert "\n````\n```\n<script>\n```\n````\n" in text
    widths = [
        {len(re.findall(r"(?<!\\)\|", line)) for line in block.splitlines()}
        for block in re.findall(r"(?:^\|.*\n)+", text, flags=re.MULTILINE)
    ]
    assert all(len(width) == 1 for width in widths)


def test_a_study_in_which_everything_failed_still_has_a_report(records, tmp_path):
    kept, facts = minimal(records[1])
    failed = [record | {"state": "failed", "reason": "no light", "scores": {}} for record in kept]
    text = whole(write_report(facts, failed, tmp_path, {}, Description())[0])
    assert "9 cells, 9 without a score." in text
    assert text.count("no light") == len(kept)


def printed(folder, medium):
    few = ("wirtinger", "hil", "parametric_model (16 captures)", "online_camera (25 captures)")
    facts = budget.facts(pairs=tuple((label, "leto-aged") for label in few))
    records = [r for r in budget.study() if r["cell"]["condition"] == "leto-aged" and r["label"] in few]
    report = Report(Results(records_frame(records, facts), facts), [], folder / "none", {}, Description())
    return list(print_figures(report, folder / medium, medium))


@pytest.fixture(scope="module")
def prints(tmp_path_factory):
    folder = tmp_path_factory.mktemp("print")
    return [path for medium in MEDIA for path in printed(folder, medium)]


def test_every_chart_of_numbers_is_written_as_the_files_of_its_medium(prints):
    names = ("quality-paired-leto-aged", "quality-captures")
    expected = {(key, f"{name}{end}") for key, medium in MEDIA.items() for name in names for end in medium.suffixes}
    assert {(path.parent.name, path.name) for path in prints} == expected
    assert all(path.is_file() for path in prints)


@pytest.mark.parametrize(
    ("medium", "points", "millimetres"), [("column", 7, 84), ("double", 7, 174), ("talk", 12, 325.12)]
)
def test_figures_are_as_wide_as_their_medium_in_text_that_can_be_read(prints, medium, points, millimetres):
    for path in (path for path in prints if path.parent.name == medium and path.suffix == ".svg"):
        text = path.read_text()
        # At 72 pixels an inch, in which matplotlib writes SVG, a pixel is a point.
        assert min(float(size) for size in re.findall(r"font(?:-size)?:[^;\"]*?([\d.]+)px", text)) >= points, path.name
        assert ">parametric_model" in text
        assert "<dc:date>" not in text
        width = float(re.search(r'width="([\d.]+)pt"', text).group(1)) / 72 * 25.4
        assert width == pytest.approx(millimetres, abs=0.3)
        height = float(re.search(r'height="([\d.]+)pt"', text).group(1)) / 72 * 25.4
        assert medium != "talk" or height == pytest.approx(millimetres * 9 / 16, abs=0.3)
    for path in (path for path in prints if path.parent.name == medium and path.suffix == ".pdf"):
        content = path.read_bytes()
        assert b"/FontFile2" in content, path.name  # TrueType and not outlines of letters
        assert b"CreationDate" not in content


def test_two_prints_have_equal_bytes(prints, tmp_path):
    again = printed(tmp_path, "column")
    first = [path for path in prints if path.parent.name == "column"]
    assert [path.name for path in again] == [path.name for path in first]
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in first]
