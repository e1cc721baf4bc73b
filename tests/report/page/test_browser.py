"""The page in a browser: what a reader does with pointer, keys and links, and that nothing is loaded or goes wrong."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.support import synthetic_study as synthetic
from tests.support.axe import serious

from .conftest import HOSTILE, Written
from .reading import Reader


@pytest.fixture
def reader(browser: Any, written: Written) -> Iterator[Reader]:
    page = browser.new_page(viewport={"width": 1000, "height": 800}, reduced_motion="reduce")
    found = Reader(page, written.folder / "report.html")
    yield found.open()
    assert not found.wrong
    page.close()


def test_opening_asks_for_the_file_alone_and_says_nothing_on_the_console(reader: Reader) -> None:
    reader.page.wait_for_timeout(300)
    assert reader.asked == [reader.file.as_uri()]
    assert reader.page.evaluate("() => document.querySelectorAll('img[src=x]').length") == 0


def test_a_name_that_looks_like_markup_is_shown_as_it_is(reader: Reader) -> None:
    assert f"{HOSTILE}, 3 of 4 targets" in reader.methods()


def test_a_heading_sorts_and_says_so(reader: Reader, written: Written) -> None:
    heading = reader.page.locator("#rows > thead button").nth(2)  # after method and letter
    heading.click()
    rows = written.data["rows"]["leto-aged"]
    best = sorted(rows, key=lambda row: -row["cells"]["psnr_linear"]["value"])
    assert reader.methods() == [row["marked"] for row in best]
    assert reader.page.locator("#rows tr.group").count() == 0
    assert heading.locator("..").get_attribute("aria-sort") == "descending"
    heading.click()
    assert reader.methods() == [row["marked"] for row in reversed(best)]
    assert heading.locator("..").get_attribute("aria-sort") == "ascending"


def test_a_filter_leaves_methods_whose_name_or_group_has_its_words(reader: Reader) -> None:
    reader.page.fill("#filter", "calib")
    assert reader.methods() == []
    reader.page.fill("#filter", "double")
    assert reader.methods() == ["Double phase"]
    assert "1 of 6 methods" in reader.page.inner_text("#table-note")


def test_another_display_has_its_own_rows(reader: Reader, written: Written) -> None:
    reader.page.select_option("#display", "ideal")
    first = written.data["rows"]["ideal"][0]["cells"]["psnr_linear"]["text"].split(" ")[0]
    assert first in reader.page.locator("#rows > tbody > tr:not(.group)").first.inner_text()


def test_a_row_opens_to_its_targets_and_leads_to_a_picture(reader: Reader) -> None:
    reader.page.click("#rows button[aria-expanded]:has-text('HIL')")
    assert reader.page.locator("table.targets tbody tr").count() == 4
    reader.page.click("table.targets button[aria-label='look at chelsea']")
    assert reader.page.input_value("#target") == "chelsea"
    assert "HIL" in reader.page.inner_text("#caption-right")
    reader.page.keyboard.press("Escape")
    assert reader.page.locator("table.targets").count() == 0


def test_a_difference_is_drawn_between_the_ends_of_its_interval(reader: Reader) -> None:
    marks = reader.page.locator("#rows span.forest")
    ends = "['zero', 'low', 'mean', 'high'].map(name => parseFloat(one.style.getPropertyValue(`--${name}`)))"
    places = marks.evaluate_all(f"all => all.map(one => {ends})")
    assert len(places) == 4
    assert all(0 <= low <= mean <= high <= 100 for _, low, mean, high in places)
    assert len({zero for zero, *_ in places}) == 1


def test_the_slider_uncovers_the_other_picture_pixel_for_pixel(reader: Reader) -> None:
    reader.page.select_option("#right", "capture:HIL")
    sides = []
    for split in ("100", "0"):
        reader.page.fill("#split", split)
        sides.append(reader.canvas())
    reader.page.fill("#split", "50")
    both, middle = reader.canvas(), sides[0].shape[1] // 2
    assert (sides[0] != sides[1]).any()
    np.testing.assert_array_equal(both[:, 12 : middle - 12], sides[0][:, 12 : middle - 12])
    np.testing.assert_array_equal(both[:, middle + 12 : -12], sides[1][:, middle + 12 : -12])


def test_the_strip_has_the_target_and_the_methods_of_the_filter_and_a_click_compares_one(reader: Reader) -> None:
    reader.page.locator("#strip").scroll_into_view_if_needed()
    tiles = reader.page.locator("#strip button")
    tiles.first.wait_for()
    assert tiles.count() == 7
    reader.page.click("#strip button:has-text('Double phase')")
    assert reader.page.input_value("#right") == "capture:Double phase"
    assert reader.page.locator("#strip button[aria-pressed=true]").count() == 1
    reader.page.fill("#filter", "double")
    assert tiles.count() == 2


def test_arrow_keys_move_the_slider(reader: Reader) -> None:
    reader.page.focus("#panes")
    reader.page.keyboard.press("ArrowRight")
    assert reader.page.input_value("#split") == "52"
    reader.page.focus("#split")
    reader.page.keyboard.press("ArrowLeft")
    assert reader.page.input_value("#split") == "51"


def test_a_zoomed_picture_shows_stored_pixels_as_squares(reader: Reader) -> None:
    reader.page.select_option("#mode", "side")
    reader.page.focus("#panes")
    for _ in range(3):
        reader.page.keyboard.press("+")
    half = reader.canvas().shape[1] // 2
    left = reader.canvas()[:, : half - 2, :3].astype(int)
    changes = (np.abs(np.diff(left, axis=1)).sum(axis=(0, 2)) > 0).nonzero()[0]
    assert np.diff(changes).min() > 20  # edges of pixels are far apart, with nothing blended between them
    reader.page.keyboard.press("0")
    assert "zoom" not in reader.view()


def test_an_error_map_of_the_target_s_own_capture_differs_with_values_and_colour(reader: Reader) -> None:
    reader.page.select_option("#mode", "side")
    reader.page.select_option("#right", "error:Wirtinger")
    seen = set()
    for key, value in (("#values", "srgb"), ("#values", "linear"), ("#channel", "0"), ("#scale", "1")):
        reader.page.select_option(key, value)
        reader.page.wait_for_timeout(100)
        seen.add(reader.canvas().tobytes())
    assert len(seen) == 4
    assert "linear light" in reader.page.inner_text("#error-note")


def test_the_map_of_flip_has_the_mean_of_its_authors_code(reader: Reader, written: Written) -> None:
    import torch
    from skimage.io import imread

    from holobench_eval.core.hashing import digest
    from holobench_eval.metrics.flip import flip
    from holobench_eval.study.store import Store

    store = Store(written.folder)
    for label, name in (("Wirtinger", "wirtinger"), ("Double phase", "double_phase")):
        reader.page.select_option("#right", f"flip:{label}")
        reader.page.wait_for_function(
            "label => document.getElementById('caption-right').textContent.startsWith(`FLIP of ${label}`)", arg=label
        )
        capture = store.thumbnail(digest(synthetic.cell(name, "astronaut", "leto-aged")))
        pictures = (
            torch.tensor(imread(path)).permute(2, 0, 1) / 255 for path in (capture, store.target_thumbnail("astronaut"))
        )
        shown = float(reader.page.inner_text("#caption-right").rpartition(" ")[2])
        assert shown == pytest.approx(float(flip(*pictures)), abs=0.001)


def test_pointing_at_a_pixel_tells_the_stored_levels(reader: Reader, written: Written) -> None:
    from skimage.io import imread

    from holobench_eval.study.store import Store

    box = reader.page.locator("#panes").bounding_box()
    reader.page.locator("#panes").hover(position={"x": box["width"] / 2 + 1, "y": box["height"] / 4 + 1})
    levels = ", ".join(map(str, imread(Store(written.folder).target_thumbnail("astronaut"))[12, 24]))
    assert f"Column 24, row 12: Target {levels};" in reader.page.inner_text("#pixel")


def test_a_link_leads_to_the_same_view(reader: Reader) -> None:
    page = reader.page
    page.select_option("#display", "ideal")
    page.fill("#filter", "i")
    page.locator("#rows > thead button").nth(1).click()
    page.select_option("#target", "coffee")
    page.select_option("#right", "error:HIL")
    page.select_option("#mode", "side")
    page.select_option("#values", "linear")
    page.click("#closer")
    view, methods = reader.view(), reader.methods()
    shown = page.evaluate("() => document.getElementById('panes').getAttribute('aria-label')")
    before = reader.canvas()
    reader.open(view)
    page.wait_for_timeout(300)
    assert reader.methods() == methods
    assert page.evaluate("() => document.getElementById('panes').getAttribute('aria-label')") == shown
    np.testing.assert_array_equal(reader.canvas(), before)


def test_a_link_with_names_that_do_not_exist_shows_the_start(reader: Reader) -> None:
    start = reader.methods()
    reader.open("#display=%3Cscript%3Ealert(1)%3C/script%3E&sort=none&target=nobody&split=x&right=capture:nobody")
    assert reader.methods() == start


def test_a_link_within_the_page_keeps_the_view(reader: Reader) -> None:
    reader.page.select_option("#display", "ideal")
    reader.page.click("nav a[href='#viewer']")
    assert "display=ideal" in reader.view()


def test_every_control_is_reached_by_tab_and_has_a_name(reader: Reader) -> None:
    reader.page.focus("a.skip")
    reached, last = set(), ""
    for _ in range(150):
        reader.page.keyboard.press("Tab")
        last = reader.page.evaluate("() => document.activeElement.id || document.activeElement.textContent")
        reached.add(last)
    wanted = {"display", "filter", "target", "left", "right", "mode", "panes", "split", "enlarge"}
    assert wanted <= reached


def test_the_pictures_take_the_whole_screen_and_give_it_back(reader: Reader) -> None:
    for expected in ("stage", None):
        reader.page.click("#enlarge")
        reader.page.wait_for_function("id => (document.fullscreenElement?.id ?? null) === id", arg=expected)


def test_in_alternation_one_side_is_seen_at_a_time_with_its_caption(browser: Any, written: Written) -> None:
    page = browser.new_page(viewport={"width": 1000, "height": 800})
    reader = Reader(page, written.folder / "report.html").open("#mode=flicker&right=capture%3AHIL")
    hidden = """time => {
        document.getAnimations().forEach(one => { one.pause(); one.currentTime = time; });
        const parts = ['.pane:last-child', '#caption-left', '#caption-right'];
        return parts.map(part => getComputedStyle(document.querySelector(part)).visibility);
    }"""
    assert page.evaluate(hidden, 100) == ["visible", "hidden", "visible"]
    assert page.evaluate(hidden, 700) == ["hidden", "visible", "hidden"]
    assert not reader.wrong
    page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 400])
def test_axe_finds_nothing_serious_and_nothing_is_wider_than_the_window(
    browser: Any, written: Written, scheme: str, width: int
) -> None:
    page = browser.new_page(viewport={"width": width, "height": 800}, color_scheme=scheme, reduced_motion="reduce")
    reader = Reader(page, written.folder / "report.html").open("#open=HIL&right=error%3AHIL")
    assert serious(page) == []
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert not reader.wrong
    page.close()


def test_a_picture_without_words_would_be_found(browser: Any) -> None:
    page = browser.new_page()
    page.set_content("<html lang=en><title>x</title><main><h1>x</h1><img src='data:,'></main>")
    assert [name for name, _ in serious(page)] == ["image-alt"]
    page.close()
