"""Markdown from templates, in which every string is escaped unless it was made here.

The template engine's autoescape knows HTML only. Here every value that is not already :class:`markupsafe.Markup` goes
through :func:`escape` first, so a title such as ``a | <img src=x>`` can neither open a tag nor break a table.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

_SPECIAL = re.compile(r"[\\`*|~$]|\](?=[(\[:])|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])")
_TAG = re.compile(r"<(?=[A-Za-z/!?])")
_ENTITY = re.compile(r"&(?=[#A-Za-z])")
_NUMERIC = re.compile(r"[-+–]?(\d.*)?|no test")


def escape(value: object) -> Markup:
    """``value`` as plain text on one line of Markdown: no HTML, no emphasis, no links, no table breaks.

    Only what would be read as markup is escaped, so that the source stays legible: ``p < 0.05`` and ``[dB]`` stay.
    The result is meant for the middle of a line, since a list or a heading can only begin at its start.
    """
    if isinstance(value, Markup):
        return value
    text = " ".join(str(value).split())
    return Markup(_SPECIAL.sub(r"\\\g<0>", _TAG.sub("&lt;", _ENTITY.sub("&amp;", text))))


def code(value: object) -> Markup:
    """``value`` as a code span on one line; the fence is longer than any run of backticks inside."""
    text = " ".join(str(value).split())
    runs = [len(run) for run in re.findall("`+", text)]
    fence = "`" * (max(runs, default=0) + 1)
    padding = " " if "`" in text else ""
    return Markup(f"{fence}{padding}{text}{padding}{fence}".replace("|", "\\|"))


def code_block(value: object) -> Markup:
    """``value`` as a fenced block, line breaks kept."""
    text = str(value).strip("\n")
    fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", text)), default=0))
    return Markup(f"{fence}\n{text}\n{fence}")


def table(headers: Sequence[object], rows: Sequence[Sequence[object]]) -> Markup:
    """A pipe table, columns of numbers to the right; every cell escaped."""
    columns = zip(headers, *rows, strict=True)
    numeric = [all(_NUMERIC.fullmatch(str(cell)) for cell in cells) for _, *cells in columns]
    rule = "|".join([""] + [" ---: " if right else " --- " for right in numeric] + [""])
    lines = [_line(headers), Markup(rule), *map(_line, rows)]
    return Markup("\n").join(lines)


def _line(cells: Sequence[object]) -> Markup:
    return Markup("| {} |").format(Markup(" | ").join(map(escape, cells)))


def _finalize(value: Any) -> Markup:
    return escape(value)


def render(template: str, context: dict[str, Any]) -> str:
    """The template of that name filled with ``context``; runs of blank lines become one."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True,
        finalize=_finalize,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"code": code, "code_block": code_block}
    text = environment.get_template(template).render(context)
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"
