import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image

from holobench_eval.report.charts import tiles
from holobench_eval.report.charts.style import LARGEST, save_picture, slugs
from holobench_eval.report.charts.tiles import (
    HEADER,
    SIDE,
    Tile,
    draw_comparison,
    draw_rows,
    error_limit,
    load_picture,
    most_detailed,
    tile_size,
)
from tests.support import synthetic_study as synthetic


def noise(size, seed=0):
    return np.random.default_rng(seed).integers(0, 256, size=(size, size, 3)) / 255


def test_the_enlarged_window_is_the_most_detailed_one():
    target = np.full((64, 64, 3), 0.5)
    target[40:45, 8:13] = noise(5)
    rows, columns = most_detailed(target)
    assert (rows.stop - rows.start, columns.stop - columns.start) == (7, 7)
    assert 38 <= rows.start <= 40
    assert 6 <= columns.start <= 8
    even = most_detailed(np.full((32, 48, 3), 0.2))
    assert [side.start for side in even] == [0, 0]  # of equally detailed windows, the first


def test_a_page_of_speckle_keeps_colours_at_full_resolution_and_stays_small(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, size=(500, 500, 3), dtype=np.uint8)
    save_picture(pixels, tmp_path / "page.jpg")
    assert (tmp_path / "page.jpg").stat().st_size <= LARGEST
    with Image.open(tmp_path / "page.jpg") as picture:
        assert {layer[1:3] for layer in picture.layer} == {(1, 1)}


def test_targets_of_a_large_study_are_spread_from_first_to_last():
    assert tiles.spread([str(n) for n in range(21)], 5) == ["0", "5", "10", "15", "20"]


def test_captures_are_in_the_figure_pixel_by_pixel_and_an_absent_one_is_a_note(tmp_path):
    target, capture = noise(200), noise(200, seed=1)
    tiles = (("method", Tile(capture, "PSNR 7.00 dB")), ("lost", Tile(None, "failed: the residual is too large $x$")))
    draw_rows(tmp_path / "page.png", "bench", ("noise", target), [("", tiles)])
    page = load_picture(tmp_path / "page.png")
    first, second = (page[HEADER : HEADER + 200, SIDE + place * 208 :][:, :200] for place in (1, 2))
    assert np.abs(first - capture).max() < 1 / 255
    assert 0.85 < np.median(second) < 0.95
    assert second.min() < 0.3


def test_small_captures_are_enlarged_by_a_whole_factor():
    assert tile_size((64, 64, 3)) == (192, 192)
    assert tile_size((150, 100)) == (300, 200)
    assert tile_size((300, 400)) == (300, 400)


def test_gray_thumbnails_are_read_as_colour_and_damaged_ones_are_as_absent(tmp_path):
    synthetic.save_picture(tmp_path / "gray.png", np.full((8, 8), 0.5))
    assert load_picture(tmp_path / "gray.png").shape == (8, 8, 3)
    assert load_picture(tmp_path / "absent.png") is None
    for content in (b"", b"\x89", b"\x89PNG\r\n\x1a\n" + bytes(40)):
        (tmp_path / "damaged.png").write_bytes(content)
        assert load_picture(tmp_path / "damaged.png") is None


def test_displays_keep_figures_of_their_own_whatever_they_are_called():
    stems = slugs(["a/b", "a-b", "../../x", "***"])
    assert len(set(stems.values())) == 4
    assert all("/" not in stem and not stem.startswith(".") for stem in stems.values())


def test_the_window_is_drawn_at_four_times_the_scale_with_its_own_error_beside(tmp_path):
    target, capture = noise(207), noise(207, seed=1)
    draw_comparison(tmp_path / "page.png", "bench", target, [("method", "x", capture)])
    page, window = load_picture(tmp_path / "page.png"), most_detailed(target)
    scale = error_limit([tiles.error_map(capture, target)])
    left, top, side = SIDE + 207 + 8, HEADER + 207 + 20, 4 * 23
    enlarged = capture[window].repeat(4, axis=0).repeat(4, axis=1)
    assert np.abs(page[top : top + side, left : left + side] - enlarged).max() < 1 / 255
    drawn = page[top : top + side, left + 207 - side : left + 207]
    colours = colormaps["magma"](np.minimum(tiles.error_map(capture[window], target[window]) / scale, 1))[..., :3]
    assert np.abs(drawn - colours.repeat(4, axis=0).repeat(4, axis=1)).max() < 2 / 255


def test_the_error_scale_is_a_round_number_above_most_errors():
    assert error_limit([np.full((4, 4), 0.23)]) == pytest.approx(0.3)
    assert error_limit([np.zeros((4, 4))]) == pytest.approx(0.1)
    assert error_limit([np.ones((4, 4))]) == 1.0
