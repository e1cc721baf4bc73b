"""Whether the ranking survives other benches, in tables and sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from ...display.simulated.changes.draws import MODEL, PARAMETERS
from ..charts.look import slugs
from ..charts.ranks import draw_ranks
from ..data.ranks import CIRCULAR, Pair, Ranks
from ..data.statistics import CLEAR, mean_interval
from ..data.text import percent, words
from ..markdown import Markdown, bullets, heading, table_of
from ..section import Blocks, Figures, Report, Section


def _render(report: Report, _: Figures) -> Blocks:
    yield heading("Rank stability")
    yield (
        f"A draw is another bench of the same kind: {MODEL}. Methods know the nominal optics alone, or were trained on "
        "the nominal display; the same holograms are shown on every draw. Ranks order the means over targets. Brackets "
        "hold 95 % intervals over draws (other benches, the same images); those of shares are Wilson's."
    )
    for ranks in report.ranks:
        yield heading(f"{ranks.swept.before}, {len(ranks.swept.points)} draws", 3)
        yield bullets(left_out(ranks))
        if ranks.exists and (pairs := flips(ranks)):
            yield Markdown(
                "Pairs of methods whose order changes, {}. Goes with: the parameter that predicts the difference best, "
                "if R2 on draws that were left out is {} or more."
            ).format(report.results.headline.axis, CLEAR)
            yield pairs
        if drawn := _ranges(ranks):
            yield "Parameters that were drawn:"
            yield drawn


def flips(ranks: Ranks) -> Markdown | None:
    """The pairs whose order is the other way in some draw, most often first; empty where there is none."""
    flipping = sorted((pair for pair in ranks.pairs if pair.flips), key=lambda pair: -pair.flips)
    return table_of([_flip(ranks, pair) for pair in flipping])


def _flip(ranks: Ranks, pair: Pair) -> dict[str, str]:
    score, cause, with_ = ranks.results.headline, ranks.cause(pair), "nothing drawn"
    if cause:
        with_ = f"{cause.parameter} (rank correlation {cause.rho:+.2f}, R2 {cause.explained:.2f})"
    return {
        "nominally better": pair.first,
        "than": pair.second,
        f"nominally by{score.brackets}": score.number(pair.nominal, signed=True),
        f"over draws by{score.brackets}": score.estimate(mean_interval(pair.differences), signed=True),
        "other way in [% of draws]": percent(pair.flipped),
        "goes with": with_,
    }


def left_out(ranks: Ranks) -> list[str]:
    """Methods and draws that are in no number, and why."""
    lines = []
    unranked = [str(label) for label in ranks.quality if label not in ranks.methods]
    if unranked:
        lines.append(
            "Not ranked, because targets are missing on the nominal display or in more than half of the draws: "
            f"{words(unranked)}."
        )
    left = [str(value) for index, (value, _) in enumerate(ranks.swept.points) if index not in ranks.used]
    if left and ranks.used:
        which = f"Draws {words(left)} are" if len(left) > 1 else f"Draw {left[0]} is"
        lines.append(
            f"{which} left out ({len(left)} of {len(ranks.swept.points)}): a ranked method lacks a target there (see "
            "Holes), as every method does where the camera cannot be registered."
        )
    return lines


def _ranges(ranks: Ranks) -> Markdown | None:
    """What was drawn of the draws that are ranked, within which range, and where that comes from."""
    ranked = [ranks.swept.drawn[index] for index in ranks.used] if ranks.swept.drawn else []
    rows = []
    for name in (ranked or [{}])[0]:
        parameter, values = PARAMETERS[name], [draw[name] for draw in ranked]
        limits = f"{parameter.low:.3g} to {parameter.high:.3g}"
        drawn = f"{min(values):.3g} to {max(values):.3g}"
        turn = "; a full turn" if name in CIRCULAR else ""
        row = {"parameter": parameter.words, "unit": parameter.unit or "–", "range": limits, "drawn": drawn}
        rows.append(row | {"source of the range": f"{parameter.source}{turn}"})
    return table_of(rows)


def draw(rankings: Sequence[Ranks], folder: Path) -> Iterator[tuple[Path, str]]:
    """Draw a figure for every display that has a ranking; (file, caption) of each."""
    existing = [ranks for ranks in rankings if ranks.exists]
    stems = slugs([ranks.swept.before for ranks in existing])
    for ranks in existing:
        path = folder / f"quality-ranks-{stems[ranks.swept.before]}.png"
        draw_ranks(path, ranks)
        yield (
            path,
            f"Ranks of the methods over {len(ranks.used)} draws of {ranks.swept.before}. Left: share of draws [%] in "
            "which a method has each rank; methods in nominal order, nominal ranks framed. Right: draws by Kendall's "
            "tau-b of their ranking against the nominal one. Dot and bar: mean and 95 % interval; dashed: unrelated.",
        )


def _any(report: Report) -> bool:
    return bool(report.ranks)


SECTIONS = (
    Section("ranks, drawn", 47, applies=_any, figures=lambda report: draw(report.ranks, report.figures)),
    Section("rank stability", 60, _render, applies=_any, details=True),
)
