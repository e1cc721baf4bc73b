"""The page is one file that loads nothing, runs only its own scripts, and takes no markup from names."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html.parser import HTMLParser

import pytest

from holobench_eval.report import Description, Results, read_records
from holobench_eval.report.markdown import Markdown, table
from holobench_eval.report.page import html
from holobench_eval.report.page.html import BOTTOM, MOST_BYTES, TOP, json_text
from holobench_eval.report.section import Report, Section
from holobench_eval.report.sections import sections

from .conftest import HOSTILE, TITLE, Written

MORE = Markdown("[5 more](details.md#limits)")


class Elements(HTMLParser):
    """The elements of a page as a browser finds them, and the text of each script."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[tuple[dict[str, str | None], str]] = []
        self.titles: list[str] = []
        self.inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        self.inside = tag

    def handle_endtag(self, tag: str) -> None:
        self.inside = ""

    def handle_data(self, data: str) -> None:
        if self.inside == "script":
            self.scripts.append((self.found[-1][1], data))
        if self.inside == "title":
            self.titles.append(data)


@pytest.fixture(scope="module")
def elements(written: Written) -> Elements:
    return Elements(written.text)


def test_names_from_files_open_no_element(written: Written, elements: Elements) -> None:
    assert elements.titles == [TITLE]
    assert not [attributes for _, attributes in elements.found if any(name.startswith("on") for name in attributes)]
    assert "alert(" in written.text
    running = [text for attributes, text in elements.scripts if "type" not in attributes]
    assert len(running) == len(html.SCRIPTS)
    assert not [text for text in running if "alert(" in text]


def test_a_name_is_the_same_text_in_the_data(written: Written) -> None:
    assert HOSTILE in written.data["methods"]
    assert written.data["displays"] == ["leto-aged", "ideal"]


@pytest.mark.parametrize("text", ["</script>", "<!--", "a & b", "\u2028\u2029", "]]>"])
def test_json_holds_no_character_that_ends_a_script_and_reads_back(text: str) -> None:
    written = json_text({"name": text})
    assert not re.search("[<>&\u2028\u2029]", written)
    assert json.loads(written) == {"name": text}


def test_every_element_that_loads_something_has_it_within(elements: Elements) -> None:
    for _, attributes in elements.found:
        for name in ("src", "srcset", "data", "action", "poster"):
            assert (attributes.get(name) or "data:").startswith("data:")
        assert (attributes.get("href") or "#").startswith(("#", "data:"))
        assert "style" not in attributes  # the policy would not take it
    assert not {"iframe", "object", "embed", "base", "form action"} & {tag for tag, _ in elements.found}


def test_the_policy_names_the_hash_of_every_script_and_of_the_style(written: Written, elements: Elements) -> None:
    policy = next(attributes["content"] for tag, attributes in elements.found if "http-equiv" in attributes)
    style = re.search(r"<style>(.*?)</style>", written.text, re.DOTALL)
    assert style
    assert policy is not None
    assert policy.startswith("default-src 'none';")
    assert "unsafe" not in policy
    for text in [style[1], *(text for attributes, text in elements.scripts if "type" not in attributes)]:
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in policy


def test_the_page_begins_with_sections_that_exist(written: Written) -> None:
    assert {section.name for section in sections()} >= {TOP, BOTTOM}
    assert "<h2>Answer</h2>" in written.text


def test_a_page_stays_below_its_size(written: Written) -> None:
    assert (written.folder / "report.html").stat().st_size < MOST_BYTES


def test_tables_at_the_top_have_no_style_of_their_own_and_links_are_texts(
    written: Written, monkeypatch: pytest.MonkeyPatch
) -> None:
    report = Report(
        Results(read_records((written.folder / "records.csv").read_text()), written.layout),
        [],
        written.folder,
        {},
        Description(),
    )
    section = Section(TOP, 1, lambda report, figures: [table(["method", "dB"], [["<b>|", "1.0"]]), MORE])
    monkeypatch.setattr(html, "sections", lambda: [section])
    text = html.section_html(report, TOP)
    assert '<td class="number">1.0</td>' in text
    assert "&lt;b&gt;|" in text
    assert "<p>5 more (details.md)</p>" in text
    assert "style" not in text
