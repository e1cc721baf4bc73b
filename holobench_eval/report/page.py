"""report.html: the numbers and pictures of a study in one file, to sort, to filter and to look at; no network.

Texts are those of report.md and details.md, numbers those of board.json, table.csv and records.csv. What comes from
files cannot become markup: numbers and names are JSON in which ``<``, ``>`` and ``&`` are escaped, the scripts write
text nodes only, and the template escapes what stands in it. The content security policy lets no request leave the page
and no script run but those of this package.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
from collections.abc import Callable, Iterator, Mapping
from fnmatch import fnmatch
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markdown_it import MarkdownIt
from markupsafe import Markup
from matplotlib import colormaps
from PIL import Image

from ..core.io import write_atomically
from ..study.scoring.pictures import LONGEST_THUMBNAIL
from .charts.look.methods import looks
from .data.board import GROUPS, board
from .data.columns import costs
from .data.layout import ORACLE
from .data.results import Results
from .data.scores import Score, parse
from .data.tables import to_json
from .markdown import DETAILS, FIGURE, REPORT, captions
from .section import Report

Json = dict[str, Any]
Cell = tuple[str, str, str]  # method, display, target; a target itself has no method

MOST_BYTES = 24_000_000  # of the whole page
OWN = 200_000  # bytes that the template, the policy and the origin may take beside scripts, data, charts and pictures
CHARTS = ("quality-*", "error-budget*", "sweep-*", "training-*", "stages-*")  # figures of the report that the page has
NUMBERS = ("quality-*", "error-budget*", "training-*")  # those of lines and text alone, which may change their colours
SCRIPTS = ("dom", "state", "pixels", "flip", "board", "wall")

FIRST = 3  # targets whose pictures come before those of the others
COPIED_BYTES = 1_200_000  # of all pictures that a report keeps: thirty reports leave a clone below 60 MB
QUALITY = 75  # of WebP, 0 to 100: two thirds of the bytes of 85, 1 dB further from the capture
MARK, SAYS = "README.md", b"Small copies of the pictures of the report beside this folder, written with it.\n"

_LINK = re.compile(r"\[([^\]]+)(?<!\\)\]\(([^)#]+)[^)]*\)")  # in Markdown whose names are escaped
_JSON = str.maketrans({char: f"\\u{ord(char):04x}" for char in "<>&\u2028\u2029"})


def write_page(report: Report) -> Path:
    """Write ``report.html`` beside ``report.md`` and return its path; equal records give equal bytes."""
    path = report.output / "report.html"
    write_atomically(path, page(report).encode())
    return path


def page(report: Report) -> str:
    """The text of the page, at most ``MOST_BYTES`` of UTF-8 where the numbers alone do not take more."""
    style, data, charts = asset("page.css"), page_data(report), list(_charts(report))
    scripts = [f'"use strict";\n{asset(f"{name}.js")}' for name in SCRIPTS]
    (title, question), *parts = sections((report.output / REPORT).read_text(encoding="utf-8"), "h1", "h2", "h3")
    origin = sections((report.output / DETAILS).read_text(encoding="utf-8"), "h2")
    taken = [style, *scripts, json_text(data), *(chart["source"] for chart in charts), *(text for _, text in origin)]
    room = MOST_BYTES - OWN - sum(len(text.encode()) for text in taken)
    known = files_of(report)
    held = _fitting(groups(report, known), room, Path.read_bytes, lambda content: -(-len(content) // 3) * 4)
    data |= {"pictures": _numbers(report.results, held)}
    answer = dict(parts).get("Answer", Markup())
    return templates("holobench_eval.report", "assets").get_template("page.html").render(
        title=title,
        question=question,
        policy=policy(scripts, style),
        style=Markup(style),
        answer=Markup("{}</ul>").format(Markup(answer.partition("</ul>")[0])) if "</ul>" in answer else "",
        limits=dict(parts).get("Limits", ""),
        charts=charts,
        origin=origin,
        data=data,
        note=_note(report, len(held), len(known)),
        json=Markup(json_text(data)),
        scripts=map(Markup, scripts),
        contents=(base64.b64encode(content).decode() for content in held.values()),
    )


def page_data(report: Report) -> Json:
    """All numbers that the page draws, ready for JSON: no NaN, and rounded as in table.csv."""
    results, drawn = report.results, board(report.results).as_json()
    rows = {(shown["name"], row["method"]): row for shown in drawn["displays"] for part in shown["groups"] for row in part["rows"]}
    columns = list(_columns(results, [key for row in rows.values() for key in row["beside"]]))
    colours = looks(results.names)
    listed = {name: results.methods(name) for name in [*results.conditions, *results.changed]}
    category = dict(zip(results.table["label"], results.table["category"], strict=True))
    titles = {method: row["title"] for (_, method), row in rows.items()}
    return {
        "question": drawn["question"],
        "headline": drawn["headline"] | {"digits": columns[1]["digits"], "column": columns[1]["key"]},
        "baseline": drawn["baseline"],
        "words": {"scored": results.layout.text.scored, "truth": results.layout.text.truth},
        "displays": results.conditions,
        "changed": results.changed,
        "floors": {shown["name"]: shown["floor"] for shown in drawn["displays"]},
        "columns": columns,
        "targets": results.targets,
        "groups": list(GROUPS.values()),
        "methods": {
            label: {
                "title": titles.get(label) or label,
                "registered": results.names[label],
                "group": GROUPS[category[label]],
                "oracle": category[label] == ORACLE,
                "colour": colours[label].colour,  # the same as in the figures
            }
            for label in dict.fromkeys(label for labels in listed.values() for label in labels)
        },
        "rows": {
            name: [_row(results, label, name, rows.get((name, label), {}), columns) for label in labels]
            for name, labels in listed.items()
        },
        "values": {
            name: {label: [to_json(value) for value in results.values(label, name)] for label in labels}
            for name, labels in listed.items()
        },
        "magma": colormaps["magma"](range(256), bytes=True)[:, :3].tolist(),
    }


def _columns(results: Results, beside: list[str]) -> Iterator[Json]:
    """The columns of the board, those first that are seen before the reader asks for all.

    beside: keys of the scores that stand beside the headline.
    """
    def of(score: Score, first: bool) -> Json:
        ends = {"key": score.column, "low": score.statistic("_lo"), "high": score.statistic("_hi")}
        digits = len(score.number(0.0).partition(".")[2])
        return {**ends, "heading": score.heading, "digits": digits, "higher": score.higher_is_better, "first": first}

    headline, figures = results.headline, costs(results.table, results.layout.text.each)
    near = [score for score in map(parse, dict.fromkeys(beside))]
    yield {"key": "tier", "heading": "letter", "first": True}
    yield of(headline, True)
    if results.layout.baseline is not None:
        heading = f"difference to {results.layout.baseline}{headline.brackets}"
        yield of(headline, True) | {"key": "difference", "low": "lowest", "high": "highest", "heading": heading, "signed": True}
    yield from (of(score, True) for score in near)
    essential = ("photographs", "solving_s", "panel_time", "memory_mib")
    figures = {"photographs": "photographs", **figures}
    yield from ({"key": key, "heading": figures[key], "first": True} for key in essential if key in figures)
    yield {"key": "p", "heading": "adjusted p", "digits": 3}
    yield from (of(score, False) for score in results.leading if score not in (headline, *near))
    yield from ({"key": key, "heading": text} for key, text in figures.items() if key not in essential)


def _row(results: Results, label: str, name: str, drawn: Json, columns: list[Json]) -> Json:
    """A row: its values by column. drawn: the row of board.json, empty for a change of a display."""
    row, gain = results.row(label, name), drawn.get("difference")
    if not drawn and results.layout.baseline not in (None, label):
        other = results.estimate(results.values(label, name) - results.values(str(results.layout.baseline), name))
        gain = {"mean": to_json(other.mean), "low": to_json(other.low), "high": to_json(other.high)}
    wanted = [column[key] for column in columns for key in ("key", "low", "high") if key in column]
    cells = {key: to_json(row[key]) for key in wanted if key in row}
    if gain:
        cells |= {"difference": gain["mean"], "lowest": gain["low"], "highest": gain["high"], "p": gain.get("p")}
    once, each = row.get("training_captures", 0.0), row.get("captures", np.nan)
    cells |= {"once": to_json(once), "each": to_json(each), "photographs": to_json(np.nan_to_num(once) + each)}
    return {
        "method": label,
        "tier": drawn.get("tier", ""),
        "marks": drawn.get("marks", []),
        "scored": int(row["n"]),
        "verdict": drawn.get("verdict"),
        "cells": cells,
    }


def sections(text: str, *tags: str) -> list[tuple[str, Markup]]:
    """The sections of Markdown below headings of these tags, (heading, HTML of what follows), without figures.

    Links, which lead out of the page, are a text and a name in brackets. Columns of numbers get a class, since the
    policy takes no style of an element.
    """
    reader = MarkdownIt("commonmark", {"html": False}).enable("table").disable(["link", "image", "autolink"])
    tokens = reader.parse(_LINK.sub(r"\1 (\2)", FIGURE.sub("", text)))
    for token in tokens:
        if token.attrs.pop("style", None):
            token.attrs["class"] = "number"
    starts = [index for index, token in enumerate(tokens) if token.type == "heading_open" and token.tag in tags]
    return [
        (plain(tokens[start + 1].content), Markup(reader.renderer.render(tokens[start + 3 : end], reader.options, {})))
        for start, end in pairwise([*starts, len(tokens)])
    ]


def _charts(report: Report) -> Iterator[Json]:
    """The charts of the report, as far as they are there: their names, sources and captions."""
    for name, caption in captions(report.output).items():
        path = report.figures / name
        if any(fnmatch(name, f"{pattern}.*") for pattern in CHARTS) and path.is_file():
            kind = "jpeg" if path.suffix == ".jpg" else "png"
            source = f"data:image/{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"
            numbers = any(fnmatch(name, pattern) for pattern in NUMBERS)
            yield {"name": path.stem, "source": source, "caption": plain(caption), "numbers": numbers}


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
    return re.sub(r"\\(?=[\\`*|~$_\]])|`", "", markdown)


def files_of(report: Report) -> dict[Cell, Path]:
    """The files of targets and captures that are there: of a capture that of the first repeat with a score."""
    results, thumbnails = report.results, report.thumbnails
    names = [name for name in [*results.conditions, *results.changed] if results.has_pictures(name)]
    shown = results.done[results.done["condition"].isin(names)].drop_duplicates(["label", "condition", "target"])
    paths = {
        ("", name, target): thumbnails.of_target(target, results.shape(name))
        for name in dict.fromkeys(map(results.reference, names))
        for target in results.targets
    }
    for cell in shown.itertuples():
        paths[cell.label, cell.condition, cell.target] = thumbnails.of_capture(cell.cell)
    return {cell: path for cell, path in paths.items() if path.is_file()}


def groups(report: Report, known: Mapping[Cell, Path]) -> Iterator[dict[Cell, Path]]:
    """The pictures, those first that answer most; those of a target come with it.

    Of the ``FIRST`` targets whose differences between methods are nearest to the mean ones, with all methods, first
    those on the displays, then those on each changed display; then target by target all.
    """
    results = report.results
    if not known:
        return
    names = [*results.conditions, *results.changed]
    tables = [pd.DataFrame([results.values(label, name) for label in results.methods(name)]) for name in names]
    between = pd.concat([values - values.mean() for values in tables])
    away = between.sub(between.mean(axis=1), axis=0).abs().mean()
    near = [results.targets[index] for index in away.sort_values(kind="stable").index]
    wanted = [(target, results.conditions) for target in near[:FIRST]]
    wanted += [(target, [name]) for target in near[:FIRST] for name in results.changed]
    wanted += [(target, names) for target in near]
    for target, these in wanted:
        yield {cell: path for cell, path in known.items() if cell[2] == target and (not cell[0] or cell[1] in these)}


def _fitting(
    wanted: Iterator[dict[Any, Path]], room: int, content: Callable[[Path], bytes], size: Callable[[bytes], int]
) -> dict[Any, bytes]:
    """The contents of groups of files, first things first: what is new of a group comes all or, without room, not."""
    kept: dict[Any, bytes] = {}
    for group in wanted:
        new = {key: content(path) for key, path in group.items() if key not in kept}
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
        for name in [*results.conditions, *results.changed]
        if results.has_pictures(name)
    }


def _note(report: Report, held: int, there: int) -> str:
    scored = report.results.layout.text.scored
    if not there:
        return f"This page holds no pictures: there were no thumbnails of {scored}s when it was written."
    return (
        f"This page holds {f'all {there}' if held == there else f'{held} of {there}'} pictures of the study, 8-bit sRGB, "
        f"pixel for pixel from the records, or the report's WebP copies where these are not there; {scored}s are "
        f"registered and matched in intensity, and reduced where the longer side would exceed {LONGEST_THUMBNAIL} pixels."
    )


def keep_copies(report: Report) -> None:
    """Copy the thumbnails that answer most into ``pictures``, as WebP; those of an earlier run go.

    Nothing changes where a report is written again without its records, nor in a folder that is somebody else's.
    """
    folder = report.thumbnails.copies
    is_ours = not folder.exists() or ((folder / MARK).is_file() and (folder / MARK).read_bytes() == SAYS)
    if not report.thumbnails.store.folder.is_dir() or not is_ours:
        return
    wanted = ({path.stem: path for path in group.values()} for group in groups(report, files_of(report)))
    kept = {stem: content for stem, content in _fitting(wanted, COPIED_BYTES, _encoded, len).items() if content}
    for old in folder.glob("*.webp"):
        if old.stem not in kept:
            old.unlink()
    for name, content in {MARK: SAYS, **{f"{stem}.webp": content for stem, content in kept.items()}}.items():
        if kept:
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
