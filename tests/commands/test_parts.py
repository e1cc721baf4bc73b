"""Studies in one file, as a person runs them: the first and its parts."""

import json
import shutil
from pathlib import Path

import pytest

CONFIG = """\
title: First
question: What is first?
display: {profiles: [ideal], panel: [128, 128]}
targets: {dataset: charts, params: {names: [gray_ramp]}}
protocol: {metrics: [psnr, ssim]}
methods: [double_phase]
parts:
  bars:
    title: Bars
    question: What of bars?
    targets: {dataset: charts, params: {names: [usaf_bars]}}
  one-step:
    title: One step
    question: What of one step?
    methods: [double_phase, {name: wirtinger, params: {iterations: 1}}]
"""
NAMES = ("", "bars", "one-step")


@pytest.fixture
def config(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "toy.yaml"
    path.write_text(CONFIG)
    return path


def rows(folder: Path) -> list[str]:
    """The lines of a report's records.csv."""
    return (folder / "records.csv").read_text().splitlines()


@pytest.mark.slow
def test_a_study_and_its_parts_from_plan_to_check(config, call, in_process):
    top, typed = Path("holoeval-results/toy"), (config, *(f"{config}/{name}" for name in NAMES[1:]))
    code, printed, _ = call("plan", config)
    assert (code, printed.count("output folder: ")) == (0, 3)
    # of methods 1, 1 and 2, and five floors each
    assert printed.splitlines()[-1] == "3 studies: 0 done, 0 failed, 19 missing of 19 cells"

    for study in typed:
        assert call("run", study)[0] == 0
    assert call("report", config)[0] == 0  # with the answers of the parts
    assert not [*top.glob("**/solved/*.pt")]  # but beside it, for all
    texts = {name: (top / name / "report.md").read_text() for name in NAMES}
    assert [texts[name].partition("\n")[0] for name in NAMES] == ["# First", "# Bars", "# One step"]
    assert {rows(top / name)[1].split(",")[0] for name in NAMES} == {"toy", "toy/bars", "toy/one-step"}
    for name in NAMES[1:]:
        answer = texts[name].partition("## Answer\n\n- ")[2].partition("\n")[0]
        assert answer in texts[""]
        assert f"]({name}/report.md)" in texts[""]
        assert f"holoeval run toy.yaml/{name}" in texts[name]
        assert "## Parts" not in texts[name]
    assert texts["bars"].count("What of bars?") == texts[""].count("What of bars?") == 1

    assert call("plan", config)[1].splitlines()[-1] == "3 studies: 19 done, 0 failed, 0 missing of 19 cells"
    for study in typed:
        code, printed, _ = call("run", study)
        assert (code, printed.count("0 of")) == (0, 1)
    assert {name: (top / name / "report.md").read_text() for name in NAMES} == texts

    assert call("check", "holoeval-results")[1].splitlines()[-1] == "3 reports, 0 problems"
    assert call("check", top)[1].splitlines()[-1] == "3 reports, 0 problems"
    assert call("check", top / "bars")[1].splitlines()[-1] == "1 report, 0 problems"
    config.write_text(CONFIG.replace("What of bars?", "And of bars?"))
    code, printed, _ = call("check", top)
    assert (code, printed.count("the text of the config has changed")) == (1, 1)
    assert call("report", config)[0] == 0
    assert "And of bars?" in (top / "report.md").read_text()
    assert call("check", top)[0] == 0
    assert call("rescore", config)[1].count("0 captures scored again, 0 solved") == 3

    (top / "bars" / "report.md").write_bytes(b"\xff\n\n")
    shutil.rmtree(top / "one-step")
    assert call("report", config)[0] == 0
    text = (top / "report.md").read_text()
    assert "And of bars?" in text  # whose report was written again
    assert "one-step has no report with an answer here: `holoeval run toy.yaml/one-step" in text


def test_a_part_is_run_alone_with_some_of_its_methods_or_in_another_folder(config, call, in_process):
    assert call("run", f"{config}/one-step", "--output", "other", "--methods", "wirtinger")[0] == 0
    assert json.loads(Path("other/provenance.json").read_text())["config"] == "../toy.yaml/one-step"
    assert not Path("holoeval-results").exists()
    assert any("wirtinger" in row for row in rows(Path("other")))
    assert call("check", "other")[0] == 0


def test_a_changed_study_leaves_its_parts_out(config, call, in_process):
    assert call("plan", config, "--set", "seed=7")[1].count("output folder: ") == 1


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("toy.yaml/bar", "toy.yaml: no part 'bar'; did you mean 'bars'? allowed: bars, one-step"),
        ("depht/frames", "no study of the name 'depht' ships, and no such file is here; did you mean 'depth'?"),
        ("depth/frame", "depth.yaml: no part 'frame'; did you mean 'frames'?"),
        ("configs/depth/frames", "a part follows a name or a file, file.yaml/part"),
        ("toy.yml/bars", "toy.yml/bars: no such file in "),
    ],
)
def test_a_misspelt_part_is_one_line(config, call, given, message):
    code, out, error = call("plan", given)
    assert (code, out, error.count("\n")) == (2, "", 1)
    assert message in error


@pytest.mark.parametrize("arguments", [("plan", "toy.yaml"), ("run", "toy.yaml/bars")])
def test_a_part_that_cannot_be_run_is_refused_before_anything_is_written(config, call, arguments):
    config.write_text(CONFIG.replace("usaf_bars", "bras"))
    code, _, error = call(*arguments)
    assert (code, error.count("\n")) == (2, 1)
    assert "toy.yaml:11:" in error
    assert not Path("holoeval-results").exists()


@pytest.mark.parametrize("content", [b"", b"# Bars", b"\xff\xfe", b"# a\n\nb\n\n## Limits\n\n- c\n\nd"])
def test_a_damaged_report_of_a_part_is_told_and_costs_no_report(config, call, in_process, content):
    assert call("run", config, "--methods", "double_phase", "--output", "out")[0] == 0
    config.write_text(CONFIG.replace("title: First", "title: Anew"))
    folder = Path("holoeval-results/toy")
    (folder / "bars").mkdir(parents=True)
    (folder / "bars" / "report.md").write_bytes(content)
    shutil.copytree("out/records", folder / "records")
    assert call("report", config)[0] == 0
    text = (folder / "report.md").read_text()
    assert "bars has no report with an answer here: `holoeval report toy.yaml/bars" in text
    assert "`holoeval run toy.yaml/one-step" in text


@pytest.mark.slow
def test_a_part_without_a_metric_is_left_alone_where_the_metric_is_scored_again(config, call, in_process):
    config.write_text(CONFIG.partition("  one-step:")[0] + "    protocol: {metrics: [psnr]}\n")
    for study in (config, f"{config}/bars"):
        assert call("run", study)[0] == 0
    lost = min(Path("holoeval-results/toy/bars/records").glob("*.json"))
    lost.unlink()
    code, printed, _ = call("rescore", config, "--metric", "ssim")
    assert (code, printed.count("captures scored again")) == (0, 1)
    assert not lost.exists()  # it would be computed, had the part been run


@pytest.mark.slow
def test_a_study_that_has_changed_is_not_scored_again_over_its_good_report(config, call, in_process):
    config.write_text(CONFIG.partition("parts:")[0])
    assert call("run", config)[0] == 0
    report = Path("holoeval-results/toy/report.md")
    good = report.read_bytes()
    config.write_text(f"{config.read_text()}seed: 5\n")
    code, _, error = call("rescore", config)
    assert (code, "no cell of this study has a record here" in error) == (2, True)
    assert report.read_bytes() == good
