"""What axe-core finds on a page that a reader with a screen reader or a keyboard could not use."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest


def serious(page: Any) -> list[tuple[str, list[str]]]:
    """The serious and critical violations of an open page, with their elements; skipped without axe-core."""
    spec = find_spec("axe_playwright_python")
    if spec is None or spec.origin is None:
        pytest.skip("axe-core is not installed")
    # Without preloading, which the content security policy of a page refuses.
    page.evaluate(Path(spec.origin).with_name("axe.min.js").read_text())
    found = page.evaluate("async () => (await axe.run({ preload: false })).violations")
    return [
        (item["id"], [node["html"][:200] for node in item["nodes"]])
        for item in found
        if item["impact"] in ("serious", "critical")
    ]
