import numpy as np
from PIL import Image

from holobench_eval.report.charts.sheet import draw_sheet


def test_the_sheet_of_a_bench_is_drawn_and_not_blank(tmp_path):
    path = draw_sheet("plm-4bit", (128, 128), tmp_path / "deep" / "sheet.png")
    picture = np.asarray(Image.open(path).convert("L"), dtype=float)
    assert picture.shape[0] > 1000
    cells = [part for row in np.array_split(picture[90:], 3) for part in np.array_split(row, 6, axis=1)]
    assert all(cell.std() > 10 for cell in cells)
