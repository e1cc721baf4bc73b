"""Figures as they are drawn: differences in pairs, costs, sheets of stages, tiles of pictures."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image

from holobench_eval.report import Results, records_frame
from holobench_eval.report.board import board
from holobench_eval.report.charts import curves, look, paired, sheet, tiles
from holobench_eval.report.charts.look import LARGEST, MEDIA, REGISTRY, drawn_for, save, save_picture, slugs
from holobench_eval.report.charts.sheet import draw_sheet, drawn_from, save_sheet
from tests.support import budget_study as budget
from tests.support import synthetic_study as synthetic


@pytest.fixture(scope="module")
def found():
    return budget.results()


@pytest.fixture
def drawn(monkeypatch):
    """The figures that are written."""
    figures = []

    def noted(figure, path):
        figures.append(figure)
        save(figure, path)

    monkeypatch.setattr(look, "save", noted)
    return figures


def names(axes):
    return [label.get_text() for label in axes.get_yticklabels()]


def marks(axes):
    """The mark of every row, from above to below: a line of one point, without those of the interval's ends."""
    return [line for line in axes.lines if len(line.get_xdata()) == 1 and line.get_zorder() == 5]


def test_every_method_has_a_row_with_its_mark_number_and_dots_and_the_best_stands_first(found, drawn, tmp_path):
    paired.draw(found, "leto-aged", tmp_path / "x.png")
    axes = drawn[0].axes[0]
    gains = {name: found.gain(name, "leto-aged").mean for name in budget.ROWS if name != "wirtinger"}
    assert names(axes)[0] == "oracle"
    assert [name.partition(",")[0].replace("\n", " ") for name in names(axes)] == sorted(gains, key=gains.get)[::-1]
    assert [float(line.get_xdata()[0]) for line in marks(axes)] == pytest.approx(sorted(gains.values())[::-1])
    row = names(axes).index("hil")
    assert (marks(axes)[row].get_markeredgecolor(), marks(axes)[row].get_marker()) == REGISTRY["hil"]
    assert axes.texts[row].get_text() == found.headline.estimate(found.gain("hil", "leto-aged"), signed=True)
    # a dot is the difference of one target, at the same height in every row
    dots = [collection.get_offsets() for collection in axes.collections]
    dots = [offsets for offsets in dots if len(offsets) == len(budget.TARGETS)]
    assert len(dots) == len(budget.ROWS) - 1
    expected = found.values("oracle", "leto-aged") - found.values("wirtinger", "leto-aged")
    assert np.asarray(dots[0][:, 0]) == pytest.approx(expected)
    assert np.asarray(dots[1][:, 1] - 1) == pytest.approx(np.asarray(dots[0][:, 1]))


def test_the_line_at_zero_is_the_baseline_and_a_constant_image_has_one(found, tmp_path, monkeypatch, drawn):
    monkeypatch.setattr(Results, "floor", lambda self, _, less: (self.values("oracle", "leto-aged") - less).mean())
    paired.draw(found, "leto-aged", tmp_path / "x.png")
    handles, labels = drawn[0].axes[0].get_legend_handles_labels()
    places = [float(line.get_xdata()[0]) for line in handles]
    assert places == pytest.approx([0, found.gain("oracle", "leto-aged").mean])
    assert labels[0] == "baseline: wirtinger"
    assert "constant image, +" in labels[1]


def test_a_hole_is_counted_in_the_name_of_its_row(drawn, tmp_path):
    records = budget.study()
    lost = next(i for i, record in enumerate(records) if record["label"] == "hil")
    records[lost] = records[lost] | {"state": "failed", "scores": {}}
    facts = budget.facts()
    paired.draw(Results(records_frame(records, facts), facts), "leto-aged", tmp_path / "x.png")
    assert f"hil, {len(budget.TARGETS) - 1} of {len(budget.TARGETS)} targets" in names(drawn[0].axes[0])


def test_without_a_baseline_nothing_is_drawn():
    assert not paired.displays(budget.results(baseline=None))


