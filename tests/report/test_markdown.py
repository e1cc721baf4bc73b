import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from holobench_eval.report.markdown import Markdown, beginning, blocks, bullets, code, code_block, escape, table

ANY_TEXT = st.text(max_size=40)


@given(ANY_TEXT)
@example("<script>alert(1)</script>")
@example("a | b \\| c")
@example("[x](javascript:alert(1)) ![y](z)")
@example("**bold** _under_ `code` &lt;b&gt; $x$ ~~gone~~")
def test_escaped_text_opens_no_tag_link_or_code_and_has_no_bare_pipe(text):
    escaped = str(escape(text))
    assert "\n" not in escaped
    assert not re.search(r"<[A-Za-z/!?]", escaped)
    bare = re.sub(r"\\.", "", escaped)
    assert not re.search(r"[|`*$~]", bare)
    assert not re.search(r"\]\s*[(\[]", bare)


def test_ordinary_text_stays_legible():
    for text in ("double_phase", "PSNR [dB], p < 0.05", "a & b", "HIL (50 captures)", "50 % of 8"):
        assert str(escape(text)) == text


def test_what_is_joined_or_formatted_into_markdown_is_escaped_once():
    assert str(escape(Markdown("**n**"))) == "**n**"
    assert Markdown("**{}.** {}").format("a | b", Markdown("`c`")) == "**a \\| b.** `c`"
    assert bullets(["*a*", Markdown("*b*")]) == "- \\*a\\*\n- *b*"
    assert blocks(["a\nb", "", None, bullets([]), "<i>"]) == "a b\n\n&lt;i>"


@given(st.lists(st.lists(ANY_TEXT, min_size=3, max_size=3), max_size=4))
def test_a_table_has_the_same_columns_in_every_line(rows):
    lines = str(table(["a|b", "c", "d"], rows)).split("\n")
    assert len(lines) == len(rows) + 2
    assert {len(re.findall(r"(?<!\\)\|", line.replace("\\\\", ""))) for line in lines} == {4}


def test_columns_of_numbers_stand_to_the_right():
    rule = str(table(["name", "value", "note"], [["a", "1.5 [1, 2]", "x"], ["b", "–", "2 of"]])).split("\n")[1]
    assert rule == "| --- | ---: | --- |"


@given(ANY_TEXT)
@example("``` \n# title")
def test_code_cannot_be_closed_from_inside(text):
    fence = re.match("`+", str(code_block(text)))[0]
    assert max((len(run) for run in re.findall("`+", text)), default=0) < len(fence)
    assert "\n" not in str(code(text))


@pytest.mark.parametrize("text", ["# a", "> a", "- a", "+ a", "1. a", "2) a", "---", "===", "###"])
def test_what_begins_a_line_begins_no_block(text):
    html = MarkdownIt("commonmark").render(f"above\n\n{beginning(text)}\n")
    assert html.count("<") == 4  # two paragraphs
    assert MarkdownIt("commonmark").render(str(bullets([text]))).count("<") == 4  # a list and its item


@pytest.mark.parametrize("text", ["-0.75 dB", "+1.2", "1.5 dB", "#hil", "a - b", "20 dB."])
def test_an_ordinary_beginning_stays_legible(text):
    assert beginning(text) == text
