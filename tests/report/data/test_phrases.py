"""Sentences of reports about what methods were seen to do."""

from __future__ import annotations

from typing import Any

from holobench_eval.report.data.phrases import uncovered


def record(label: str, *files: str) -> dict[str, Any]:
    return {"label": label, "uncovered": list(files)}


def test_files_that_no_cell_is_named_after_are_told_once_and_installed_ones_are_not() -> None:
    library = "/usr/lib/python3.11/site-packages/scipy/io/wavfile.py"
    records = [
        record("mine", "/data/k.json", library),
        record("mine", "/data/k.json"),
        record("other", library),
        {"label": "x"},
    ]
    text = uncovered(records)
    assert text.startswith("Not covered: mine reads /data/k.json: a change there is not noticed")
    assert "scipy" not in text
    assert uncovered(records[2:]) == ""


def test_a_name_that_a_terminal_would_obey_is_made_harmless() -> None:
    assert "\x1b" not in uncovered([record("mine", "/data/\x1b[2J.json")])