def test_a_name_full_of_mathematics_stays_text(tmp_path):
    evil = r"$\frac{a}{0}$ <b>"
    records = [
        synthetic.record(label, synthetic.cell(name, target, "leto-aged"), {"psnr_linear": value})
        for label, name, value in ((evil, "mine.py:Evil", 20.0), ("Wirtinger", "wirtinger", 19.0))
        for target in ("coffee", "rocket")
    ]
    paired.draw(synthetic.results(records), "leto-aged", tmp_path / "x.png")
    assert (tmp_path / "x.png").stat().st_size > 2000


def test_every_row_but_the_oracle_has_a_mark_a_name_and_its_place(found, drawn, tmp_path):
    displays = board(found).displays
    curves.draw_costs(tmp_path / "x.png", displays, found.names, look.looks(found.names), "PSNR [dB]")
    for axes, display in zip(drawn[0].axes, displays, strict=True):
        rows = [row for row in display.rows if row.label not in found.facts.oracles]
        assert {text.get_text() for text in axes.get_legend().get_texts()} == {row.label for row in rows}
        places = {(line.get_xdata()[0], line.get_ydata()[0]) for line in axes.lines if len(line.get_xdata()) == 1}
        assert {(row.photographs, row.score.mean) for row in rows} <= places


@pytest.mark.parametrize(
    ("name", "ramp", "zero_order"),
    [
        ("leto-aged", "a test ramp, 0.11 cycles / px (no blaze here)", "zero order + dead area: 30 %, pass the iris"),
        ("leto-2020", "the blaze, 0.25 cycles / px", "zero order + dead area: 19 %, stopped by the iris"),
        ("ideal", "a test ramp, 0.11 cycles / px (no blaze here)", "light in the iris plane: no zero order"),
    ],
)
def test_a_sheet_shows_blaze_and_zero_order_and_no_part_is_blank(tmp_path, monkeypatch, name, ramp, zero_order):
    drawn = []
    if name != "leto-2020":  # one is drawn as large as all
        monkeypatch.setattr(sheet, "DPI", sheet.DPI // 2)
    monkeypatch.setattr(plt, "close", drawn.append)
    path = draw_sheet(name, (128, 128), tmp_path / "deep" / "sheet.png")
    titles = [axes.get_title() for axes in drawn[0].axes]
    assert ramp in titles
    assert zero_order in titles
    lines = drawn[0].axes[titles.index(ramp)].lines
    assert {line.get_drawstyle() for line in lines} == {"steps-mid"}  # a pixel is flat, not a part of a slope
    picture = np.asarray(Image.open(path).convert("L"), dtype=float)
    assert picture.shape[0] == pytest.approx(13 * sheet.DPI, abs=2)
    assert path.stat().st_size <= 200_000
    below = picture[len(picture) // 12 :]
    cells = [part for row in np.array_split(below, 4) for part in np.array_split(row, 5, axis=1)]
    assert min(cell.std() for cell in cells) > 10


def test_a_sheet_says_what_it_was_drawn_from(tmp_path, monkeypatch):
    monkeypatch.setattr(sheet, "_Sheet", lambda *_: type("Empty", (), {"draw": lambda self: None})())
    profile = type("Profile", (), {"name": "x", "version": 1, "description": "a bench"})
    workbench = type("Workbench", (), {"bench": type("Bench", (), {"profile": profile})})
    assert drawn_from(save_sheet(workbench, "note", tmp_path / "sheet.png", "its source")) == "its source"


def noise(size, seed=0):
    return np.random.default_rng(seed).integers(0, 256, size=(size, size, 3)) / 255


def test_the_enlarged_window_is_the_most_detailed_one():
    target = np.full((64, 64, 3), 0.5)
    target[40:45, 8:13] = noise(5)
    rows, columns = tiles.most_detailed(target)
    assert (rows.stop - rows.start, columns.stop - columns.start) == (7, 7)
    assert 38 <= rows.start <= 40
    assert 6 <= columns.start <= 8
    even = tiles.most_detailed(np.full((32, 48, 3), 0.2))
    assert [side.start for side in even] == [0, 0]  # of equally detailed windows, the first


def test_a_page_of_speckle_keeps_colours_at_full_resolution_and_stays_small(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, size=(500, 500, 3), dtype=np.uint8)
    save_picture(pixels, tmp_path / "page.jpg")
    assert (tmp_path / "page.jpg").stat().st_size <= LARGEST
    with Image.open(tmp_path / "page.jpg") as picture:
        assert {layer[1:3] for layer in picture.layer} == {(1, 1)}


def test_captures_are_in_the_figure_pixel_by_pixel_and_an_absent_one_is_a_note(tmp_path):
    target, capture = noise(200), noise(200, seed=1)
    shown = (
        ("method", tiles.Tile(capture, "PSNR 7.00 dB")),
        ("lost", tiles.Tile(None, "failed: the residual is too large $x$")),
    )
    tiles.draw_rows(tmp_path / "page.png", "bench", ("noise", target), [("", shown)])
    page = tiles.load_picture(tmp_path / "page.png")
    first, second = (page[tiles.HEADER : tiles.HEADER + 200, tiles.SIDE + place * 208 :][:, :200] for place in (1, 2))
    assert np.abs(first - capture).max() < 1 / 255
    assert 0.85 < np.median(second) < 0.95
    assert second.min() < 0.3


def test_gray_thumbnails_are_read_as_colour_and_damaged_ones_are_as_absent(tmp_path):
    synthetic.save_picture(tmp_path / "gray.png", np.full((8, 8), 0.5))
    assert tiles.load_picture(tmp_path / "gray.png").shape == (8, 8, 3)
    assert tiles.load_picture(tmp_path / "absent.png") is None
    for content in (b"", b"\x89", b"\x89PNG\r\n\x1a\n" + bytes(40)):
        (tmp_path / "damaged.png").write_bytes(content)
        assert tiles.load_picture(tmp_path / "damaged.png") is None


def test_displays_keep_figures_of_their_own_whatever_they_are_called():
    stems = slugs(["a/b", "a-b", "../../x", "***"])
    assert len(set(stems.values())) == 4
    assert all("/" not in stem and not stem.startswith(".") for stem in stems.values())


def test_the_window_is_drawn_at_four_times_the_scale_with_its_own_error_beside(tmp_path):
    target, capture = noise(207), noise(207, seed=1)
    tiles.draw_comparison(tmp_path / "page.png", "bench", target, [("method", "x", capture)])
    page, window = tiles.load_picture(tmp_path / "page.png"), tiles.most_detailed(target)
    scale = tiles.error_limit([tiles.error_map(capture, target)])
    left, top, side = tiles.SIDE + 207 + 8, tiles.HEADER + 207 + 20, 4 * 23
    enlarged = capture[window].repeat(4, axis=0).repeat(4, axis=1)
    assert np.abs(page[top : top + side, left : left + side] - enlarged).max() < 1 / 255
    drawn = page[top : top + side, left + 207 - side : left + 207]
    colours = colormaps["magma"](np.minimum(tiles.error_map(capture[window], target[window]) / scale, 1))[..., :3]
    assert np.abs(drawn - colours.repeat(4, axis=0).repeat(4, axis=1)).max() < 2 / 255


def test_a_column_has_names_above_the_dots_and_the_plot_its_width(found, drawn, tmp_path):
    with drawn_for(MEDIA["column"]):
        paired.draw(found, "leto-aged", tmp_path / "paired.png")
        curves.draw_costs(
            tmp_path / "costs.png", board(found).displays[:1], found.names, look.looks(found.names), "PSNR [dB]"
        )
    for figure in drawn:
        assert figure.axes[0].get_position().width > 0.8
    assert "hil" in {text.get_text() for text in drawn[0].axes[0].texts}


def test_a_slide_names_methods_above_and_scores_below_their_captures(drawn, tmp_path):
    row = [("a_method_with_a_long_name", tiles.Tile(noise(64), "PSNR 7.00 dB")), ("lost", tiles.Tile(None, "failed"))]
    rows = {"first": (noise(64), row), "second": (noise(64), row)}
    with drawn_for(MEDIA["talk"]):
        tiles.draw_wall(tmp_path / "slide.png", "A question?", "bench", rows)
    assert tiles.load_picture(tmp_path / "slide.png").shape == (720, 1280, 3)
    above = [axes.get_title().replace("\n", "") for axes in drawn[0].axes]
    assert above == ["target", "a_method_with_a_long_name", "lost", "", "", ""]
    below = [axes.get_xlabel() for axes in drawn[0].axes]
    assert below == ["first", "PSNR 7.00 dB", "failed", "second", "PSNR 7.00 dB", "failed"]
