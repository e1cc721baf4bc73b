"""The site in a browser, opened from disk: nothing is asked for elsewhere, nothing fails, and everybody can read it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.axe import serious

from .conftest import Site


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

    def open(self, name: str = "index.html") -> Reader:
        self.page.goto("about:blank")
        self.asked.clear()
        self.page.goto(f"{(self.output / name).as_uri()}")
        return self


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


def test_the_policy_stops_what_would_leave_the_site(browser: Any, site: Site) -> None:
    page = browser.new_page()
    reader = Reader(page, site.output).open()
    asked = page.evaluate("() => fetch('https://example.org/').then(() => 'sent', () => 'refused')")
    assert asked == "refused"
    assert not [address for address in reader.asked if "example.org" in address]
    page.close()


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
