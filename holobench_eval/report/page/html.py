"""The file itself: data as JSON, pictures as base64, scripts and styles inline and named by their hashes.

What comes from files cannot become markup: numbers and names are JSON in which ``<``, ``>`` and ``&`` are escaped, the
scripts write text nodes only, and the few sentences written here are escaped. The content security policy lets no
request leave the page and no script run but those of this package.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterator
from fnmatch import fnmatch
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from markdown_it import MarkdownIt

from ...core.io import write_atomically
from ..markdown import FIGURE, blocks
from ..section import Report
from ..sections import sections
from ..sections.answer import counts
from ..sections.appendix import environment
from .data import page_data
from .pictures import pictures

MOST_BYTES = 24_000_000  # of the whole page
OWN = 200_000  # bytes that the template, the policy and the provenance may take beside scripts, data and pictures
TOP, BOTTOM = "answer", "limits"  # sections of report.md that stand first and last
# Figures of the report that the page has: those of numbers but the paired differences, which it draws itself.
CHARTS = ("quality-[!p]*", "error-budget*", "sweep-*", "training-*", "stages-*")
VENDORED = ("d3.min.js", "plot.umd.min.js")
SCRIPTS = (
    "dom.js",
    "state.js",
    "table.js",
    "copy.js",
    "plots.js",
    "pixels.js",
    "flip.js",
    "viewer.js",
    "strip.js",
    "main.js",
)

_JSON = str.maketrans({char: f"\\u{ord(char):04x}" for char in "<>&\u2028\u2029"})


def write_page(report: Report) -> Path:
    """Write ``report.html`` beside ``report.md`` and return its path; equal records give equal bytes."""
    path = report.output / "report.html"
    write_atomically(path, page(report).encode())
    return path


def page(report: Report) -> str:
    """The text of the page, at most ``MOST_BYTES`` of UTF-8 where the numbers alone do not take more."""
    style, scripts, data = _asset("page.css"), list(_scripts()), page_data(report)
    charts = "".join(_charts(report))
    taken = [style, *scripts, json_text(data), charts]
    held, shown = pictures(report, MOST_BYTES - OWN - sum(len(text.encode()) for text in taken))
    data |= {"pictures": shown}
    encoded = [base64.b64encode(content).decode() for content in held.contents]
    return Template(_asset("page.html")).substitute(
        title=escape(report.layout.title),
        policy=policy(scripts, style),
        style=style,
        counts=escape(counts(report.results)),
        top=section_html(report, TOP),
        limits=section_html(report, BOTTOM),
        charts=charts,
        provenance=_provenance(report),
        data=json_text(data),
        scripts="\n".join(f"<script>{script}</script>" for script in scripts),
        pictures="\n".join(
            f'<script type="text/plain" id="picture-{number}">{text}</script>' for number, text in enumerate(encoded)
        ),
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


def section_html(report: Report, name: str) -> str:
    """A section of report.md as HTML; links and pictures, which would be loaded, stay text.

    Columns of numbers get a class, since the policy takes no style of an element.
    """
    chosen = [section for section in sections() if section.name == name and section.applies(report)]
    text = blocks(block for section in chosen for block in section.render(report, []))
    reader = MarkdownIt("commonmark", {"html": False}).enable("table").disable(["link", "image", "autolink"])
    tokens = reader.parse(str(text))
    for token in tokens:
        if token.attrs.pop("style", None):
            token.attrs["class"] = "number"
    return str(reader.renderer.render(tokens, reader.options, {}))


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _asset(name: str, folder: str = "assets") -> str:
    return (files(__package__) / folder / name).read_text(encoding="utf-8")


def _scripts() -> Iterator[str]:
    yield from (_asset(name, "vendor") for name in VENDORED)
    yield from (f'"use strict";\n{_asset(name)}' for name in SCRIPTS)


def _charts(report: Report) -> Iterator[str]:
    """The charts of the report with their captions, as far as they are there."""
    paths = [path for name in ("report.md", "details.md") if (path := report.output / name).is_file()]
    for name, caption in FIGURE.findall("\n".join(path.read_text(encoding="utf-8") for path in paths)):
        path = report.figures / name
        if any(fnmatch(name, f"{pattern}.*") for pattern in CHARTS) and path.is_file():
            text = escape(_plain(caption))
            encoded = base64.b64encode(path.read_bytes()).decode()
            kind = "jpeg" if path.suffix == ".jpg" else "png"
            yield f'<figure><img alt="{text}" src="data:image/{kind};base64,{encoded}">'
            yield f"<figcaption>{text}</figcaption></figure>"


def _plain(markdown: str) -> str:
    """What Markdown of one line shows."""
    return re.sub(r"\\(?=[\\`*|~$_\]])|`", "", markdown)


def _provenance(report: Report) -> str:
    """What was run and on what; as in report.md without times and revisions, which provenance.json has."""
    rows = environment(report.provenance)
    lines = "".join(f"<tr><th scope=row>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in rows)
    config = report.description.config_text
    named = escape(report.description.config_file)
    text = f"<details><summary>Config {named}</summary><pre tabindex=0>{escape(config)}</pre></details>"
    displays = "".join(
        f"<details><summary>Display {escape(display.name)}</summary><p>{escape(display.heading)}</p><ul>"
        f"{''.join(f'<li>{escape(line)}</li>' for line in display.lines)}</ul></details>"
        for display in report.description.displays
    )
    return f"<table>{lines}</table>{displays}{text if config else ''}"
