"""report.html: the numbers and pictures of a study in one file, to sort, to filter and to look at; no network.

Texts are those of report.md and details.md, numbers those of board.json, table.csv and records.csv. What comes from
files cannot become markup: numbers and names are JSON in which ``<``, ``>`` and ``&`` are escaped, the scripts write
text nodes only, and the template escapes what stands in it. The content security policy lets no request leave the page
and no script run but those of this package.
"""

from __future__ import annotations

import base64
import hashlib
import html
import io
import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from fnmatch import fnmatch
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markdown_it import MarkdownIt
from markupsafe import Markup
from matplotlib import colormaps
from PIL import Image

from ..core.io import write_atomically
from .board import board, groups_of
from .charts.look import looks
from .columns import costs
from .facts import ORACLE
from .markdown import DETAILS, FIGURE, REPORT, captions
from .results import Results, to_json
from .scores import Score, parse
from .story import Report

Json = dict[str, Any]
Cell = tuple[str, str, str]  # method, display, target; a target itself has no method

MOST_BYTES = 24_000_000  # of the whole page
OWN = 200_000  # bytes that the template, the policy and the origin may take beside scripts, data, charts and pictures
CHARTS = ("quality-*", "error-budget*", "sweep-*", "training-*", "stages-*")  # figures of the report that the page has
SCRIPTS = ("dom", "state", "pixels", "flip", "board", "wall")

ESSENTIAL = ("photographs", "cpu_s", "panel_time", "memory_mib")  # columns of costs that stand first
FIRST = 3  # targets whose pictures come before those of the others
COPIED_BYTES = 1_200_000  # of all pictures that a report keeps: thirty reports leave a clone below 60 MB
QUALITY = 75  # of WebP, 0 to 100: two thirds of the bytes of 85, 1 dB further from the capture
MARK, SAYS = "README.md", b"Small copies of the pictures of the report beside this folder, written with it.\n"

_LINK = re.compile(r"\[([^\]]+)(?<!\\)\]\(([^)#]+)[^)]*\)")  # in Markdown whose names are escaped
_NO_HEAD = re.compile(r"<thead>\s*<tr>\s*(<th></th>\s*)+</tr>\s*</thead>\s*")  # of a table of names and values
_JSON = str.maketrans({char: f"\\u{ord(char):04x}" for char in "<>&\u2028\u2029"})


def write_page(report: Report) -> Path:
    """Write ``report.html`` beside ``report.md`` and return its path; equal records give equal bytes.

    It has at most ``MOST_BYTES`` where the numbers and charts alone do not take more.
    """
    style, data, charts, known = asset("page.css"), page_data(report), list(_charts(report)), files_of(report)
    scripts = [f'"use strict";\n{asset(f"{name}.js")}' for name in SCRIPTS]
    (title, question), *parts = sections((report.output / REPORT).read_text(encoding="utf-8"), "h1", "h2", "h3")
    origin = sections((report.output / DETAILS).read_text(encoding="utf-8"), "h2")
    taken = [style, *scripts, json_text(data), *(chart["source"] for chart in charts), *(text for _, text in origin)]
    held = pictures(report, known, MOST_BYTES - OWN - sum(len(text.encode()) for text in taken))
    template = templates("holobench_eval.report", "assets").get_template("page.html")
    text = template.render(
        title=title,
        question=question,
        policy=policy(scripts, style),
        style=Markup(style),
        answer=Markup(re.sub(r"(?s)(?<=</ul>).*", "", dict(parts).get("Answer", ""))),
        limits=dict(parts).get("Limits", ""),
        charts=charts,
        origin=origin,
        data=data,
        held=len(held),
        there=len(known),
        json=Markup(json_text(data | {"pictures": _numbers(report.results, held)})),
        scripts=map(Markup, scripts),
        contents=(base64.b64encode(content).decode() for content in held.values()),
    )
    write_atomically(report.output / "report.html", text.encode())
    return report.output / "report.html"


