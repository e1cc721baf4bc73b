"""docs/architecture.md names functions and files that exist."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "architecture.md"
ELSEWHERE = {"Method.solve", "Method.prepare"}  # what a method has, whoever wrote it


def test_every_file_that_is_named_exists() -> None:
    links = re.findall(r"\]\((\.\./[^)]+)\)", PAGE.read_text())
    assert len(links) > 15
    assert all((PAGE.parent / link).exists() for link in links)


def test_every_function_and_class_that_is_named_is_defined_in_the_package() -> None:
    code = "\n".join(file.read_text() for file in (ROOT / "holobench_eval").rglob("*.py"))
    names = set(re.findall(r"`([A-Za-z_]+(?:\.[a-z_]+)?)`", PAGE.read_text())) - ELSEWHERE
    names = {name for name in names if not name.endswith((".csv", ".md"))}
    assert len(names) > 25
    for name in names:
        last = name.split(".")[-1]
        assert re.search(rf"(def|class) {last}\b|^{last}[:=\b]", code, flags=re.MULTILINE), name
