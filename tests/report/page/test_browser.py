"""The page in a browser: what a reader does with pointer, keys and links, and that nothing is loaded or goes wrong."""

from collections.abc import Iterator
from itertools import groupby
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

A4 = {"width": 703, "height": 1032}  # px that its margins leave
PLACES = "all => all.map(one => getComputedStyle(one).transform)"


def reader_of(browser: Any, written: Written, **given: Any) -> ReportReader:
    return ReportReader(browser.new_page(**given), (written.folder / "report.html").as_uri())


@pytest.fixture
def reader(browser: Any, written: Written) -> Iterator[ReportReader]:
    found = reader_of(browser, written, viewport={"width": 1400, "height": 800}, reduced_motion="reduce")
    with reading(found):
        yield found


def test_opening_asks_for_the_file_alone_and_shows_markup_in_names_as_text(reader: ReportReader) -> None:
    reader.page.wait_for_timeout(300)
    assert reader.asked == [reader.address]
    assert reader.page.evaluate("() => document.querySelectorAll('img[src=x]').length") == 0
    assert HOSTILE in reader.methods()
    row = reader.page.locator("#rows tr", has_text="3 of 4 targets")
    assert HOSTILE in row.inner_text()


def test_one_chooser_below_the_question_moves_sentence_board_wall_and_charts(reader, written) -> None:
    assert reader.page.inner_text("h1").endswith("?")
    charts = "all => all.filter(one => !one.hidden).map(one => one.dataset.name)"
    for display, other in (("ideal", "leto-aged"), ("leto-aged", "ideal")):
        reader.choose(display=display)
        of_all, of_display, *_ = reader.page.inner_text("#answer").splitlines()
        assert of_all.startswith("No difference can be shown: 4 targets")
        assert of_display.startswith(f"{display}: ")
        assert f"{other}: " not in reader.page.inner_text("#answer")
        best = max(row["values"][0] for row in written.data["rows"][display])
        assert any(f"{best:.2f} dB" in tile for tile in reader.tiles())
        assert display in reader.page.inner_text("#table-title")
        names = reader.page.eval_on_selector_all("#charts figure", charts)
        assert any(display in name for name in names)
        assert not any(other in name for name in names)


def test_a_heading_sorts_within_the_groups_and_says_so(reader: ReportReader, written: Written) -> None:
    data = written.data
    scores = {row["method"]: row["cells"]["psnr_linear_db"] for row in data["rows"]["ideal"]}
    reader.choose(display="ideal")
    heading = reader.page.locator("#rows > thead button", has_text="PSNR, linear light")
    for order in ("descending", "ascending"):
        assert heading.locator("..").get_attribute("aria-sort") == order
        groups = [
            (group, list(rows)) for group, rows in groupby(reader.methods(), lambda one: data["methods"][one]["group"])
        ]
        assert reader.page.locator("#rows tr.group").all_inner_texts() == [group for group, _ in groups]
        for _, rows in groups:
            assert rows == sorted(rows, key=lambda one: scores[one], reverse=order == "descending")
        heading.click()


@pytest.mark.parametrize(
    ("control", "value", "left"),
    [
        ("photographs", "49", {"Double phase", "Wirtinger", "SGD", "Oracle", HOSTILE}),
        ("seconds", "1", {"Double phase"}),
        ("filter", "double", {"Double phase"}),
    ],
)
def test_rows_beyond_photographs_seconds_or_words_are_hidden_and_counted(reader, control, value, left) -> None:
    reader.page.fill(f"#{control}", value)
    assert set(reader.methods()) == left
    assert f"{6 - len(left)} of 6 methods are hidden" in reader.page.inner_text("#table-note")
    assert not any(tile.startswith("HIL") for tile in reader.drawn().tiles())


def test_the_board_has_at_most_nine_columns_and_a_switch_for_the_rest(reader: ReportReader) -> None:
    headings = reader.page.locator("#rows > thead th")
    few = headings.count()
    assert few <= 9
    reader.page.check("#all")
    assert headings.count() > few


def test_differences_are_drawn_on_one_scale(reader: ReportReader) -> None:
    ends = "['zero', 'low', 'mean', 'high'].map(name => parseFloat(one.style.getPropertyValue(`--${name}`)))"
    places = reader.page.locator("#rows span.forest").evaluate_all(f"all => all.map(one => {ends})")
    assert len(places) == 4
    assert all(0 <= low <= mean <= high <= 100 for _, low, mean, high in places)
    assert len({zero for zero, *_ in places}) == 1


