"""The page is one file that loads nothing, runs only its own scripts, and takes no markup from names."""

from __future__ import annotations

import base64
import hashlib
import json
import re

import pytest

from holobench_eval.report import Description, Results, read_records
from holobench_eval.report.markdown import Markdown, table
from holobench_eval.report.page import html
from holobench_eval.report.page.html import BOTTOM, MOST_BYTES, TOP, json_text
from holobench_eval.report.section import Report, Section
from holobench_eval.report.sections import sections
from tests.report.elements import Elements

from .conftest import HOSTILE, TITLE, Written

MORE = Markdown("[5 more](details.md#limits)")


@pytest.fixture(scope="module")
def elements(written: Written) -> Elements:
    return Elements(written.text)


def test_names_from_files_open_no_element(written: Written, elements: Elements) -> None:
    assert elements.titles == [TITLE]
    assert elements.opens_nothing()
    assert "alert(" in written.text
    running = [text for attributes, text in elements.scripts if "type" not in attributes]
    assert len(running) == len(html.SCRIPTS)
    assert not [text for text in running if "alert(" in text]
    assert HOSTILE in written.data["methods"]  # in the data, a name is the same text


@pytest.mark.parametrize("text", ["</script>", "<!--", "a & b", "\u2028\u2029", "]]>"])
def test_json_holds_no_character_that_ends_a_script_and_reads_back(text: str) -> None:
    written = json_text({"name": text})
    assert not re.search("[<>&\u2028\u2029]", written)
    assert json.loads(written) == {"name": text}


def test_every_element_that_loads_something_has_it_within(elements: Elements) -> None:
    assert all(value.startswith("data:") for value in elements.values("src", "srcset", "data", "action", "poster"))
    assert all(value.startswith(("#", "data:")) for value in elements.values("href"))
    assert not {"iframe", "object", "embed", "base", "form action"} & {tag for tag, _ in elements.found}


def test_the_policy_names_the_hash_of_every_script_and_of_the_style(written: Written, elements: Elements) -> None:
    style = re.search(r"<style>(.*?)</style>", written.text, re.DOTALL)
    assert style
    assert elements.policy.startswith("default-src 'none';")
    assert "unsafe" not in elements.policy
    for text in [style[1], *(text for attributes, text in elements.scripts if "type" not in attributes)]:
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in elements.policy


def test_the_page_begins_with_sections_that_exist_and_stays_below_its_size(written: Written) -> None:
    assert {section.name for section in sections()} >= {TOP, BOTTOM}
    assert "<h2>Answer</h2>" in written.text
    assert (written.folder / "report.html").stat().st_size < MOST_BYTES


def test_tables_at_the_top_have_no_style_of_their_own_and_links_are_texts(
    written: Written, monkeypatch: pytest.MonkeyPatch
) -> None:
    results = Results(read_records((written.folder / "records.csv").read_text()), written.layout)
    report = Report(results, [], written.folder, {}, Description())
    section = Section(TOP, 1, lambda report, figures: [table(["method", "dB"], [["<b>|", "1.0"]]), MORE])
    monkeypatch.setattr(html, "sections", lambda: [section])
    text = html.section_html(report, TOP)
    assert '<td class="number">1.0</td>' in text
    assert "&lt;b&gt;|" in text
    assert "<p>5 more (details.md)</p>" in text
    assert "style" not in text
