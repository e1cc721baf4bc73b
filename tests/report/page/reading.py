"""A reader of a page: a browser's page with what went wrong in it and what it asked of the network."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from PIL import Image

DELAY = 400  # ms after which the address holds a new view


class Reader:
    """A page of a browser, with what went wrong and what was asked of the network."""

    def __init__(self, page: Any, address: str) -> None:
        self.page, self.address = page, address
        page.set_default_timeout(10_000)
        self.wrong: list[str] = []
        self.asked: list[str] = []
        page.on("console", lambda message: self.wrong.append(message.text))
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.on("request", lambda request: self.asked.append(request.url))
        page.on("dialog", lambda dialog: self.wrong.append(dialog.message))

    def open(self, rest: str = "") -> "Reader":
        """Load the address with what comes after it."""
        self.page.goto("about:blank")
        self.asked.clear()
        self.page.goto(f"{self.address}{rest}")
        return self


@contextmanager
def reading(reader: Reader, rest: str = "") -> Iterator[None]:
    """The address is open, and nothing has gone wrong in the end."""
    reader.open(rest)
    yield
    assert not reader.wrong
    reader.page.close()


class ReportReader(Reader):
    """A reader of a report's page."""

    def open(self, rest: str = "") -> "ReportReader":
        super().open(rest)
        self.page.wait_for_function("() => document.getElementById('panes').getAttribute('aria-label')")
        return self

    def methods(self) -> list[str]:
        found = self.page.eval_on_selector_all(
            "#rows > tbody > tr:not(.opened) > th > button", "all => all.map(one => one.lastChild.textContent)"
        )
        return list(map(str, found))

    def canvas(self) -> np.ndarray[Any, np.dtype[np.uint8]]:
        """The pixels of the viewer as they are seen, ``(h, w, channels)``."""
        return np.asarray(Image.open(io.BytesIO(self.page.locator("#panes").screenshot())))

    def view(self) -> str:
        self.page.wait_for_timeout(DELAY)
        return str(self.page.evaluate("() => location.hash"))
