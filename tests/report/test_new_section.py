"""A section costs a file and a line: here the file lies beside the package's, and its name is added to the list."""

import re
from pathlib import Path

import pytest

from holobench_eval.report import Description, sections, write_report
from tests.support import synthetic_study as synthetic
from tests.support.reports import whole

FILE = '''
"""How bright the captures are, which no other section asks."""

from holobench_eval.report.charts.look import new_figure, save
from holobench_eval.report.markdown import bullets, heading
from holobench_eval.report.section import Section


def _render(report, figures):
    yield heading("Brightness | of captures")
    yield bullets(f"{name}: *{len(report.results.targets)}* targets" for name in report.results.methods("ideal"))
    yield from figures


def _figures(report):
    path = report.figures / "brightness.png"
    save(new_figure(40, 30), path)
    yield path, "Nothing yet."


SECTIONS = (
    Section("brightness", 31, _render, applies=lambda report: "ideal" in report.results.conditions, figures=_figures),
)
'''


@pytest.fixture
def added(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "sections"
    folder.mkdir()
    (folder / "brightness.py").write_text(FILE)
    monkeypatch.setattr(sections, "__path__", [*sections.__path__, str(folder)])
    monkeypatch.setattr(sections, "NAMES", (*sections.NAMES, "brightness"))


@pytest.mark.usefixtures("added")
@pytest.mark.parametrize("condition", ["ideal", "leto-aged"])
def test_a_file_and_a_line_add_a_section_at_its_place_where_it_applies(tmp_path: Path, condition: str) -> None:
    records = [
        synthetic.record(label, synthetic.cell(label, target, condition), {"psnr_linear": 20.0})
        for label in ("GS", "Wirtinger")
        for target in synthetic.TARGETS
    ]
    layout = synthetic.results(records).layout
    text = whole(write_report(layout, records, tmp_path / "report", {}, Description())[0])
    applies = condition == "ideal"
    headings = re.findall(r"^## (.*)$", text, flags=re.MULTILINE)
    assert headings[:2] == ["Answer", r"Brightness \| of captures" if applies else "Limits"]
    assert ("\n- GS: \\*6\\* targets\n- Wirtinger: \\*6\\* targets\n" in text) == applies
    assert ("![Figure 2](figures/brightness.png)\n\n**Figure 2.** Nothing yet.\n" in text) == applies
    assert (tmp_path / "report" / "figures" / "brightness.png").is_file() == applies


def test_every_file_of_sections_is_in_the_list_and_no_two_sections_share_a_place() -> None:
    folder = Path(sections.__file__).parent
    files = {
        ".".join(path.relative_to(folder).with_suffix("").parts)
        for path in folder.rglob("*.py")
        if path.stem != "__init__"
    }
    assert files == set(sections.NAMES)
    places = [(section.details, section.order) for section in sections.sections()]
    assert places == sorted(set(places))
