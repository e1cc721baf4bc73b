"""The leaderboard in a browser, opened from disk: filters, sorting, links to a view, keys, and that nothing fails."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.report.site import write_site
from tests.support.axe import serious
from tests.support.results_folder import write_results

from .conftest import HOSTILE, Site
from .test_standing import in_another_metric

NAMES = "rows => rows.filter(row => row.checkVisibility()).map(row => row.cells[0].textContent)"


class Reader:
    """A page of a browser, with what went wrong and what was asked for."""

    def __init__(self, page: Any, output: Path) -> None:
        self.page, self.output = page, output
        page.set_default_timeout(10_000)
        self.wrong: list[str] = []
        self.asked: list[str] = []
        page.on("console", lambda message: self.wrong.append(message.text))
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.on("dialog", lambda dialog: self.wrong.append(dialog.message))
        page.on("request", lambda request: self.asked.append(request.url))

    def open(self, name: str = "index.html", view: str = "") -> Reader:
        self.page.goto("about:blank")
        self.asked.clear()
        self.page.goto(f"{(self.output / name).as_uri()}{view}")
        return self

    def names(self) -> list[str]:
        """The methods of the rows that are seen, from top to bottom."""
        return list(self.page.eval_on_selector_all("table.board tbody tr:not(.group)", NAMES))

    def numbers(self, key: str) -> list[float]:
        """What the seen rows are sorted by, by group; holes are left out."""
        script = f"rows => rows.filter(row => row.checkVisibility()).map(row => row.dataset.{key})"
        found = self.page.eval_on_selector_all("table.board tbody tr:not(.group)", script)
        return [float(value) for value in found if value]

    def sort(self, key: str) -> Any:
        self.page.click(f"th[data-key={key}] button")
        return self.page.locator(f"th[data-key={key}]").get_attribute("aria-sort")

    def view(self) -> str:
        return str(self.page.evaluate("() => location.hash"))


@pytest.fixture
def reader(browser: Any, site: Site) -> Iterator[Reader]:
    page = browser.new_page(viewport={"width": 1000, "height": 800})
    found = Reader(page, site.output)
    yield found.open()
    assert not found.wrong
    page.close()


def test_opening_asks_for_the_files_of_the_site_alone(reader: Reader) -> None:
    root = reader.output.as_uri()
    for name in ("index.html", "methods/hil.html", "displays/ideal.html", "studies/ours.html"):
        reader.open(name)
        assert len(reader.asked) >= 3
        assert all(address.startswith(f"{root}/") for address in reader.asked)
    assert HOSTILE in reader.open().names()


def test_the_policy_stops_what_would_leave_the_site(browser: Any, site: Site) -> None:
    page = browser.new_page()
    reader = Reader(page, site.output).open()
    asked = page.evaluate("() => fetch('https://example.org/').then(() => 'sent', () => 'refused')")
    assert asked == "refused"
    assert not [address for address in reader.asked if "example.org" in address]
    page.close()


def test_filters_leave_the_rows_that_pass(reader: Reader) -> None:
    everything = reader.names()
    assert len(everything) == 24
    reader.page.select_option("#display", "ideal")
    assert len(reader.names()) == 12
    reader.page.select_option("#category", "oracle")
    assert reader.names() == ["Oracle, the oracle"] * 2
    assert "2 of 24 rows." in reader.page.inner_text("#status")
    reader.page.click("#reset")
    assert reader.names() == everything
    reader.page.fill("#captures", "10")
    assert "HIL" not in reader.names()
    assert len(reader.names()) == 20
    reader.page.fill("#seconds", "2")
    assert set(reader.names()) == {"Double phase", "GS"}
    reader.page.fill("#text", "their GS")
    assert reader.names() == ["GS", "GS"]


def test_headings_sort_within_groups_and_holes_stay_below(reader: Reader) -> None:
    reader.page.select_option("#display", "leto-aged")
    assert reader.sort("score") == "descending"
    assert reader.numbers("score") == sorted(reader.numbers("score"), reverse=True)
    assert reader.sort("score") == "ascending"
    assert reader.numbers("score") == sorted(reader.numbers("score"))
    assert reader.sort("gain") == "descending"
    assert reader.names()[-2:] == ["GS", "GS"]
    reader.sort("gain")
    assert reader.names()[-2:] == ["GS", "GS"]
    assert reader.sort("seconds") == "ascending"
    assert reader.numbers("seconds") == sorted(reader.numbers("seconds"))
    assert reader.sort("method") == "ascending"


def test_across_groups_scores_and_ranks_are_gone_and_differences_sort(reader: Reader) -> None:
    reader.page.select_option("#arrange", "across")
    assert reader.page.locator("td.within:visible").count() == 0
    assert reader.page.locator("tr.group:visible").count() == 0
    assert reader.page.locator("td.across:visible").count() == 24
    assert reader.page.input_value("#measure") == "picture psnr_linear"
    assert reader.page.locator("th[data-key=above]:visible").count() == 0
    gains = reader.numbers("gain")
    assert gains == sorted(gains, reverse=True)
    assert "do not compare" in reader.page.inner_text("#status")
    reader.page.select_option("#arrange", "within")
    assert reader.page.locator("tr.group:visible").count() == 2
    assert reader.page.locator("td.within:visible").count() == 120


def test_across_groups_there_is_one_measure_and_one_metric(
    browser: Any, tmp_path: Path, site: Site, study: list[dict[str, Any]]
) -> None:
    other = in_another_metric(write_results(tmp_path / "theirs", study, by="Lab"))
    write_site([site.own, other], tmp_path / "site", site.own)
    page = browser.new_page()
    reader = Reader(page, tmp_path / "site").open()
    assert len(reader.names()) == 24
    for metric in ("psnr_linear", "flip_srgb"):
        page.select_option("#measure", f"picture {metric}")
        page.select_option("#arrange", "across")
        assert len(reader.names()) == 12
        title = {"psnr_linear": "PSNR", "flip_srgb": "FLIP"}[metric]
        assert all(title in text for text in page.locator("td.across:visible").all_inner_texts())
    page.select_option("#measure", "")
    assert len(reader.names()) == 12
    assert len(reader.open(view="#arrange=across").names()) == 12
    assert not reader.wrong
    page.close()


def test_a_link_leads_to_the_same_view(reader: Reader) -> None:
    reader.page.select_option("#display", "ideal")
    reader.page.select_option("#arrange", "across")
    reader.page.fill("#text", "own")
    reader.sort("captures")
    reader.sort("captures")
    view, names = reader.view(), reader.names()
    assert len(names) == 6
    reader.open(view=view)
    assert reader.names() == names
    assert reader.page.input_value("#display") == "ideal"
    assert reader.page.locator("th[data-key=captures]").get_attribute("aria-sort") == "descending"


@pytest.mark.parametrize(
    "view", ["#display=nowhere&sort=__proto__&captures=-1&seconds=x&order=odd", "#studies", "#a=b"]
)
def test_a_view_that_does_not_exist_is_the_start(reader: Reader, view: str) -> None:
    start = reader.names()
    assert reader.open(view=view).names() == start


def test_going_to_a_part_of_the_page_keeps_the_view(reader: Reader) -> None:
    reader.page.select_option("#display", "ideal")
    reader.page.click("nav a[href='index.html#studies']")
    assert len(reader.names()) == 12


def test_other_versions_are_left_out_until_they_are_asked_for(
    browser: Any, tmp_path: Path, study: list[dict[str, Any]]
) -> None:
    write_site([write_results(tmp_path / "old", study, known={"harness": "3"})], tmp_path / "site", tmp_path)
    page = browser.new_page()
    reader = Reader(page, tmp_path / "site").open()
    assert reader.names() == []
    assert "12 rows of other versions are left out" in page.inner_text("#status")
    page.select_option("#version", "")
    assert len(reader.names()) == 12
    assert reader.view() == "#version="
    assert len(reader.open(view="#version=").names()) == 12
    assert not reader.wrong
    page.close()


def test_every_control_and_heading_is_reached_and_works_by_keys(reader: Reader) -> None:
    reader.page.focus("a.skip")
    reached = set()
    for _ in range(40):
        reader.page.keyboard.press("Tab")
        reached.add(
            reader.page.evaluate("() => document.activeElement.id || document.activeElement.parentNode.dataset.key")
        )
    assert {"arrange", "display", "category", "measure", "version", "captures", "seconds", "text", "reset"} <= reached
    assert {"method", "score", "gain", "above", "captures", "seconds", "targets", "study"} <= reached
    reader.page.focus("th[data-key=score] button")
    reader.page.keyboard.press("Enter")
    reader.page.keyboard.press("Enter")
    assert reader.page.locator("th[data-key=score]").get_attribute("aria-sort") == "ascending"
    assert reader.page.evaluate("() => document.activeElement.parentNode.dataset.key") == "score"


def test_without_scripts_every_row_is_there(browser: Any, site: Site) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto((site.output / "index.html").as_uri())
    assert page.locator("table.board tbody tr:not(.group):visible").count() == 24
    assert page.locator(".controls:visible").count() == 0
    context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 400])
def test_axe_finds_nothing_serious_and_nothing_is_wider_than_the_window(
    browser: Any, site: Site, scheme: str, width: int
) -> None:
    page = browser.new_page(viewport={"width": width, "height": 800}, color_scheme=scheme)
    others = (
        ("displays/leto-aged.html", "studies/ours.html") if scheme == "dark" else ("methods/gerchberg_saxton.html",)
    )
    for name in ("index.html", *others):
        reader = Reader(page, site.output).open(name)
        assert serious(page) == []
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width
        assert not reader.wrong
    page.close()
