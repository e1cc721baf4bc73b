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
        return self.drawn()

    def drawn(self) -> "ReportReader":
        """All pictures of the wall are there."""
        self.page.wait_for_function("() => Number(document.getElementById('wall').dataset.drawn) === drawing")
        return self

    def choose(self, **values: str) -> "ReportReader":
        """Take a value of each of these lists."""
        for name, value in values.items():
            self.page.select_option(f"#{name}", value)
        return self.drawn()

    def methods(self) -> list[str]:
        """The rows of the board."""
        return self._texts("#rows tr[data-method]", "dataset.method")

    def tiles(self) -> list[str]:
        """What each picture of the wall is of."""
        return self._texts("#wall figcaption", "innerText")

    def _texts(self, selector: str, key: str) -> list[str]:
        return list(map(str, self.page.eval_on_selector_all(selector, f"all => all.map(one => one.{key})")))

    def picture(self, label: str) -> np.ndarray[Any, np.dtype[np.uint8]]:
        """The pixels of the first picture of a method as they are seen, ``(h, w, channels)``."""
        frame = self.page.locator(f'#wall canvas[aria-label^="{label}"]').first.locator("..")
        return np.asarray(Image.open(io.BytesIO(frame.screenshot())))

    def view(self) -> str:
        """The address after a pause."""
        self.page.wait_for_timeout(DELAY)
        return str(self.page.evaluate("() => location.hash"))