def page_data(report: Report) -> Json:
    """All numbers that the page draws, ready for JSON: no NaN, and rounded as in table.csv."""
    results, drawn = report.results, board(report.results).as_json()
    groups = [(part["name"], group) for part in drawn["displays"] for group in part["groups"]]
    rows = {(name, row["method"]): row for name, group in groups for row in group["rows"]}
    beside = dict.fromkeys(key for row in rows.values() for key in row["beside"])
    titles = {method: row["title"] for (_, method), row in rows.items()}
    columns = _columns(results, list(map(parse, beside)))
    group = groups_of(results)
    return {
        "question": drawn["question"],
        "headline": drawn["headline"] | columns[1],
        "baseline": drawn["baseline"],
        "words": {"scored": results.text.scored, "truth": results.text.truth},
        "displays": results.conditions,
        "changed": results.changed,
        "floors": {part["name"]: part["floor"] for part in drawn["displays"]},
        "columns": columns,
        "targets": results.targets,
        "groups": list(dict.fromkeys(group.values())),
        "methods": {
            label: {
                "title": titles.get(label) or label,
                "registered": results.names[label],
                "group": group[label],
                "oracle": results.category(label) == ORACLE,
                "colour": look.colour,  # the same as in the figures
            }
            for label, look in looks(results.names).items()
            if label in group
        },
        "rows": {
            name: [_row(results, label, name, rows.get((name, label), {})) for label in results.methods(name)]
            for name in [*results.conditions, *results.changed]
        },
        "magma": colormaps["magma"](range(256), bytes=True)[:, :3].tolist(),
    }


def _columns(results: Results, beside: list[Score]) -> list[Json]:
    """The columns of the board, those first that are seen before the reader asks for all.

    beside: the scores that stand beside the headline.
    """

    def of(score: Score, **more: Any) -> Json:
        ends = {"key": score.column, "low": score.statistic("_lo"), "high": score.statistic("_hi")}
        digits = len(score.number(0.0).partition(".")[2])
        return ends | {"heading": score.heading, "digits": digits, "higher": score.higher_is_better} | more

    headline, costly = results.headline, costs(results.table, results.text.each)
    gain = {"key": "difference", "low": "lowest", "high": "highest", "signed": True}
    gain["heading"] = f"difference to {results.baseline}{headline.brackets}"
    costly = {"photographs": "photographs", **costly}
    return [
        {"key": "tier", "heading": "letter", "first": True},
        of(headline, first=True),
        of(headline, first=True, **gain),
        *(of(score, first=True) for score in beside),
        *({"key": key, "heading": costly[key], "first": True} for key in ESSENTIAL if key in costly),
        {"key": "p", "heading": "adjusted p", "digits": 3},
        *(of(score) for score in results.leading if score not in (headline, *beside)),
        *({"key": key, "heading": heading} for key, heading in costly.items() if key not in ESSENTIAL),
    ]


def _row(results: Results, label: str, name: str, drawn: Json) -> Json:
    """A row: numbers of table.csv, the difference, the headline of each target.

    drawn: the row of board.json, empty for a changed display.
    """
    cells, gain = results.rows[label, name].to_dict(), results.gain(label, name)
    if gain and label != results.baseline:
        cells |= {"difference": gain.mean, "lowest": gain.low, "highest": gain.high}
        cells["p"] = (drawn.get("difference") or {}).get("p", math.nan)
    known: Json = {key: drawn[key] for key in ("tier", "marks", "verdict") if key in drawn}
    numbers = {key: to_json(value) for key, value in cells.items() if isinstance(value, (int, float))}
    values = list(map(to_json, results.values(label, name)))
    return {"method": label, "tier": "", "marks": [], "verdict": None, **known, "cells": numbers, "values": values}


def sections(text: str, *tags: str) -> list[tuple[str, Markup]]:
    """The sections of Markdown below headings of these tags, (heading, HTML of what follows), without figures.

    Links, which lead out of the page, are a text and a name in brackets. Columns of numbers get a class, since the
    policy takes no style of an element. A table has no row of empty headings.
    """
    reader = MarkdownIt("commonmark", {"html": False}).enable("table").disable(["link", "image", "autolink"])
    tokens = reader.parse(_LINK.sub(r"\1 (\2)", FIGURE.sub("", text)))
    for token in tokens:
        if token.attrs.pop("style", None):
            token.attrs["class"] = "number"
    starts = [index for index, token in enumerate(tokens) if token.type == "heading_open" and token.tag in tags]
    spans = list(pairwise([*starts, len(tokens)]))
    texts = (reader.renderer.render(tokens[start + 3 : end], reader.options, {}) for start, end in spans)
    headings = (plain(tokens[start + 1].content) for start, _ in spans)
    return [(heading, Markup(_NO_HEAD.sub("", text))) for heading, text in zip(headings, texts, strict=True)]


def _charts(report: Report) -> Iterator[Json]:
    """The charts of the report, as far as they are there: their names, sources and captions."""
    for name, caption in captions(report.output).items():
        path = report.figures / name
        if any(fnmatch(name, f"{pattern}.*") for pattern in CHARTS) and path.is_file():
            kind = "jpeg" if path.suffix == ".jpg" else "png"
            source = f"data:image/{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"
            yield {"name": path.stem, "source": source, "caption": plain(caption)}


