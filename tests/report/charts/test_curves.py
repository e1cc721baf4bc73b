"""Quality against photographs: every row is drawn where it stands, with its name beside the panel."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.figure import Figure
from skimage.io import imread

from holobench_eval.report.charts import curves
from holobench_eval.report.charts.look.methods import looks
from holobench_eval.report.charts.style import save
from holobench_eval.report.data.board import board
from tests.support import budget_study as budget


def test_every_row_but_the_oracle_has_a_mark_a_name_and_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = budget.results()
    figures: list[Figure] = []
    displays = board(found).displays

    def noted(figure: Figure, path: Path) -> None:
        figures.append(figure)
        save(figure, path)

    monkeypatch.setattr(curves, "save", noted)
    curves.draw_costs(tmp_path / "x.png", displays, found.names, looks(found.names), "PSNR [dB]")
    assert imread(tmp_path / "x.png").shape[1] == 900  # as wide as any other
    for axes, display in zip(figures[0].axes, displays, strict=True):
        rows = [row for row in display.rows if row.label not in found.layout.privileged]
        legend = axes.get_legend()
        assert legend is not None
        assert {text.get_text() for text in legend.get_texts()} == {row.label for row in rows}
        marks = {(line.get_xdata()[0], line.get_ydata()[0]) for line in axes.lines if len(line.get_xdata()) == 1}
        assert {(row.photographs, row.score.mean) for row in rows} <= marks
