"""table.tex: the headline table of every display for a paper, one column (84 mm) wide, with booktabs and siunitx."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence

from .phrases import marked
from .results import Results, rounded
from .scores import DOMAIN_NAMES, Score
from .statistics import LEVEL, NONE, SIGNIFICANCE, Estimate, PairedTest
from .text import FILES, words

_HEAD = """% The headline table of every display, with the numbers of table.csv and tests.csv.
% In the preamble: \\usepackage{booktabs,siunitx}. A table is 84 mm wide at most, its type 7 pt (\\scriptsize at 10 pt).
"""
_LABEL_MM = 27  # room for a method's label, which is broken into lines
_LONGEST, _PIECE = 24, 8  # letters of a word that fit into a line, and between breaks of one that does not
_NONE = "{--}"
# A column of a table, or two or three that share a heading: specification, heading, and a text a row with & between the
# columns.
_Column = tuple[str, str, Sequence[str]]
_SPECIAL = {
    "\\": r"\textbackslash{}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\char34{}",
    "_": r"\_\allowbreak{}",
    **{character: f"\\{character}" for character in "{}$&#%"},
    **{character: f"{{{character}}}" for character in "[]*"},  # after \\\\ they would belong to it
}
_LIGATURE = re.compile(r"([-,'`])(?=\1)|[!?](?=`)")  # signs that the next one would change


def escape(text: object) -> str:
    """``text`` as plain text on one line of LaTeX: no command, no comment, no end of a cell.

    Letters beyond Latin take LuaLaTeX or XeLaTeX, as they do in any other text.
    """
    line = " ".join(str(text).split())
    line = "".join(character if character.isprintable() else "?" for character in line)
    return _LIGATURE.sub(r"\g<0>{}", "".join(_SPECIAL.get(character, character) for character in line))


def latex_tables(results: Results) -> str:
    """A table for every display with a complete method, in LaTeX."""
    return _HEAD + "".join(_table(results, name) for name in results.conditions if _complete(results, name))


def _table(results: Results, condition: str) -> str:
    specs, headings, columns = zip(*_columns(results, condition), strict=True)
    return "\n".join(
        [
            r"\begin{table}",
            r"  \centering\scriptsize\setlength{\tabcolsep}{2pt}\setlength{\belowcaptionskip}{4pt}",
            f"  \\caption{{{' '.join(_caption(results, condition))}}}",
            f"  \\label{{tab:{_slug(results.study.name)}-{_slug(condition)}}}",
            f"  \\begin{{tabular}}{{@{{}}{' '.join(specs)}@{{}}}}",
            r"    \toprule",
            f"    {' & '.join(headings)} \\\\",
            r"    \midrule",
            *(f"    {' & '.join(cells)} \\\\" for cells in zip(*columns, strict=True)),
            r"    \bottomrule",
            r"  \end{tabular}",
            r"\end{table}",
            "",
        ]
    )


def _columns(results: Results, condition: str) -> Iterator[_Column]:
    labels, score, ssim = _complete(results, condition), results.headline, _ssim(results)
    rows = [results.rows[label, condition] for label in labels]
    unit = f" [{escape(score.unit)}]" if score.unit else ""
    names = [" ".join(map(_breakable, marked(results, label, condition).split())) for label in labels]
    yield rf">{{\raggedright\arraybackslash}}p{{{_LABEL_MM}mm}}", "method", names
    yield _pair(score, f"{escape(score.title)}{unit}", [score.of(row) for row in rows])
    if known := _tests(results, condition):
        tests = [known.get(label) for label in labels]
        spec, heading, cells = _pair(
            score, rf"$\Delta${unit}", [test.estimate if test else NONE for test in tests], "+"
        )
        stars = ["*" if test and test.is_shown else "" for test in tests]
        shown = [f"{cell} & {star}" for cell, star in zip(cells, stars, strict=True)]
        yield rf"{spec}@{{}}l", heading.replace("{2}", "{3}", 1), shown
    if ssim:
        yield _single(escape(ssim.title), [_digits(ssim, row[ssim.column]) for row in rows])
    if _counts_captures(results, condition):
        yield _single("captures", [f"{row['total_captures']:.0f}" for row in rows])


def _breakable(word: str) -> str:
    """A word that can be broken within, where it is longer than a line."""
    length = _PIECE if len(word) > _LONGEST else len(word)
    return r"\allowbreak{}".join(escape(word[start : start + length]) for start in range(0, len(word), length))


def _single(heading: str, cells: list[str]) -> _Column:
    return _numeric(cells), f"{{{heading}}}", cells


def _pair(score: Score, heading: str, estimates: Sequence[Estimate], sign: str = "") -> _Column:
    """Means and half of their intervals in two columns."""
    means = [_digits(score, each.mean, bool(sign)) for each in estimates]
    halves = [_digits(score, (rounded(each.high) - rounded(each.low)) / 2) for each in estimates]
    none = rf"\multicolumn{{2}}{{c}}{_NONE}"
    cells = [none if mean == _NONE else f"{mean} & {half}" for mean, half in zip(means, halves, strict=True)]
    spec = rf"{_numeric(means, sign)}@{{$\,\pm\,$}}{_numeric(halves)}"
    return spec, rf"\multicolumn{{2}}{{c}}{{{heading}}}", cells


def _numeric(cells: Sequence[str], sign: str = "") -> str:
    """The kind of a column of numbers, with room for these."""
    numbers = [cell for cell in cells if cell != _NONE] or ["0"]
    parts = [number.lstrip("+-").partition(".") for number in numbers]
    whole, digits = (max(len(part[index]) for part in parts) for index in (0, 2))
    sign = sign or "-" * any(number.startswith("-") for number in numbers)
    return f"S[table-format={sign}{whole}.{digits},retain-explicit-plus]"


def _digits(score: Score, value: float, signed: bool = False) -> str:
    return _NONE if math.isnan(value) else score.number(rounded(value), signed)


def _complete(results: Results, condition: str) -> list[str]:
    """The methods with a score for every target: only their means may be compared."""
    return [label for label in results.methods(condition) if results.is_complete(label, condition)]


def _tests(results: Results, condition: str) -> dict[str, PairedTest]:
    """The tests against the baseline on a display, by the tested method; empty without a baseline."""
    return {test.second: test for test in results.tests.values() if test.condition == condition}


def _ssim(results: Results) -> Score | None:
    """SSIM of the main table, where it is not the headline."""
    return next((score for score in results.leading[1:] if score.metric == "ssim"), None)


def _counts_captures(results: Results, condition: str) -> bool:
    """Whether the captures behind every row are known."""
    captures = (results.rows[label, condition]["total_captures"] for label in _complete(results, condition))
    return not any(map(math.isnan, captures))


def _caption(results: Results, condition: str) -> Iterator[str]:
    """What was measured, on what, over what, and what the signs mean."""
    score, ssim, size = results.headline, _ssim(results), results.facts.panel(condition)
    display = f"{_what(results)}{f', panel {size[0]} x {size[1]} pixels' if size else ''}"
    same = ssim is not None and ssim.domain == score.domain
    names = [score.title if same else _named(score), *([_named(ssim)] if ssim else [])]
    n, clusters = len(results.targets), len(set(results.clusters))
    among = f"{n} targets in {clusters} clusters" if clusters != n else f"{n} targets"
    compared = f"{results.text.scored}s against {results.text.truth}s"
    yield escape(f"{words(names)} of {compared} on {condition} ({display}): means over {among}.")
    over = "clusters" if clusters != n else "targets"
    yield f"$\\pm$: half of the {100 * LEVEL:.0f}\\,\\% interval (Student's t over {over})."
    if _tests(results, condition):
        count = sum(not math.isnan(test.p) for test in results.tests.values())
        yield f"$\\Delta$: paired difference from {escape(results.baseline)}."
        yield (
            f"*: adjusted $p < {SIGNIFICANCE:g}$ (sign flips of {over}, {count} comparisons)."
            if count
            else "Not tested."
        )
    if _counts_captures(results, condition):
        yield "Captures: all that a method took, for its training and for these targets."


def _what(results: Results) -> str:
    if results.study.measure == FILES:
        return "photographs from files"
    return "a trained network" if results.facts.network else "real" if results.study.display.real else "simulated"


def _named(score: Score) -> str:
    return f"{score.title} in {DOMAIN_NAMES[score.domain]}" if score.domain else score.title


def _slug(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9.]+", "-", text)