def templates(package: str, folder: str) -> Environment:
    """The templates in a folder of a package: every text in them is escaped, and none may be missing."""
    loader = PackageLoader(package, folder)
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def asset(name: str) -> str:
    """A style sheet or a script of the page."""
    return (files(__package__) / "assets" / name).read_text(encoding="utf-8")


def json_text(value: Any) -> str:
    """JSON that is safe inside a script element: no character of it can end the element or open a comment."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":")).translate(_JSON)


def policy(scripts: list[str], style: str) -> str:
    """The content security policy: nothing is loaded, and only these scripts and this style are taken."""
    hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in (style, *scripts)]
    own, *allowed = (f"'sha256-{digest}'" for digest in hashes)
    return (
        f"default-src 'none'; script-src {' '.join(allowed)}; style-src {own}; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )


def plain(markdown: str) -> str:
    """What Markdown of one line shows."""
    return html.unescape(re.sub(r"\\(?=[\\`*|~$_\]])|`", "", markdown))


def files_of(report: Report) -> dict[Cell, Path]:
    """The files of targets and captures that are there: of a capture that of the first repeat with a score."""
    results, thumbnails, names = report.results, report.thumbnails, _pictured(report.results)
    done = results.done[results.done["condition"].isin(names)].drop_duplicates(["label", "condition", "target"])
    paths = {
        ("", name, target): thumbnails.of_target(target, results.shape(name))
        for name in dict.fromkeys(map(results.reference, names))
        for target in results.targets
    }
    for label, name, target, cell in done[["label", "condition", "target", "cell"]].to_numpy():
        paths[label, name, target] = thumbnails.of_capture(cell)
    return {cell: path for cell, path in paths.items() if path.is_file()}


def _pictured(results: Results) -> list[str]:
    return [name for name in [*results.conditions, *results.changed] if results.has_pictures(name)]


def pictures(
    report: Report,
    known: Mapping[Cell, Path],
    room: int,
    content: Callable[[Path], bytes] = Path.read_bytes,
    size: Callable[[bytes], int] = lambda content: -(-len(content) // 3) * 4,  # in base64
) -> dict[Cell, bytes]:
    """The pictures that fit into ``room`` bytes, those first that answer most; what comes together comes all or not.

    Of the ``FIRST`` targets whose differences between methods are nearest to the mean ones come those of all methods,
    first on the displays, then on each changed display; then target by target all. A target comes with its captures.
    """
    results, kept = report.results, dict[Cell, bytes]()
    names, near = [*results.conditions, *results.changed], results.near
    wanted = [(target, results.conditions) for target in near[:FIRST]]
    wanted += [(target, [name]) for target in near[:FIRST] for name in results.changed]
    for target, these in [*wanted, *((target, names) for target in near)]:
        cells = [cell for cell in known if cell[2] == target and (not cell[0] or cell[1] in these)]
        new = {cell: content(known[cell]) for cell in cells if cell not in kept}
        if (taken := sum(map(size, new.values()))) <= room:
            kept, room = kept | new, room - taken
    return kept


def _numbers(results: Results, held: Mapping[Cell, bytes]) -> Json:
    """The number of every picture by display, method ("": the target) and place of its target; None where it is not."""
    number = {cell: index for index, cell in enumerate(held)}.get
    return {
        name: {
            label: [number((label, name if label else results.reference(name), target)) for target in results.targets]
            for label in ("", *results.methods(name))
        }
        for name in _pictured(results)
    }


def keep_copies(report: Report) -> None:
    """Copy the thumbnails that answer most into ``pictures``, as WebP; those of an earlier run go.

    Nothing changes where a report is written again without its records, nor in a folder that is somebody else's.
    """
    folder, known = report.thumbnails.copies, files_of(report)
    is_ours = not folder.exists() or ((folder / MARK).is_file() and (folder / MARK).read_bytes() == SAYS)
    if not report.thumbnails.store.folder.is_dir() or not is_ours:
        return
    held = pictures(report, known, COPIED_BYTES, _encoded, len)
    kept = {f"{known[cell].stem}.webp": content for cell, content in held.items() if content}
    for old in folder.glob("*.webp"):
        if old.name not in kept:
            old.unlink()
    for name, content in {MARK: SAYS, **kept}.items() if kept else ():
        write_atomically(folder / name, content)


def _encoded(path: Path) -> bytes:
    """A picture as WebP; a copy as it is, and nothing of a damaged file."""
    if path.suffix == ".webp":
        return path.read_bytes()
    encoded = io.BytesIO()
    try:
        with Image.open(path) as picture:
            picture.save(encoded, "WEBP", quality=QUALITY, method=6)
    except (OSError, ValueError, Image.DecompressionBombError):
        return b""
    return encoded.getvalue()
