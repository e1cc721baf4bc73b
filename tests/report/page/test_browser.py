"""The page in a browser: what a reader does with pointer, keys and links, and that nothing is loaded or goes wrong."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import torch
from skimage.io import imread

from holobench_eval.core.hashing import digest
from holobench_eval.metrics.flip import flip
from holobench_eval.study.store import Store
from tests.support import synthetic_study as synthetic
from tests.support.axe import serious

from .conftest import HOSTILE, Written
from .reading import ReportReader, reading


def reader_of(browser: Any, written: Written, **given: Any) -> ReportReader:
    return ReportReader(browser.new_page(**given), (written.folder / "report.html").as_uri())


@pytest.fixture
def reader(browser: Any, written: Written) -> Iterator[ReportReader]:
    found = reader_of(browser, written, viewport={"width": 1000, "height": 800}, reduced_motion="reduce")
    with reading(found):
        yield found


def test_opening_asks_for_the_file_alone_and_shows_markup_in_names_as_text(reader: ReportReader) -> None:
    reader.page.wait_for_timeout(300)
    assert reader.asked == [reader.address]
    assert reader.page.evaluate("() => document.querySelectorAll('img[src=x]').length") == 0
    assert f"{HOSTILE}, 3 of 4 targets" in reader.methods()


def test_a_heading_sorts_and_says_so(reader: ReportReader, written: Written) -> None:
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


def test_rows_have_intervals_and_follow_the_filter_and_the_display(reader: ReportReader, written: Written) -> None:
    marks = reader.page.locator("#rows span.forest")
    ends = "['zero', 'low', 'mean', 'high'].map(name => parseFloat(one.style.getPropertyValue(`--${name}`)))"
    places = marks.evaluate_all(f"all => all.map(one => {ends})")
    assert len(places) == 4
    assert all(0 <= low <= mean <= high <= 100 for _, low, mean, high in places)
    assert len({zero for zero, *_ in places}) == 1
    reader.page.fill("#filter", "calib")
    assert reader.methods() == []
    reader.page.fill("#filter", "double")
    assert reader.methods() == ["Double phase"]
    assert "1 of 6 methods" in reader.page.inner_text("#table-note")
    reader.page.fill("#filter", "")
    reader.page.select_option("#display", "ideal")
    first = written.data["rows"]["ideal"][0]["cells"]["psnr_linear"]["text"].split(" ")[0]
    assert first in reader.page.locator("#rows > tbody > tr:not(.group)").first.inner_text()


def test_a_row_opens_to_its_targets_and_leads_to_a_picture(reader: ReportReader) -> None:
    reader.page.click("#rows button[aria-expanded]:has-text('HIL')")
    assert reader.page.locator("table.targets tbody tr").count() == 4
    reader.page.click("table.targets button[aria-label='look at chelsea']")
    assert reader.page.input_value("#target") == "chelsea"
    assert "HIL" in reader.page.inner_text("#caption-right")
    reader.page.keyboard.press("Escape")
    assert reader.page.locator("table.targets").count() == 0


def test_the_slider_uncovers_the_other_picture_pixel_for_pixel_and_obeys_arrow_keys(reader: ReportReader) -> None:
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
    for element, key, value in (("#panes", "ArrowRight", "52"), ("#split", "ArrowLeft", "51")):
        reader.page.focus(element)
        reader.page.keyboard.press(key)
        assert reader.page.input_value("#split") == value


def test_the_strip_has_the_target_and_the_methods_of_the_filter_and_a_click_compares_one(reader: ReportReader) -> None:
    reader.page.locator("#strip").scroll_into_view_if_needed()
    tiles = reader.page.locator("#strip button")
    tiles.first.wait_for()
    assert tiles.count() == 7
    reader.page.click("#strip button:has-text('Double phase')")
    assert reader.page.input_value("#right") == "capture:Double phase"
    assert reader.page.locator("#strip button[aria-pressed=true]").count() == 1
    reader.page.fill("#filter", "double")
    assert tiles.count() == 2


def test_a_zoomed_picture_shows_stored_pixels_as_squares(reader: ReportReader) -> None:
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


def test_an_error_map_of_the_target_s_own_capture_differs_with_values_and_colour(reader: ReportReader) -> None:
    reader.page.select_option("#mode", "side")
    reader.page.select_option("#right", "error:Wirtinger")
    seen = set()
    for key, value in (("#values", "srgb"), ("#values", "linear"), ("#channel", "0"), ("#scale", "1")):
        reader.page.select_option(key, value)
        reader.page.wait_for_timeout(100)
        seen.add(reader.canvas().tobytes())
    assert len(seen) == 4
    assert "linear light" in reader.page.inner_text("#error-note")


def test_the_map_of_flip_has_the_mean_of_its_authors_code(reader: ReportReader, written: Written) -> None:
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


def test_pointing_at_a_pixel_tells_the_stored_levels(reader: ReportReader, written: Written) -> None:
    box = reader.page.locator("#panes").bounding_box()
    reader.page.locator("#panes").hover(position={"x": box["width"] / 2 + 1, "y": box["height"] / 4 + 1})
    levels = ", ".join(map(str, imread(Store(written.folder).target_thumbnail("astronaut"))[12, 24]))
    assert f"Column 24, row 12: Target {levels};" in reader.page.inner_text("#pixel")


def test_a_link_leads_to_the_same_view(reader: ReportReader) -> None:
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


def test_a_link_with_unknown_names_shows_the_start_and_one_within_keeps_the_view(reader: ReportReader) -> None:
    start = reader.methods()
    reader.open("#display=%3Cscript%3Ealert(1)%3C/script%3E&sort=none&target=nobody&split=x&right=capture:nobody")
    assert reader.methods() == start
    reader.page.select_option("#display", "ideal")
    reader.page.click("nav a[href='#viewer']")
    assert "display=ideal" in reader.view()


def test_every_control_is_reached_by_tab_and_has_a_name(reader: ReportReader) -> None:
    reader.page.focus("a.skip")
    reached = set()
    for _ in range(150):
        reader.page.keyboard.press("Tab")
        reached.add(reader.page.evaluate("() => document.activeElement.id || document.activeElement.textContent"))
    wanted = {"display", "filter", "target", "left", "right", "mode", "panes", "split", "enlarge"}
    assert wanted <= reached


def test_the_pictures_take_the_whole_screen_and_give_it_back(reader: ReportReader) -> None:
    for expected in ("stage", None):
        reader.page.click("#enlarge")
        reader.page.wait_for_function("id => (document.fullscreenElement?.id ?? null) === id", arg=expected)


def test_in_alternation_one_side_is_seen_at_a_time_with_its_caption(browser: Any, written: Written) -> None:
    reader = reader_of(browser, written, viewport={"width": 1000, "height": 800})
    hidden = """time => {
        document.getAnimations().forEach(one => { one.pause(); one.currentTime = time; });
        const parts = ['.pane:last-child', '#caption-left', '#caption-right'];
        return parts.map(part => getComputedStyle(document.querySelector(part)).visibility);
    }"""
    with reading(reader, "#mode=flicker&right=capture%3AHIL"):
        assert reader.page.evaluate(hidden, 100) == ["visible", "hidden", "visible"]
        assert reader.page.evaluate(hidden, 700) == ["hidden", "visible", "hidden"]


@pytest.mark.parametrize(("scheme", "width"), [("light", 400), ("dark", 1400)])
def test_axe_finds_nothing_serious_and_nothing_is_wider_than_the_window(browser, written, scheme, width) -> None:
    seen = {"viewport": {"width": width, "height": 800}, "color_scheme": scheme, "reduced_motion": "reduce"}
    reader = reader_of(browser, written, **seen)
    with reading(reader, "#open=HIL&right=error%3AHIL"):
        assert serious(reader.page) == []
        assert reader.page.evaluate("() => document.documentElement.scrollWidth") <= width


def test_a_picture_without_words_would_be_found(browser: Any) -> None:
    page = browser.new_page()
    page.set_content("<html lang=en><title>x</title><main><h1>x</h1><img src='data:,'></main>")
    assert [name for name, _ in serious(page)] == ["image-alt"]
    page.close()
