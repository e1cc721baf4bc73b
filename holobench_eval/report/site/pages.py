"""The page of a method, of a display, and of a study."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from inspect import getdoc
from pathlib import Path

from markdown_it import MarkdownIt
from markupsafe import Markup

from ...core import plugins
from ..data.error_budget import budgets
from ..data.text import FILES, percent
from ..description import basis
from .board import MEASURED, Names, board
from .checks import LONGEST
from .displays import Display, ancestors, counted, parameters, stage_title
from .html import joined, listed, page, slug, swatch, table
from .intake import Source
from .pictures import Picture
from .standing import Group

REPORT = ("report.html", "report.md")
ANSWERS = ("## Question", "## Answer")
FACTS = ("package", "harness", "revision", "dirty", "command", "config_sha256", "python", "platform", "cpu", "gpu",
         "device", "threads", "workers", "started", "ended")  # fmt: skip
LONGEST_TEXT = 40_000  # characters of report.md, of which question and answer are the first


@dataclass(frozen=True)
class Shown:
    """The pictures of a study: what the site has of its figures and thumbnails, and how many figures there are."""

    figures: Sequence[Picture]
    thumbnails: Sequence[Picture]
    count: int


def method_page(method: str, groups: Sequence[Group], names: Names, pictures: Sequence[tuple[str, Picture]]) -> bytes:
    """The page of a method: every display that it was measured on."""
    names = replace(names, up="../")
    rows = [row for group in groups for row in group.rows if row.method == method]
    labels = {(row.label, row.source.name): row.source.parameters.get(row.label, "") for row in rows}
    settings = [
        Markup("<strong>{}</strong> in {}: <code>{}</code>").format(label, study, text)
        for (label, study), text in labels.items()
        if text not in ("", "{}")
    ]
    categories = ", ".join(dict.fromkeys(row.category for row in rows))
    body = Markup("<p>{}{}</p>\n<p>{}</p>\n{}{}{}").format(
        swatch(method),
        about(method),
        f"Category: {categories}. Displays: {len({row.display.title for row in rows})}. Scores compare within a group; "
        "ranks are those among all methods of the group.",
        board(groups, names, rows),
        Markup("<details><summary>Parameters</summary>{}</details>").format(listed(settings)) if settings else "",
        _gallery("Captures", pictures),
    )
    return page(method, body, depth=1)


@lru_cache(maxsize=256)
def about(method: str) -> str:
    """What a method of the package is. Others' files are not opened."""
    if method not in plugins.names("methods"):
        return "A method that does not come with this package; its folder of results tells nothing of its code."
    return " ".join((getdoc(plugins.find("methods", method)) or "").partition("\n\n")[0].replace("`", "").split())


def display_page(
    display: Display,
    groups: Sequence[Group],
    names: Names,
    sheet: Picture | None,
    pictures: Sequence[tuple[str, Picture]],
) -> bytes:
    """The page of a display: its stages and their sources, its error budget, and every method's scores."""
    names = replace(names, up="../")
    own = [group for group in groups if group.display.title == display.title]
    body = Markup("{}\n<h2>Scores</h2>\n{}{}{}{}{}").format(
        _what(display),
        board(own, names),
        _budgets(display, own, names),
        _stages(display),
        _gallery("Stages", [(f"../pictures/displays/{slug(display.title)}.png", sheet)] if sheet else []),
        _gallery("Pictures", pictures),
    )
    return page(f"Display {display.marked}", body, depth=1)


def _what(display: Display) -> Markup:
    profile = display.profile
    if profile is not None:
        text = f"{profile.description} {sentence(basis(profile))}"
        return Markup("<p>{}</p><p>Version {}, sha256 {}.</p>").format(text, profile.version, display.digest)
    told = {
        "real": "A real bench, as its folder says: nothing is simulated, and deviations from its nominal optics are "
        "not known.",
        "learned": "A trained, frozen network in the place of a display: scores say how well a method exploits it.",
        FILES: "Photographs that were given as files; how they were taken is not known.",
        "simulated": "A simulated display that does not come with this version of the package, so that its stages are "
        "not known here.",
    }[display.kind]
    other = (
        f" The package has another profile by the name {display.name}; scores of the two do not compare."
        if display.is_other
        else ""
    )
    digest = Markup("<p>sha256 {}.</p>").format(display.digest) if display.kind != FILES else ""
    return Markup("<p>{}{}</p>{}").format(told, other, digest)


def _budgets(display: Display, groups: Sequence[Group], names: Names) -> Markup:
    """What of the error of the display's captures each prediction explains, from every study with error budgets."""
    sources = {row.source.folder: row.source for group in groups for row in group.rows}.values()
    found = [(source, budget) for source in sources for budget in budgets(source.results)]
    parts = []
    for source, budget in found:
        if budget.condition != display.name:
            continue
        rows = (
            (
                part.label,
                percent(part.share),
                "–" if part.gain is None else source.results.headline.estimate(part.gain, True),
            )
            for part in budget.parts
        )
        headings = ("explained by", "share of the error [%]", "gain of captures without it and those before it [dB]")
        parts.append(
            Markup(
                "<h2>Error budget</h2><p>From {}, over {} targets: what the error of the captures is made of.</p>{}"
            ).format(names.study(source), budget.psnr.n, table("Error budget", headings, rows))
        )
    return joined(parts)


