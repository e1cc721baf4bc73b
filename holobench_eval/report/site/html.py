"""The frame of a page and its small parts. Whatever is no ``Markup`` is escaped on its way in."""

from __future__ import annotations

import re
from collections.abc import Iterable
from importlib.resources import files

from markupsafe import Markup, escape

from ...core.hashing import digest
from ..charts.look.methods import BLACK, NEUTRAL, REGISTRY, look
from ..data.text import number

# Nothing is loaded but the files of the site; no form, no frame, no address of another place.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'"
)
# Names that become those of other names, or those of devices (on Windows).
_TAKEN = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])?|.*-[0-9a-f]{8}")
STYLES, SCRIPTS = ("page.css", "site.css"), ("leaderboard.js",)
# Markers in a box of 20 x 20, by matplotlib's names.
_SHAPES = {
    "o": "M10 3a7 7 0 1 0 .01 0z",
    "s": "M4 4h12v12H4z",
    "D": "M10 2l8 8-8 8-8-8z",
    "^": "M10 3l8 14H2z",
    "v": "M10 17L2 3h16z",
    "<": "M3 10l14-8v16z",
    ">": "M17 10L3 2v16z",
    "P": "M7 2h6v5h5v6h-5v5H7v-5H2V7h5z",
    "X": "M6 2l4 4 4-4 4 4-4 4 4 4-4 4-4-4-4 4-4-4 4-4-4-4z",
    "p": "M10 2l8 6-3 10H5L2 8z",
    "*": "M10 1l3 6 6 1-4.500 4.500 1 6.500-5.500-3-5.500 3 1-6.500L1 8l6-1z",
}


def slug(text: str) -> str:
    """A name as that of a file: no two names share one, on any file system."""
    plain = re.sub(r"[^a-z0-9_-]", "_", text.lower())[:100]
    return plain if plain == text and not _TAKEN.fullmatch(plain) else f"{plain}-{digest(text)[:8]}"


def page(title: str, body: Markup, depth: int = 0, scripts: bool = False) -> bytes:
    """A page of the site. depth: folders between it and the index."""
    up = "../" * depth
    styles = Markup("\n").join(Markup('<link rel="stylesheet" href="{}assets/{}">').format(up, name) for name in STYLES)
    script = Markup("\n").join(Markup('<script src="{}assets/{}" defer></script>').format(up, name) for name in SCRIPTS)
    frame = Markup(files(__package__).joinpath("assets", "page.html").read_text(encoding="utf-8"))
    return frame.format(
        policy=POLICY, title=title, styles=styles, scripts=script if scripts else "", up=up, body=body
    ).encode()


def joined(parts: Iterable[object]) -> Markup:
    """Parts one after another."""
    return Markup("").join(map(escape, parts))


def listed(items: Iterable[object]) -> Markup:
    """A list."""
    return Markup("<ul>{}</ul>").format(joined(Markup("<li>{}</li>\n").format(item) for item in items))


def table(caption: str, headings: Iterable[object], rows: Iterable[Iterable[object]], numbers: bool = True) -> Markup:
    """A table that scrolls by itself; the first cell of a row is its heading."""
    head = joined(Markup("<th scope=col>{}</th>").format(text) for text in headings)
    body = joined(
        Markup("<tr><th scope=row>{}</th>{}</tr>\n").format(
            first, joined(Markup("<td>{}</td>").format(cell) for cell in cells)
        )
        for first, *cells in rows
    )
    return Markup(
        '<div class="scroll" tabindex="0" role="region" aria-label="{0}"><table class="{1}"><caption class="hidden">{0}'
        "</caption><thead><tr>{2}</tr></thead><tbody>{3}</tbody></table></div>"
    ).format(caption, "plain" if numbers else "plain words", head, body)


def link(href: str, text: object) -> Markup:
    """A link within the site. href: made of slugs, never of names."""
    return Markup('<a href="{}">{}</a>').format(href, text)


def quiet(text: object) -> Markup:
    """What stands below a number."""
    return Markup('<span class="interval">{}</span>').format(text)


def swatch(method: str) -> Markup:
    """The mark of a method, with the colour and shape that it has in every figure."""
    found = look(method)
    return Markup('<svg class="mark {}{}" viewBox="0 0 20 20" aria-hidden="true"><path d="{}"/></svg>').format(
        _class(found.colour), " open" if method == "oracle" else "", _SHAPES[found.marker]
    )


def colours() -> str:
    """The style sheet of the marks' colours; on a dark page dark hues are mixed with white."""
    every = dict.fromkeys([*(colour for colour, _ in REGISTRY.values()), NEUTRAL])
    return "".join(f".{_class(colour)} {{ color: {_paint(colour)}; }}\n" for colour in every)


def _paint(colour: str) -> str:
    return "var(--text)" if colour == BLACK else f"color-mix(in oklab, {colour} var(--pure), white)"


def _class(colour: str) -> str:
    return f"c{colour.removeprefix('#')}"


def plain_number(value: float) -> str:
    """A number for people: three digits, a dash where it is unknown."""
    return number(float(value))
