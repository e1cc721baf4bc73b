"""table.tex: the numbers of table.csv and tests.csv, in a form that LaTeX reads, whatever a method is called."""

import re
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest

from holobench_eval.report import Results, layout_of, read_records, records_frame
from holobench_eval.report.files import write_files
from holobench_eval.report.files.latex import escape, latex_tables
from holobench_eval.report.files.tests_csv import comparison_frame
from holobench_eval.study.config import load_study
from tests.support import synthetic_study as synthetic
from tests.support.budget_study import ROWS, TARGETS, layout, study

HOSTILE = "a_b & 10% $x$ \\input{x}"


def results(**changes: object) -> Results:
    records = [record | {"scores": record["scores"] | {"ssim_linear": 0.4321}} for record in study()]
    made = layout(study="budget", panels={"leto-aged": (192, 256)}, **changes)
    return Results(records_frame(records, made), made)


def named(name: str) -> Results:
    """Results of one method against a baseline, on a display with the method's name."""
    found = [
        synthetic.record(label, synthetic.cell(label, target, name), {"psnr_linear": 10.0 + index * (label == "b")})
        for label in ("b", name)
        for index, target in enumerate(TARGETS)
    ]
    return synthetic.results(found, baseline="b", study=name)


def rows(text: str, display: str) -> dict[str, list[str]]:
    """Cells of a display's table, by method."""
    (body,) = re.findall(rf"label{{tab:budget-{display}}}.*?midrule\n(.*?)\n *\\bottomrule", text, re.DOTALL)
    lines = (line.strip().removesuffix(" \\\\").split(" & ") for line in body.splitlines())
    return {first.replace("\\_\\allowbreak{}", "_"): rest for first, *rest in lines}


def test_the_numbers_are_those_of_the_csv_files() -> None:
    found = results()
    table, tests = (frame.set_index(["condition", "label"]) for frame in (found.table, comparison_frame(found)))
    shown = rows(latex_tables(found), "leto-aged")
    assert len(shown) == len(ROWS)
    for label in ("hil", "parametric_model (16 captures)", "online_camera_network"):
        row, test = table.loc[("leto-aged", label)], tests.loc[("leto-aged", label)]
        half = (row["psnr_linear_hi_db"] - row["psnr_linear_lo_db"]) / 2
        half_difference = (test["difference_hi_db"] - test["difference_lo_db"]) / 2
        assert shown[label] == [
            f"{row['psnr_linear_db']:.2f}",
            f"{half:.2f}",
            f"{test['difference_db']:+.2f}",
            f"{half_difference:.2f}",
            "*" if test["p_adjusted"] < 0.05 else "",
            f"{row['ssim_linear']:.3f}",
            f"{row['total_captures']:.0f}",
        ]
    assert shown["wirtinger"][2:4] == [r"\multicolumn{2}{c}{--}", ""]


def test_every_display_has_a_table_whose_rows_fit_its_columns() -> None:
    text = latex_tables(results())
    assert text.count(r"\begin{table}") == text.count(r"\end{table}") == 2
    for name in ("leto-aged", "ideal"):
        for cells in rows(text, name).values():
            assert len(cells) + cells.count(r"\multicolumn{2}{c}{--}") == 7
    assert "$\\pm$" in text
    assert r"\usepackage{booktabs,siunitx}" in text


def test_the_caption_says_what_was_measured() -> None:
    (caption,) = re.findall(r"\\caption{(.*)}", latex_tables(results()).partition(r"\label{tab:budget-ideal}")[0])[:1]
    display = "leto-aged (simulated, panel 192 x 256 pixels)"
    numbers = ("means over 6 targets", r"half of the 95\,\% interval", "from wirtinger", "20 comparisons")
    for words in ("PSNR and SSIM in linear light", display, *numbers, "Captures: all that a method took"):
        assert words in caption, words


def test_a_study_without_a_baseline_has_no_differences() -> None:
    text = latex_tables(results(baseline=None))
    assert "Delta" not in text
    assert len(rows(text, "ideal")["hil"]) == 4


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (HOSTILE, r"a\_\allowbreak{}b \& 10\% \$x\$ \textbackslash{}input\{x\}"),
        ("[1] *x", "{[}1{]} {*}x"),
        ("a--b ?`c", "a-{}-b ?{}`c"),
        ("one\ntwo\x07", "one two?"),
        ("~^#<|>", r"\textasciitilde{}\textasciicircum{}\#\textless{}\textbar{}\textgreater{}"),
        ("Gerchberg-Saxton, 50", "Gerchberg-Saxton, 50"),
    ],
)
def test_text_stays_text(text: str, expected: str) -> None:
    assert escape(text) == expected


@pytest.mark.parametrize("name", [HOSTILE, "*[2cm] =1", "\\end{table}%", 'a--b~^#{}"<|>'])
def test_a_hostile_name_leaves_the_structure_as_it_is(name: str) -> None:
    text = latex_tables(named(name))
    plain = latex_tables(named("plain"))
    for mark in (r"\begin", r"\end", r"\\", " & ", "\\caption", "\\label"):
        found, expected = (re.findall(rf"(?<!\\){re.escape(mark)}", each) for each in (text, plain))
        assert len(found) == len(expected)
    (label,) = re.findall(r"\\label{(.*)}", text)
    assert re.fullmatch(r"[A-Za-z0-9.:-]+", label)


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="needs pdflatex with booktabs and siunitx")
def test_the_tables_compile_and_fit_one_column(tmp_path: Path) -> None:
    names = [HOSTILE, "*[2cm] =1", '\\end{table}% a--b~^#{}"<|>', "Wirtinger" * 8]
    tables = [results(), *map(named, names)]
    body = "".join(map(latex_tables, tables))
    preamble = "\\documentclass{article}\\usepackage{booktabs,siunitx}\\setlength{\\textwidth}{84mm}\\raggedbottom"
    (tmp_path / "paper.tex").write_text(f"{preamble}\\begin{{document}}\n{body}\\end{{document}}\n")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "paper.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Overfull" not in done.stdout
    assert (tmp_path / "paper.pdf").stat().st_size > 1000


ROOT = Path(__file__).parents[3]
EXAMPLES = re.findall(
    r"<!-- pandas -->\n```python\n(.*?)```", (ROOT / "docs" / "results" / "data.md").read_text(), re.DOTALL
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The files of the leaderboard, written from its committed records, in the working folder."""
    report = tmp_path / "reports" / "leaderboard"
    report.mkdir(parents=True)
    records = read_records((ROOT / "reports" / "leaderboard" / "records.csv").read_text())
    write_files(Results(records, layout_of(load_study(ROOT / "configs" / "leaderboard.yaml"))), report)
    monkeypatch.chdir(tmp_path)
    return report


def test_the_examples_print_differences_and_tests(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    printed = []
    for example in EXAMPLES:
        assert len([line for line in example.splitlines() if line and not line.startswith("import")]) <= 3
        exec(example, {})
        printed.append(capsys.readouterr().out)
    differences, every = printed
    tests = pd.read_csv(folder / "tests.csv").query("label == 'hil'").set_index("condition")
    assert len(tests) > 1
    for condition, difference in tests["difference_db"].items():
        (value,) = re.findall(rf"^{condition}\s+(\S+)$", differences, re.MULTILINE)
        assert float(value) == pytest.approx(difference, abs=2e-5)
    assert [line.split()[1] for line in every.splitlines() if re.match(r"\d", line)] == tests.index.tolist()
