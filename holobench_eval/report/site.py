"""One page of cards over many reports: a card for each display of each study, from the board.json files.

It is one file, which loads nothing. What stands in a report may come from anybody: every text of it is escaped.
"""

from __future__ import annotations

import base64
import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup
from PIL import Image

from ..core.errors import UserError, reason
from ..core.io import TEMPORARY, read_text, write_atomically
from ..display.simulated.profile import load_profile, names
from ..display.simulated.shelf import installed
from ..study.running import provenance
from .markdown import captions
from .page import asset, plain, policy, templates
from .results import MOST_BYTES
from .scores import Score, parse
from .statistics import Estimate
from .text import grouped, number

MARK = '<meta name="generator" content="holoeval site">'  # in a page that this module wrote
PICTURE, ROOM = "answer-pictures.jpg", 1_200_000  # the picture of a card, and the most bytes of it
BEST = 3  # rows of a group at most: those of its first letter
_ANSWER = re.compile(r"^## Answer\n(.*?)(?=^#|\Z)", re.MULTILINE | re.DOTALL)
# A choice in the list hides the sections of other displays; the last choice hides none.
_CHOICE = "body:has(#display option:nth-child({0}):checked) main > section:not(:nth-of-type({0})) {{ display: none }}\n"


def write_site(given: Sequence[Path], output: Path) -> tuple[int, list[Path]]:
    """Write the page over folders of reports; return how many there are, and the folders beside them without any.

    given: reports, or folders of reports. UserError: a file of a report is damaged or missing, or the output holds
    anything else than such a page. Nothing is written then.
    """
    reports, without = _reports(given)
    _refuse_others(output, reports)
    displays = grouped((card["display"], card) for folder in reports for card in _cards(folder, output))
    # displays of many studies first, and in each the studies with ``board: true``
    sections = sorted(displays.values(), key=lambda cards: -len(cards))
    choices = "".join(map(_CHOICE.format, range(1, len(sections) + 1)))
    style = asset("page.css") + (files(__package__) / "assets" / "site.css").read_text(encoding="utf-8") + choices
    page = (
        templates("holobench_eval.report", "assets")
        .get_template("site.html")
        .render(
            mark=Markup(MARK),
            policy=policy([], style),
            style=Markup(style),
            displays=[sorted(cards, key=lambda card: not card["first"]) for cards in sections],
            without=without,
        )
    )
    write_atomically(output / "index.html", f"{page}\n".encode())
    return len(reports), without


