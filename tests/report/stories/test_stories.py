"""A story costs a file, which is in no list; those of this package write the committed reports again."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from holobench_eval.commands.reports.report import report
from holobench_eval.report import Description, Results, stories, write_report
from tests.support import synthetic_study as synthetic
from tests.support.reports import whole

ROOT = Path(__file__).parents[3]
FILE = '''
"""How bright the captures are, which no other story asks."""

from holobench_eval.report.charts.look import new_figure, save
from holobench_eval.report.markdown import bullets, heading
from holobench_eval.report.story import Part

ORDER = 5
QUESTION = "How bright are the captures?"


def applies(results):
    return "ideal" in results.conditions


def verdicts(results):
    return ["Bright."]


def _render(report, figures):
    yield heading("Brightness | of captures")
    yield bullets(f"{name}: *{len(report.results.targets)}* targets" for name in report.results.methods("ideal"))
    yield from figures


def _figures(report):
    path = report.figures / "brightness.png"
    save(new_figure(40, 30), path)
    yield path, "Nothing yet."


PARTS = [Part(31, _render, applies=lambda report: applies(report.results), figures=_figures)]
'''


@pytest.fixture
def added(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "stories"
    folder.mkdir()
    (folder / "brightness.py").write_text(FILE)
    monkeypatch.setattr(stories, "__path__", [*stories.__path__, str(folder)])


@pytest.mark.usefixtures("added")
@pytest.mark.parametrize("condition", ["ideal", "leto-aged"])
def test_a_file_adds_a_story_at_its_place_where_it_applies(tmp_path: Path, condition: str) -> None:
    records = [
        synthetic.record(label, synthetic.cell(label, target, condition), {"psnr_linear": 20.0})
        for label in ("GS", "Wirtinger")
        for target in synthetic.TARGETS
    ]
    facts = synthetic.results(records).facts
    text = whole(write_report(facts, records, tmp_path / "report", {}, Description())[0])
    applies = condition == "ideal"
    headings = re.findall(r"^## (.*)$", text, flags=re.MULTILINE)
    assert headings[:2] == ["Answer", r"Brightness \| of captures" if applies else "Limits"]
    assert ("How bright are the captures?" in text) == ("\n- Bright.\n" in text) == applies
    assert ("\n- GS: \\*6\\* targets\n- Wirtinger: \\*6\\* targets\n" in text) == applies
    assert ("![Figure 2](figures/brightness.png)\n\n**Figure 2.** Nothing yet.\n" in text) == applies
    assert (tmp_path / "report" / "figures" / "brightness.png").is_file() == applies


def test_no_two_parts_share_a_place() -> None:
    places = [(part.details, part.order) for part in stories.parts()]
    assert places == sorted({*places})


# A study of each kind, and the network that stands for a display.
KINDS = {
    "ablation": "ablation",
    "budget": "budget",
    "comparison": "table3",
    "error_budget": "error-budget",
    "focus": "depth",
    "network": "table3/table2",
    "prediction": "table1",
    "ranks": "family/ranks",
    "sweeps": "robustness",
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_committed_report_is_written_again_byte_for_byte(kind: str, tmp_path: Path) -> None:
    name, _, part = KINDS[kind].partition("/")
    committed, again = ROOT / "reports" / name / part, tmp_path / "report"
    shutil.copytree(committed, again)
    report(ROOT / "configs" / f"{name}.yaml" / part, again)
    for path in committed.rglob("*"):
        if path.suffix in (".md", ".csv", ".json", ".tex") and path.name != "provenance.json":
            assert (again / path.relative_to(committed)).read_bytes() == path.read_bytes(), path


@pytest.mark.parametrize("story", [story for story in stories.stories() if hasattr(story, "QUESTION")])
def test_a_study_without_a_score_has_no_answer(story, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stories, "story_of", lambda results: story)
    empty = synthetic.results_of({"old": np.nan, "new": np.nan})
    lost = Results(empty.frame.assign(state="failed"), empty.facts)
    assert stories.answer(lost) == ["No cell of the study has a score, so there is no answer."]
