"""What a study leaves on the terminal: tables that fit it, and why cells have no score."""

import codecs
import io
from typing import Any

import pytest
from rich.console import Console
from rich.table import Table
from rich.text import Text

from holobench_eval.commands import _plain
from holobench_eval.commands.output import MOST_REASONS, console, print_answer, print_headline, print_holes
from holobench_eval.report import Results, records_frame
from holobench_eval.report.stories import answer
from tests.support.synthetic_study import cell, facts, record, study

LONG = "a method whose label is as long as a label may ever be, sixty"


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    return study(tmp_path_factory.mktemp("study"), size=24)


def found(records: list[dict[str, Any]], **changes: Any) -> Results:
    shape = facts(**changes)
    return Results(records_frame(records, shape), shape)


def printed(results: Results, encoding: str = "utf-8", width: int = 80) -> list[str]:
    codecs.register_error("plain", _plain)
    file = io.TextIOWrapper(io.BytesIO(), encoding=encoding, errors="plain")
    console = Console(file=file, width=width)
    print_headline(console, results)
    print_holes(console, results)
    file.seek(0)
    return file.read().splitlines()


@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_tables_fit_a_terminal_of_80_columns_and_show_every_number(records, encoding):
    renamed = [{**one, "label": LONG if one["label"] == "HIL" else one["label"]} for one in records]
    pairs = tuple((LONG if label == "HIL" else label, name) for label, name in facts().pairs)
    results = found(renamed, pairs=pairs, camera=frozenset({LONG}), reported={})
    lines = printed(results, encoding)
    assert max(map(len, lines)) <= 80
    text = "\n".join(lines)
    assert not {"…", "?"} & {*text}
    for condition in results.conditions:
        assert f"{condition}: PSNR, linear light [dB]" in text
        for name in results.methods(condition):
            assert results.headline.number(results.rows[name, condition][results.headline.column]) in text


def test_the_answer_of_the_report_stands_below_the_tables(records):
    results, file = found(records), io.StringIO()
    print_answer(Console(file=file, width=80), results)
    assert " ".join(file.getvalue().split()) == " ".join(f"- {line}" for line in answer(results))


def test_methods_stand_in_their_groups_with_letter_photographs_or_the_targets_that_they_have(records):
    lines = printed(found(records, camera=frozenset({"HIL"})))
    text = "\n".join(lines)
    order = ["With photographs", "HIL", "No camera", "GS, 5", "Knows the display:", "Oracle"]
    places = [text.index(f" {name} ") for name in order]
    assert places == sorted(places)
    hil, hole = (next(line for line in lines if name in line).strip("│ ") for name in ("HIL", "GS"))
    assert " A " in f" {hil}"
    assert hil.endswith("300")  # photographs of six targets
    assert hole.startswith("GS, 5 of 6 targets")  # and no letter


def hole(target: str, reason: str, state: str = "failed") -> dict[str, Any]:
    return record("SGD", cell("sgd", target, "ideal"), {}, state=state, reason=reason)


def test_reasons_of_holes_are_grouped_and_counted(records):
    text = " ".join(" ".join(printed(found(records))).split())
    assert f"without a score: 1 of {len(records)} cells 1 failed (GS on leto-aged): registration" in text
    states = enumerate(["failed", "failed", "unavailable"])
    holes = [hole(f"target {number}", f"{number} values are NaN", state) for number, state in states]
    text = " ".join(" ".join(printed(found([*records, *holes]), width=160)).split())
    assert "2 failed (SGD on ideal): 0 values are NaN 1 unavailable (SGD on ideal): 2 values are NaN" in text


def test_many_reasons_are_cut_and_a_study_without_holes_has_no_such_line(records):
    done = [one for one in records if one["state"] == "done"]
    assert not any("without a score" in line for line in printed(found(done)))
    holes = [hole(f"target {letter}", f"reason {letter}") for letter in "abcdefghijklmnopqrstuvwxyz"]
    assert printed(found([*done, *holes]))[-1] == f"  and {26 - MOST_REASONS} more reasons, in details.md"


def test_no_text_can_control_the_terminal(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "60")
    table = Table("label\x1b[2J", title="a title\x1b]0;x\x07")
    table.add_row("row\x9b1m", style="bold")
    for printed in (table, "two\nlines\x1b[1A", Text("text\u202e")):
        console().print(printed, markup=False, highlight=False)
    shown = capsys.readouterr().out
    assert shown.replace("\n", "").isprintable()
    for text in ("label?[2", "a title?]0;x", "row?1m", "two\nlines?[1A", "text?"):
        assert text in shown
