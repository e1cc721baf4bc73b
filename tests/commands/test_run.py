"""What ``holoeval run`` does beside the cells."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from holobench_eval.commands.run import Sheet, _is_finished, _panel, draw_sheets, replaced, sheets
from holobench_eval.report.charts import sheet as charts
from holobench_eval.study import opening
from holobench_eval.study import plan as planning
from holobench_eval.study.config import load_study
from holobench_eval.study.running import provenance
from tests.support.studies.fake_study import write_config


@pytest.fixture
def drawn(monkeypatch):
    """What sheets have been drawn from; no bench is opened."""
    sources: list[str] = []
    monkeypatch.setattr(opening, "simulated", lambda display, seed: SimpleNamespace())
    monkeypatch.setattr(charts, "save_sheet", lambda bench, note, path, source: sources.append(source))
    return sources


def sheet(folder: Path) -> Sheet:
    (found,) = sheets(load_study(write_config(folder)), folder)
    return found


def test_a_sheet_that_is_there_is_not_drawn_again(tmp_path, drawn, monkeypatch):
    wanted = sheet(tmp_path)
    wanted()
    assert drawn == [wanted.identity]
    monkeypatch.setattr(charts, "drawn_from", lambda path: wanted.identity if path == wanted.path else "")
    wanted()
    assert len(drawn) == 1


def test_a_sheet_that_cannot_be_drawn_is_a_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(opening, "simulated", lambda display, seed: 1 / 0)
    draw_sheets([sheet(tmp_path)], threads=1)
    assert capsys.readouterr().err == "holoeval: no stage sheet of ideal: division by zero\n"


def test_the_panel_of_a_config_is_known_before_it_is_checked(tmp_path):
    study = load_study(write_config(tmp_path))
    assert _panel(study.file) == study.display.panel
    for text in (
        "display: {profiles: [ideal]}",
        "display: [",
        "3",
        "display: {panel: large}",
        "display: {panel: [.inf, 64]}",
    ):
        (tmp_path / "other.yaml").write_text(text)
        assert _panel(tmp_path / "other.yaml") is None
    assert _panel(tmp_path / "missing.yaml") is None


def test_a_study_is_finished_when_its_last_run_ended_and_its_config_is_still_the_same(tmp_path):
    study, output = load_study(write_config(tmp_path)), tmp_path / "out"
    assert not _is_finished(study.file, output)
    described = provenance.begin(output, provenance.describe(study, planning.plan(study), output, 1, 1), resumed=False)
    assert not _is_finished(study.file, output)
    provenance.end(output, described)
    assert _is_finished(study.file, output)
    study.file.write_text(study.text + "# changed\n")
    assert not _is_finished(study.file, output)


def test_a_report_of_another_config_is_not_replaced_without_a_word(tmp_path):
    study = load_study(write_config(tmp_path))
    assert replaced(study, tmp_path) == ""
    (tmp_path / "report.md").write_text("")
    known = {"config_sha256": provenance.text_digest(study.text), "earlier": []}
    (tmp_path / "provenance.json").write_text(json.dumps(known))
    assert replaced(study, tmp_path) == ""
    (tmp_path / "provenance.json").write_text(json.dumps({**known, "config_sha256": "0"}))
    assert "is of another or an edited config" in replaced(study, tmp_path)
    part = {**known, "config_sha256": "0", "changes": {"limit": 2}}
    (tmp_path / "provenance.json").write_text(json.dumps(part))
    assert "was run with --limit 2" in replaced(study, tmp_path)
