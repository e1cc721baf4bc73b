import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from holobench_eval.report.charts.sheet import draw_sheet, drawn_from, save_sheet


@pytest.mark.parametrize(
    ("name", "ramp", "zero_order"),
    [
        ("leto-aged", "a test ramp, 0.11 cycles / px (no blaze here)", "zero order + dead area: 30 %, pass the iris"),
        ("leto-2020", "the blaze, 0.25 cycles / px", "zero order + dead area: 19 %, stopped by the iris"),
        ("ideal", "a test ramp, 0.11 cycles / px (no blaze here)", "light in the iris plane: no zero order"),
    ],
)
def test_a_sheet_shows_the_blaze_and_the_zero_order_that_the_bench_has_and_no_part_is_blank(
    tmp_path, monkeypatch, name, ramp, zero_order
):
    drawn = []
    monkeypatch.setattr(plt, "close", drawn.append)
    path = draw_sheet(name, (128, 128), tmp_path / "deep" / "sheet.png")
    titles = [axes.get_title() for axes in drawn[0].axes]
    assert ramp in titles
    assert zero_order in titles
    lines = drawn[0].axes[titles.index(ramp)].lines
    assert {line.get_drawstyle() for line in lines} == {"steps-mid"}  # a pixel is flat, not a part of a slope
    picture = np.asarray(Image.open(path).convert("L"), dtype=float)
    assert picture.shape[0] > 900
    assert path.stat().st_size <= 200_000
    cells = [part for row in np.array_split(picture[90:], 4) for part in np.array_split(row, 5, axis=1)]
    assert min(cell.std() for cell in cells) > 10


def test_a_sheet_says_what_it_was_drawn_from(tmp_path, monkeypatch):
    for part in ("_panel_stages", "_field_stages", "_chart", "_effects"):
        monkeypatch.setattr(f"holobench_eval.report.charts.sheet.{part}", lambda *_: None)
    profile = type("Profile", (), {"name": "x", "version": 1, "description": "a bench"})
    workbench = type("Workbench", (), {"bench": type("Bench", (), {"profile": profile})})
    assert drawn_from(save_sheet(workbench, "note", tmp_path / "sheet.png", "its source")) == "its source"
