"""The site in a browser, opened from disk: nothing is asked for elsewhere, nothing fails, and everybody can read it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.report.page.reading import Reader, reading
from tests.support.axe import serious

from .conftest import Site


@pytest.fixture
def reader(browser: Any, site: Site) -> Iterator[Reader]:
    found = Reader(browser.new_page(viewport={"width": 1000, "height": 800}), f"{site.output.as_uri()}/")
    with reading(found, "index.html"):
        yield found


def test_opening_asks_for_the_files_of_the_site_alone(reader: Reader) -> None:
    for name in ("index.html", "methods/hil.html", "displays/ideal.html", "studies/ours.html"):
        reader.open(name)
        assert len(reader.asked) >= 3
        assert all(address.startswith(reader.address) for address in reader.asked)


def test_the_policy_stops_what_would_leave_the_site(reader: Reader) -> None:
    asked = reader.page.evaluate("() => fetch('https://example.org/').then(() => 'sent', () => 'refused')")
    assert asked == "refused"
    assert not [address for address in reader.asked if "example.org" in address]
    assert all("example.org" in message for message in reader.wrong)  # the browser says that it was refused
    reader.wrong.clear()


@pytest.mark.parametrize(
    ("scheme", "width", "names"),
    [("light", 400, ("methods/gerchberg_saxton", "displays/leto-aged")), ("dark", 1400, ("studies/ours",))],
)
def test_axe_finds_nothing_serious_and_nothing_is_wider_than_the_window(
    browser: Any, site: Site, scheme: str, width: int, names: tuple[str, ...]
) -> None:
    page = browser.new_page(viewport={"width": width, "height": 800}, color_scheme=scheme)
    reader = Reader(page, f"{site.output.as_uri()}/")
    for name in ("index", *names):
        reader.open(f"{name}.html")
        assert serious(page) == []
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert not reader.wrong
    page.close()
