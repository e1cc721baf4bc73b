"""Markdown in which every string is escaped unless it was made here.

:class:`Markdown` is :class:`markupsafe.Markup` with the rules of Markdown in the place of those of HTML: what is joined
or formatted into it goes through :func:`escape` first, so a title such as ``a | <img src=x>`` can neither open a tag
nor break a table.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from markupsafe import Markup

TEXTS = REPORT, DETAILS = "report.md", "details.md"
# (file, caption) of a figure in a report
FIGURE = re.compile(r"^!\[Figure \d+\]\(figures/(.+?)\)\n\n\*\*Figure \d+\.\*\* (.*)$", re.MULTILINE)

_SPECIAL = re.compile(r"[\\`*|~$]|\](?=[(\[:])|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])")
_TAG = re.compile(r"<(?=[A-Za-z/!?])")
_ENTITY = re.compile(r"&(?=[#A-Za-z])")
# what is a heading, a quotation, a list or a rule where a line begins with it
_BLOCK = re.compile(r"^(\d*)(?=(?<!\d)(?:>|#{1,6}(?:\s|$)|[-+](?:\s|$)|[-=_]{3,}\s*$)|(?<=\d)[.)](?:\s|$))")
_NUMERIC = re.compile(r"[-+–]?(\d.*)?|no test")


class Markdown(Markup):
    """Text that is Markdown already."""

    @classmethod
    def escape(cls, s: Any, /) -> Self:
        """``s`` as plain text on one line of Markdown; see :func:`escape`."""
        if isinstance(s, Markup):
            return cls(s)
        text = " ".join(str(s).split())
        return cls(_SPECIAL.sub(r"\\\g<0>", _TAG.sub("&lt;", _ENTITY.sub("&amp;", text))))


def captions(folder: Path) -> dict[str, str]:
    """The captions of the figures in the texts of a report, which are Markdown, by file name."""
    texts = [path.read_text(encoding="utf-8") for name in TEXTS if (path := folder / name).is_file()]
    return dict(FIGURE.findall("\n".join(texts)))


def escape(value: object) -> Markdown:
    """``value`` as plain text on one line of Markdown: no HTML, no emphasis, no links, no table breaks.

    Only what would be read as markup is escaped, so that the source stays legible: ``p < 0.05`` and ``[dB]`` stay.
    The result is meant for the middle of a line, since a list or a heading can only begin at its start.
    """
    return Markdown.escape(value)


def code(value: object) -> Markdown:
    """``value`` as a code span on one line; the fence is longer than any run of backticks inside."""
    text = " ".join(str(value).split())
    runs = [len(run) for run in re.findall("`+", text)]
    fence = "`" * (max(runs, default=0) + 1)
    padding = " " if "`" in text else ""
    return Markdown(f"{fence}{padding}{text}{padding}{fence}".replace("|", "\\|"))


def code_block(value: object) -> Markdown:
    """``value`` as a fenced block, line breaks kept."""
    text = str(value).strip("\n")
    fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", text)), default=0))
    return Markdown(f"{fence}\n{text}\n{fence}")


def blocks(parts: Iterable[object]) -> Markdown:
    """Paragraphs, lists and tables below each other; empty ones are left out."""
    return Markdown("\n\n").join(filter(None, map(escape, filter(None, parts))))


def heading(text: object, level: int = 2) -> Markdown:
    """A heading."""
    return Markdown("{} {}").format("#" * level, text)


def bullets(items: Iterable[object]) -> Markdown:
    """A list, empty without items."""
    return Markdown("\n").join(Markdown("- {}").format(beginning(item)) for item in items)


def beginning(value: object) -> Markdown:
    """``value`` as :func:`escape` gives it, for the beginning of a line: no heading, quotation, list or rule."""
    return Markdown(_BLOCK.sub(r"\g<1>\\", escape(value), count=1))


def table(headers: Sequence[object], rows: Sequence[Sequence[object]]) -> Markdown:
    """A pipe table, columns of numbers to the right; every cell escaped."""
    columns = zip(headers, *rows, strict=True)
    numeric = [all(_NUMERIC.fullmatch(str(cell)) for cell in cells) for _, *cells in columns]
    rule = "|".join(["", *(" ---: " if right else " --- " for right in numeric), ""])
    return Markdown("\n").join([_line(headers), Markdown(rule), *map(_line, rows)])


def table_of(rows: Sequence[Mapping[str, object]]) -> Markdown | None:
    """A pipe table of rows that name their cells, all alike; None without rows."""
    return table(list(rows[0]), [list(row.values()) for row in rows]) if rows else None


def properties(rows: Iterable[tuple[object, object]]) -> Markdown:
    """A pipe table of names and values, without headings."""
    return Markdown("\n").join([Markdown("| | |\n| --- | --- |"), *map(_line, rows)])


def _line(cells: Iterable[object]) -> Markdown:
    return Markdown("| {} |").format(Markdown(" | ").join(map(escape, cells)))