def test_a_row_opens_to_its_targets_and_leads_to_a_picture(reader: ReportReader) -> None:
    reader.page.click("#rows button[aria-expanded]:has-text('HIL')")
    assert reader.page.locator("table.targets tbody tr").count() == 4
    reader.page.click("table.targets button[aria-label='look at chelsea']")
    assert reader.page.input_value("#target") == "chelsea"
    assert any(tile.startswith("HIL") for tile in reader.drawn().tiles())
    assert reader.page.locator("#wall h3").all_inner_texts() == ["chelsea"]
    reader.page.keyboard.press("Escape")
    assert reader.page.locator("table.targets").count() == 0


def test_the_wall_begins_with_targets_that_have_all_methods_and_has_those_that_are_ticked(reader: ReportReader) -> None:
    assert reader.page.locator("#wall h3").all_inner_texts() == ["astronaut", "chelsea", "rocket"]  # not coffee
    assert len(reader.tiles()) == 3 * 7
    assert not any("no picture" in tile for tile in reader.tiles())
    reader.page.click("summary:has-text('Methods')")
    for name in ("HIL", "SGD"):
        reader.page.uncheck(f"#methods label:has-text('{name}') input")
    assert len(reader.drawn().tiles()) == 3 * 5
    assert not any(tile.startswith(("HIL", "SGD")) for tile in reader.tiles())


def test_all_pictures_show_the_same_place_as_stored_pixels(reader: ReportReader) -> None:
    canvases = reader.page.locator("#wall canvas")
    reader.page.focus("#wall")
    for key in ("+", "+", "+", "ArrowRight"):
        reader.page.keyboard.press(key)
    (near,) = set(canvases.evaluate_all(PLACES))
    changes = (np.abs(np.diff(reader.picture("HIL")[..., :3].astype(int), axis=1)).sum(axis=(0, 2)) > 0).nonzero()[0]
    assert np.diff(changes).min() > 20  # edges of pixels are far apart, with nothing blended between them
    box = canvases.nth(3).locator("..").bounding_box()
    reader.page.mouse.move(box["x"] + 60, box["y"] + 60)
    reader.page.mouse.down()
    reader.page.mouse.move(box["x"] + 20, box["y"] + 50)
    reader.page.mouse.up()
    (moved,) = set(canvases.evaluate_all(PLACES))
    assert moved != near
    reader.page.keyboard.press("0")
    assert "zoom" not in reader.view()


def test_an_error_map_differs_with_values_and_colour_and_a_key_shows_it(reader: ReportReader) -> None:
    seen = [reader.picture("Wirtinger").tobytes()]
    reader.page.focus("#wall")
    reader.page.keyboard.press("e")
    reader.page.click("summary:has-text('Methods')")
    for name, value in (("values", "srgb"), ("values", "linear"), ("channel", "0"), ("scale", "1")):
        seen.append(reader.choose(**{name: value}).picture("Wirtinger").tobytes())
    assert len(set(seen)) == 5
    assert "linear light" in reader.page.inner_text("#error-note")
    target = reader.picture("Target")
    np.testing.assert_array_equal(reader.choose(mode="truth").picture("Wirtinger"), target)


def test_the_map_of_flip_has_the_mean_of_its_authors_code(reader: ReportReader, written: Written) -> None:
    store = Store(written.folder)
    reader.choose(target="astronaut", mode="flip")
    for label, name in (("Wirtinger", "wirtinger"), ("Double phase", "double_phase")):
        (tile,) = (tile for tile in reader.tiles() if tile.startswith(label))
        capture = store.thumbnail(digest(synthetic.cell(name, "astronaut", "leto-aged")))
        pictures = (
            torch.tensor(imread(path)).permute(2, 0, 1) / 255 for path in (capture, store.target_thumbnail("astronaut"))
        )
        assert float(tile.rpartition(" ")[2]) == pytest.approx(float(flip(*pictures)), abs=0.001)


def test_pointing_at_a_pixel_tells_the_stored_levels(reader: ReportReader, written: Written) -> None:
    frame = reader.page.locator("#wall .frame").nth(1)
    box = frame.bounding_box()
    frame.hover(position={"x": box["width"] / 2 + 1, "y": box["height"] / 4 + 1})
    levels = ", ".join(map(str, imread(Store(written.folder).target_thumbnail("astronaut"))[12, 24]))
    assert f"Column 24, row 12: target {levels};" in reader.page.inner_text("#pixel")


