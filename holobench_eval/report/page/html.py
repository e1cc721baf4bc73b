"""The file itself: data as JSON, pictures as base64, scripts and styles inline and named by their hashes.

What comes from files cannot become markup: numbers and names are JSON in which ``<``, ``>`` and ``&`` are escaped, the
scripts write text nodes only, and the template escapes what stands in it. The content security policy lets no
request leave the page and no script run but those of this package.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterator
from fnmatch import fnmatch
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markdown_it import MarkdownIt
from markupsafe import Markup

from ...core.io import write_atomically
from ..markdown import blocks, captions
from ..stories.overview import ANSWER, LIMITATIONS, counts, environment
from ..story import Part, Report
from .data import page_data
from .pictures import pictures

MOST_BYTES = 24_000_000  # of the whole page
OWN = 200_000  # bytes that the template, the policy and the provenance may take beside scripts, data and pictures
CHARTS = ("quality-*", "error-budget*", "sweep-*", "training-*", "stages-*")  # figures of the report that the page has
SCRIPTS = ("dom", "state", "pixels", "flip", "table", "viewer", "strip", "main")

_LINK = re.compile(r"\[([^\]]+)(?<!\\)\]\(([^)#]+)[^)]*\)")  # in Markdown whose names are escaped
_JSON = str.maketrans({char: f"\\u{ord(char):04x}" for char in "<>&\u2028\u2029"})


def templates(package: str, folder: str) -> Environment:
    """The templates in a folder of a package: every text in them is escaped, and none may be missing."""
    loader = PackageLoader(package, folder)
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def write_page(report: Report) -> Path:
    """Write ``report.html`` beside ``report.md`` and return its path; equal records give equal bytes."""
    path = report.output / "report.html"
    write_atomically(path, page(report).encode())
    return path


def page(report: Report) -> str:
    """The text of the page, at most ``MOST_BYTES`` of UTF-8 where the numbers alone do not take more."""
    style, data, charts = asset("page.css"), page_data(report), list(_charts(report))
    scripts = [f'"use strict";\n{asset(f"{name}.js")}' for name in SCRIPTS]
    taken = [style, *scripts, json_text(data), *(text for chart in charts for text in chart)]
    held, shown = pictures(report, MOST_BYTES - OWN - sum(len(text.encode()) for text in taken))
    data |= {"pictures": shown}
    template = templates("holobench_eval.report.page", "assets").get_template("page.html")
    return template.render(
        title=report.layout.title,
        policy=policy(scripts, style),
        style=Markup(style),
        counts=counts(report.results),
        top=part_html(report, ANSWER),
        limits=part_html(report, LIMITATIONS),
        charts=charts,
        environment=environment(report.provenance),  # times and revisions stand in provenance.json
        description=report.description,
        data=data,
        json=Markup(json_text(data)),
        scripts=map(Markup, scripts),
        contents=(base64.b64encode(content).decode() for content in held.values()),
    )


def json_text(value: Any) -> str:
    """JSON that is safe inside a script element: no character of it can end the element or open a comment."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":")).translate(_JSON)


def policy(scripts: list[str], style: str) -> str:
    """The content security policy: nothing is loaded, and only these scripts and this style are taken."""
    allowed = " ".join(map(_hash, scripts))
    return (
        f"default-src 'none'; script-src {allowed}; style-src {_hash(style)}; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )


def part_html(report: Report, part: Part) -> Markup:
    """A part of report.md as HTML; links, which lead out of the page, are a text and a name in brackets.

    Columns of numbers get a class, since the policy takes no style of an element.
    """
    text = blocks(part.render(report, [])) if part.applies(report) else ""
    reader = MarkdownIt("commonmark", {"html": False}).enable("table").disable(["link", "image", "autolink"])
    tokens = reader.parse(_LINK.sub(r"\1 (\2)", str(text)))
    for token in tokens:
        if token.attrs.pop("style", None):
            token.attrs["class"] = "number"
    return Markup(reader.renderer.render(tokens, reader.options, {}))


def asset(name: str) -> str:
    """A style sheet or a script of the page."""
    return (files(__package__) / "assets" / name).read_text(encoding="utf-8")


def plain(markdown: str) -> str:
    """What Markdown of one line shows."""
    return re.sub(r"\\(?=[\\`*|~$_\]])|`", "", markdown)


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _charts(report: Report) -> Iterator[tuple[str, str]]:
    """(address, caption) of the charts of the report, as far as they are there."""
    for name, caption in captions(report.output).items():
        path = report.figures / name
        if any(fnmatch(name, f"{pattern}.*") for pattern in CHARTS) and path.is_file():
            kind = "jpeg" if path.suffix == ".jpg" else "png"
            yield f"data:image/{kind};base64,{base64.b64encode(path.read_bytes()).decode()}", plain(caption)
