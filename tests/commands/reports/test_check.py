import json
import re

import pytest
import typer

from holobench_eval.commands.reports.check import check, problems_in
from holobench_eval.core.errors import UserError

DIFFERS = "does not follow from records.csv; run: holoeval report "


def test_a_report_that_follows_from_its_records_passes_by_itself_and_in_its_folder(made):
    assert problems_in(made) == problems_in(made.parent) == (1, [])


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("table.csv", "(Toy,open loop,.*?,,,,)2,", r"\g<1>3,", f"table.csv {DIFFERS}"),
        ("tests.csv", r"\Z", "1.0\n", f"tests.csv {DIFFERS}"),
        ("table.tex", r"\Z", "1.0\n", f"table.tex {DIFFERS}"),
        ("columns.md", r"\Z", "1.0\n", f"columns.md {DIFFERS}"),
        ("table.csv", "psnr_linear_median", "psnr_linear_mode", "table.csv has the columns of another version"),
        ("../../study.yaml", "seed: 3", "seed: 4", "14 of 14 planned cells are not in records.csv.*; run the study"),
        ("../../study.yaml", r"\Z", "question: Why?  # later\n", "has changed, but no cell; run: holoeval report "),
        ("../../study.yaml", r"\Z", "sede: 1\n", "unknown key 'sede'"),
        ("provenance.json", '"version": 1', '"version": 77', "profile 'ideal' was {'version': 77"),
        ("provenance.json", r"(?s)\A.*\Z", "{}", "lacks config, config_sha256, profiles"),
    ],
)
def test_what_was_changed_is_the_one_problem(made, name, old, new, message):
    file, before = made / name, (made / name).read_text()
    file.write_text(re.sub(old, new, before, count=1))
    assert file.read_text() != before
    (problem,) = problems_in(made)[1]
    assert problem.startswith(f"{made}: ")
    assert re.search(message.replace("{", r"\{"), problem)
    assert "holoeval report" not in problem or problem.split(" (")[0].endswith(f"study.yaml --output {made}")


@pytest.mark.parametrize("name", ["report.md", "details.md", "table.csv", "records.csv", "tests.csv"])
def test_a_missing_file_is_found(made, name):
    (made / name).unlink()
    (problem,) = problems_in(made)[1]
    assert re.search(rf"{name} .*missing", problem)


def test_a_folder_without_reports_is_refused(tmp_path):
    with pytest.raises(UserError, match="no report, and none in its folders"):
        problems_in(tmp_path)


def test_scores_by_an_earlier_protocol_are_no_problem_and_said_in_one_line(made, capsys):
    file = made / "provenance.json"
    scores = json.loads(file.read_text())["scores"]
    earlier = {name: version.replace("v2", "v1") for name, version in scores.items()}
    file.write_text(json.dumps(json.loads(file.read_text()) | {"scores": earlier}))
    for capture in (made / "records").glob("*.npy"):  # of which the scores of a fake study are not
        capture.unlink()
    check(made.parent)
    said, counted = capsys.readouterr().out.splitlines()
    assert said.startswith("1 report of scores by metric protocol v1, as their pages say; now it is v2")
    assert counted == "1 report, 0 problems"


@pytest.mark.parametrize("text", ["{", '{"scores": 3}', '{"scores": {"psnr": 1}}'])
def test_a_provenance_that_is_no_provenance_ends_the_check_with_its_problem_alone(made, text, capsys):
    (made / "provenance.json").write_text(text)
    with pytest.raises(typer.Exit):
        check(made.parent)
    assert "1 report, 1 problem" in capsys.readouterr().out