def test_a_link_leads_to_the_same_view_and_lands_at_the_pictures(reader: ReportReader) -> None:
    page = reader.page
    reader.choose(display="ideal", target="coffee", mode="error")
    page.fill("#filter", "i")
    page.fill("#photographs", "60")
    page.locator("#rows > thead button").nth(1).click()
    page.click("#closer")
    view, methods, tiles, before = reader.view(), reader.methods(), reader.drawn().tiles(), reader.picture("HIL")
    assert page.get_attribute("#link", "href").endswith(view)
    reader.open(view)
    assert (reader.methods(), reader.tiles()) == (methods, tiles)
    np.testing.assert_array_equal(reader.picture("HIL"), before)
    assert 0 <= page.locator("#viewer").bounding_box()["y"] < 200
    reader.open("#sort=cpu_s")  # of the board alone
    assert 0 <= page.locator("#table").bounding_box()["y"] < 200


def test_a_link_with_unknown_names_shows_the_start_and_one_within_keeps_the_view(reader: ReportReader) -> None:
    start = reader.methods(), reader.tiles()
    reader.open(
        "#display=%3Cscript%3Ealert(1)%3C/script%3E&sort=none&target=nobody&zoom=x&methods=nobody&photographs=-"
    )
    assert (reader.methods(), reader.tiles()) == start
    reader.choose(display="ideal")
    reader.page.click("nav a[href='#viewer']")
    assert "display=ideal" in reader.view()


def test_every_control_is_reached_by_tab_and_has_a_name(reader: ReportReader) -> None:
    reader.page.focus("a.skip")
    reached = set()
    for _ in range(60):
        reader.page.keyboard.press("Tab")
        reached.add(reader.page.evaluate("() => document.activeElement.id"))
    assert {
        "display",
        "link",
        "filter",
        "photographs",
        "seconds",
        "all",
        "target",
        "mode",
        "size",
        "closer",
        "wall",
    } <= reached


def test_the_pictures_take_the_whole_screen_and_give_it_back(reader: ReportReader) -> None:
    for expected in ("pictures", None):
        reader.page.click("#enlarge")
        reader.page.wait_for_function("id => (document.fullscreenElement?.id ?? null) === id", arg=expected)


@pytest.mark.parametrize(("scheme", "width"), [("light", 400), ("dark", 1400)])
def test_axe_finds_nothing_serious_and_nothing_is_wider_than_the_window(browser, written, scheme, width) -> None:
    seen = {"viewport": {"width": width, "height": 800}, "color_scheme": scheme, "reduced_motion": "reduce"}
    reader = reader_of(browser, written, **seen)
    with reading(reader, "#open=HIL&mode=error"):
        reader.page.eval_on_selector_all("details", "all => all.forEach(one => (one.open = true))")
        assert serious(reader.page) == []
        assert reader.page.evaluate("() => document.documentElement.scrollWidth") <= width


def test_charts_are_dark_on_a_dark_page_and_photographs_as_they_are(browser: Any, written: Written) -> None:
    reader = reader_of(browser, written, color_scheme="dark")
    with reading(reader):
        for name, expected in (("#charts figure img", "invert(0.92) hue-rotate(180deg)"), ("#wall canvas", "none")):
            filters = reader.page.eval_on_selector_all(name, "all => all.map(one => getComputedStyle(one).filter)")
            assert set(filters) == {expected}


def test_paper_has_the_whole_board_and_no_controls(browser: Any, written: Written) -> None:
    reader = reader_of(browser, written, viewport=A4)
    with reading(reader):
        reader.page.emulate_media(media="print")
        assert reader.page.evaluate("() => document.getElementById('rows').scrollWidth") <= A4["width"]
        assert reader.page.evaluate("() => document.documentElement.scrollWidth") <= A4["width"]
        assert reader.page.locator("select:visible, input:visible, nav:visible").count() == 0


def test_a_picture_without_words_would_be_found(browser: Any) -> None:
    page = browser.new_page()
    page.set_content("<html lang=en><title>x</title><main><h1>x</h1><img src='data:,'></main>")
    assert [name for name, _ in serious(page)] == ["image-alt"]
    page.close()