def _reports(given: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """The folders of reports, and those beside them that hold none. UserError: no report in one of those given."""
    reports, without = dict[Path, Path](), list[Path]()
    for folder in given:
        if not folder.is_dir():
            raise UserError(f"{folder}: no such folder; expected a report, or a folder of reports")
        below = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
        own = [folder] if _is_report(folder) else [path for path in below if _is_report(path)]
        if not own:
            raise UserError(f"{folder}: no report in it; expected records.csv, here or a level below")
        without += [path for path in below if path not in own and own != [folder]]
        reports |= {path.resolve(): path for path in own if path.resolve() not in reports}
    return list(reports.values()), without


def _is_report(folder: Path) -> bool:
    return any((folder / name).exists() for name in ("records.csv", provenance.FILE))


def _refuse_others(output: Path, reports: Sequence[Path]) -> None:
    """UserError: the output is no folder, holds anything else than an earlier page, or overlaps with a report."""
    if output.is_symlink() or (output.exists() and not output.is_dir()):
        raise UserError(f"--output {output}: not a folder; expected a new one, or that of an earlier site")
    for path in sorted(output.iterdir()) if output.exists() else ():
        is_page = path.name == "index.html" and path.is_file() and MARK in path.read_text("utf-8", "replace")
        if path.is_symlink() or not (is_page or path.name.startswith(TEMPORARY)):
            raise UserError(
                f"--output {output}: holds {path.name!r}, which is no file of a site; expected a new folder, or an "
                "earlier site and nothing else"
            )
    for report in reports:
        if output.resolve().is_relative_to(report.resolve()) or report.resolve().is_relative_to(output.resolve()):
            raise UserError(f"--output {output}: overlaps with {report}; expected another folder")


def _cards(folder: Path, output: Path) -> list[dict[str, Any]]:
    """The displays of a report as the template takes them, all in text. UserError: one of its files is damaged."""
    try:
        board, known = json.loads(read_text(folder / "board.json", MOST_BYTES)), provenance.read(folder)
        score = parse(board["headline"]["key"])
        page = next((folder / name for name in ("report.html", "report.md") if (folder / name).is_file()), folder)
        study = {
            "title": str(board["title"]),
            "question": str(board["question"]),
            "address": quote(os.path.relpath(page, output).replace(os.sep, "/")),
            "heading": score.heading,
            "against": str(board["baseline"] or "nothing"),
            "targets": f"{board['targets']:d}",
            "processor": str(known.get("gpu") or known.get("cpu") or "a processor that is not recorded"),
            "first": known.get("board") is True,
        }
        cards = []
        for display in board["displays"]:
            title, about = _identity(folder, display["name"], known)
            floor = "" if display["floor"] is None else score.with_unit(float(display["floor"]))
            groups = [(str(group["name"]), [_row(row, score) for row in _best(group)]) for group in display["groups"]]
            answer = _answer(folder, display["name"], [each["name"] for each in board["displays"]])
            picture = _picture(folder) if display is board["displays"][0] else None
            own = {"display": title, "about": about, "floor": floor, "groups": groups}
            cards.append(study | own | {"answer": answer, "picture": picture})
        return cards
    except Exception as error:  # whatever a damaged file leads to
        raise UserError(f"{folder}: {reason(error)}; mend its files, or write the report again") from error


def _best(group: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The rows of the first letter of a group, or its first one where there are no letters."""
    rows: list[Mapping[str, Any]] = group["rows"]
    return [row for row in rows if row["tier"] and row["tier"] == rows[0]["tier"]][:BEST] or rows[:1]


def _row(row: Mapping[str, Any], score: Score) -> dict[str, str]:
    ends = [(row["difference"] or {}).get(end) for end in ("mean", "low", "high")]
    mean, low, high = (math.nan if end is None else float(end) for end in ends)
    change = Estimate(mean, low, high, 0, 0)
    unclear = "°" if row["verdict"] == "not shown to differ" else ""
    return {
        "method": str(row["method"]),
        "title": ", ".join(map(str, [row["title"] or row["method"], *row["marks"]])),
        "score": score.number(math.nan if row["score"]["mean"] is None else float(row["score"]["mean"])),
        "difference": "" if math.isnan(change.mean) else score.estimate(change, signed=True) + unclear,
        "verdict": str(row["verdict"] or ""),
        "photographs": row["camera"],
        "seconds": number(row["seconds"]),
    }


def _identity(folder: Path, name: str, known: Mapping[str, Any]) -> tuple[str, str]:
    """Title and description of a display, and of a twin how far it can be trusted.

    They are those of this package, or of another, that has the display by this digest. Another display or version has
    the beginning of its digest beside its name, or its study.
    """
    kind = known.get("displays", {}).get(name, "simulated")
    digest = known.get("profiles", {}).get(name, {}).get("sha256", "")
    own = [name] if name in {*names(), *names(family=True)} else []
    for shown in [*own, *installed()] if kind == "simulated" else ():
        with suppress(UserError):  # of others' files
            if (profile := load_profile(shown)).digest == digest:
                trust = profile.twin.words
                return shown, f"{profile.description}{f' It is {trust}.' if trust else ''}"
    other = ", ".join(filter(None, (kind if kind != "simulated" else "", digest[:8] or folder.resolve().name)))
    return f"{name} ({other})", "Another display, or another version of one, than is installed here."


def _answer(folder: Path, name: str, displays: Sequence[str]) -> list[str]:
    """The answer of report.md: what it says of no display alone, then what it says of this one."""
    text = _ANSWER.search(read_text(folder / "report.md", MOST_BYTES))
    lines = [plain(line[2:]) for line in (text[1] if text else "").splitlines() if line.startswith("- ")]
    general = [
        line for line in lines if not line.startswith(tuple(f"{each}{sign} " for each in displays for sign in ":,"))
    ]
    own = [line.removeprefix(f"{name}: ") for line in lines if line.startswith((f"{name}: ", f"{name}, "))]
    return [*general, *own]


def _picture(folder: Path) -> dict[str, Any] | None:
    """The pictures that answer, decoded once, so that they are whole."""
    path = folder / "figures" / PICTURE
    if not path.is_file() or path.stat().st_size > ROOM:
        return None
    with Image.open(path, formats=("JPEG",)) as picture:
        picture.load()
    content = base64.b64encode(path.read_bytes()).decode()
    caption = plain(captions(folder).get(PICTURE, "Pictures of the report"))
    return {"content": content, "width": picture.width, "height": picture.height, "caption": caption}
