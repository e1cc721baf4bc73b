"""``holoeval report`` where the folder of records is not there, as in a fresh clone."""

import json
import shutil

import pytest

from holobench_eval.commands.reports.check import problems_in
from holobench_eval.commands.reports.report import report
from holobench_eval.core.errors import UserError


@pytest.fixture
def committed(made):
    """A config, and the committed files of its report."""
    shutil.rmtree(made / "records")
    return made.parents[1] / "study.yaml", made


def test_a_new_question_and_a_new_name_of_a_row_are_written_from_the_committed_files_alone(committed):
    config, folder = committed

    def tables() -> list[bytes]:
        return [(folder / name).read_bytes() for name in ("records.csv", "table.csv")]

    before, known = tables(), json.loads((folder / "provenance.json").read_text())
    config.write_text(f"{config.read_text()}question: What does Toy score?\n")
    assert len(problems_in(folder)[1]) == 1

    report(config, folder)
    text = (folder / "report.md").read_text()
    assert all(words in text for words in ("What does Toy score?", "(figures/answer-pictures.jpg)"))
    assert tables() == before
    after = json.loads((folder / "provenance.json").read_text())
    assert {key for key in known if known[key] != after[key]} == {"config_sha256"}
    assert problems_in(folder)[1] == []

    config.write_text(config.read_text().replace("- plugins.py:Toy", '- {name: "plugins.py:Toy", label: Anew | <b>}'))
    report(config, folder)
    assert "| Anew \\| &lt;b>" in (folder / "report.md").read_text()
    assert problems_in(folder)[1] == []


def test_cells_that_the_committed_files_lack_are_computed_and_never_made_up(committed):
    config, folder = committed
    before = (folder / "report.md").read_bytes()
    config.write_text(config.read_text().replace("count: 2", "count: 3"))
    with pytest.raises(UserError, match=r"planned cells are not in records\.csv.*holoeval run .* computes them"):
        report(config, folder)
    assert (folder / "report.md").read_bytes() == before


def test_a_report_written_again_from_committed_files_keeps_the_protocol_that_its_scores_are_of(committed):
    config, folder = committed
    for name in ("provenance.json", "records.csv"):
        file = folder / name
        file.write_text(file.read_text().replace("v2", "v1"))
    before = json.loads((folder / "provenance.json").read_text())["scores"]
    records = (folder / "records.csv").read_bytes()
    report(config, folder)
    assert json.loads((folder / "provenance.json").read_text())["scores"] == before
    assert (folder / "records.csv").read_bytes() == records
    assert "| metric protocol | v1 |" in (folder / "details.md").read_text()
    assert problems_in(folder)[1] == []