def _stages(display: Display) -> Markup:
    if display.profile is None:
        return Markup("")
    parts = []
    for name in (display.name, *ancestors(display.profile)):
        found = parameters(name)
        counts = counted(found)
        heading = "Stages and their sources" if name == display.name else f"Values of {name}"
        note = "" if name == display.name else f"They hold where {display.name} gives none. "
        text = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
        rows = (
            (stage_title(each.stage) if each.stage else "bench", each.key, each.value, each.basis, each.source or "–")
            for each in found
        )
        headings = ("stage", "parameter", "value", "basis", "what the profile says of it")
        parts.append(
            Markup(
                "<h2>{}</h2><p>{}Of {} parameters: {}. Fitted, drawn and assumed are what the profile calls so; stated "
                "is all else that it says something of.</p>{}"
            ).format(heading, note, len(found), text, table(heading, headings, rows, numbers=False))
        )
    effects = listed(
        Markup("<strong>{}</strong>: {}").format(e.name.replace("_", " "), e.text) for e in display.profile.effects()
    )
    return Markup("{}<details><summary>Effects, in the order of the light</summary>{}</details>").format(
        joined(parts), effects
    )


def study_page(source: Source, groups: Sequence[Group], names: Names, shown: Shown) -> bytes:
    """The page of a study: its question and answer, its scores, where its numbers come from, and pictures."""
    names = replace(names, up="../")
    rows = [row for group in groups for row in group.rows if source in row.sources]
    own = [group for group in groups if any(row in rows for row in group.rows)]
    folder = names.studies[str(source.folder)]
    figures = [(f"../pictures/{folder}/{picture.name}", picture) for picture in shown.figures]
    thumbnails = [(f"../pictures/{folder}/{picture.name}", picture) for picture in shown.thumbnails]
    rest = shown.count - len(shown.figures)
    more = f" {rest} more figures are in the folder of the report." if rest else ""
    changed = f" {source.changed} changes of its displays are in the report alone." if source.changed else ""
    body = Markup("<p>{}</p>{}\n{}\n<h2>Scores</h2>{}\n{}\n{}{}").format(
        f"{sentence(MEASURED[source.measure])} Whose result: {source.by or 'own'}.{changed}{more}",
        _reports(source),
        _answer(source.folder),
        board(own, names, rows),
        _origin(source),
        _gallery("Figures", figures),
        _gallery("Captures", thumbnails),
    )
    return page(f"Study {source.name}", body, depth=1)


def _reports(source: Source) -> Markup:
    """Where an own report lies, as text: it is no part of the site, and need not be near it."""
    files = [name for name in REPORT if (path := source.folder / name).is_file() and not path.is_symlink()]
    if source.by or not files:
        return Markup("")
    folder = "/".join(source.folder.resolve().parts[-2:])
    paths = Markup(", ").join(Markup("<code>{}/{}</code>").format(folder, name) for name in files)
    return Markup("<p>Its report, which is no part of this site: {}.</p>").format(paths)


def _answer(folder: Path) -> Markup:
    """Question and answer of report.md. Links and pictures stay text."""
    path = folder / "report.md"
    if path.is_symlink() or not path.is_file():
        return Markup("<p>The folder has no report.md, so that question and answer of the study are not known.</p>")
    with path.open(encoding="utf-8", errors="replace") as file:
        text = file.read(LONGEST_TEXT)
    parts = re.split(r"^(?=## )", text, flags=re.MULTILINE)
    title = next((line.removeprefix("# ") for line in text.splitlines() if line.startswith("# ")), "")
    chosen = [part for part in parts if part.startswith(ANSWERS)]
    reader = MarkdownIt("commonmark", {"html": False}).enable("table").disable(["link", "image", "autolink"])
    return Markup('<div class="prose"><p><strong>{}</strong></p>{}</div>').format(
        reader_text(title), Markup(reader.render("\n".join(chosen)))
    )


def sentence(text: str) -> str:
    """A text as a sentence: a capital and a full stop."""
    return f"{text[:1].upper()}{text[1:]}."


def reader_text(text: str) -> str:
    """A heading of Markdown as plain text."""
    return re.sub(r"\\(?=[\\`*|~$_\]])", "", text)


def _origin(source: Source) -> Markup:
    known, packages = source.known, source.known.get("packages")
    facts = [(name, known.get(name)) for name in FACTS]
    if isinstance(packages, dict):
        facts += [(f"package {name}", value) for name, value in packages.items()]
    if isinstance(known.get("profiles"), dict):
        facts += [(f"display {name}", profile["sha256"]) for name, profile in known["profiles"].items()]
    rows = [(name.replace("_", " "), str(value)[:LONGEST]) for name, value in facts if value not in (None, "")]
    return Markup("<h2>Origin of the numbers</h2>{}").format(table("Origin", ("fact", "value"), rows, numbers=False))


def _gallery(title: str, pictures: Sequence[tuple[str, Picture]]) -> Markup:
    """Pictures with their captions; (address, picture)."""
    if not pictures:
        return Markup("")
    shown = joined(
        Markup(
            '<figure><a href="{0}"><img src="{0}" alt="{1}" width="{2}" height="{3}" loading="lazy"></a>'
            "<figcaption>{1}</figcaption></figure>\n"
        ).format(address, picture.caption, picture.width, picture.height)
        for address, picture in pictures
    )
    return Markup('<h2>{}</h2><div class="gallery">{}</div>').format(title, shown)
