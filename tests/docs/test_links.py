"""Every relative link of the documentation leads to a file that exists, and to a heading in it."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted([*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"])
LINK = re.compile(r"\]\(([^)\s]+)\)")
FENCED = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
ELSEWHERE = ("https://", "http://", "mailto:")


def links(text: str) -> list[str]:
    """The targets of links in Markdown, without those in code and those to other places."""
    return [link for link in LINK.findall(FENCED.sub("", text)) if not link.startswith(ELSEWHERE)]


def headings(text: str) -> set[str]:
    """The anchors that a code host and the site give to headings."""
    found = re.findall(r"^#+ (.+)$", FENCED.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in found}


def broken(page: Path) -> list[str]:
    """The links of a page that lead nowhere."""
    text, wrong = page.read_text(encoding="utf-8"), []
    for link in links(text):
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        if not target.exists() or (anchor and anchor not in headings(target.read_text(encoding="utf-8"))):
            wrong.append(link)
    return wrong


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_relative_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    assert broken(page) == []


def test_the_pages_have_links_to_code_reports_and_each_other() -> None:
    found = [link for page in PAGES for link in links(page.read_text(encoding="utf-8"))]
    assert len(found) > 120
    for part in (".py", "report.md", "CONTRIBUTING.md", "#"):
        assert any(part in link for link in found), part


def test_a_missing_file_and_a_missing_heading_are_found(tmp_path: Path) -> None:
    (tmp_path / "other.md").write_text("# Its title, here\n")
    page = tmp_path / "page.md"
    page.write_text("[a](gone.md) [b](other.md#its-title-here) [c](other.md#gone) [d](https://example.org/gone)\n")
    assert broken(page) == ["gone.md", "other.md#gone"]
