"""The tables of report.md, from the numbers of a study."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from markupsafe import Markup

from ...study.plan import REFERENCE
from ..data.results import Results
from ..data.scores import DOMAINS, Score
from ..data.statistics import PairedTest
from ..data.tables import ALONE_COLUMN, DONE, MEMORY_COLUMN
from ..data.text import FILES, words
from ..markdown import code, table
from .findings import blur_keys

MEMORY = "memory [MiB]"
ELSEWHERE = ("refine_", "second_")
"""How the keys of figures begin that are told where the geometry is."""
LEADING = ("psnr", "ssim", "ms_ssim", "lpips_alex", "lpips_vgg", "mofd")


def number(value: float) -> str:
    """Four significant digits at most, no exponent for everyday sizes; a dash for NaN."""
    return "–" if np.isnan(value) else f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def label(results: Results, name: str) -> str:
    """The method's label, marked when it is the ceiling."""
    return f"{name}, ceiling (privileged)" if name in results.layout.privileged else name


def leading_scores(results: Results) -> list[Score]:
    """The headline metric, those of what is in focus, then the usual ones in linear light, or in their only domain."""
    plain = [score for score in results.scores if not score.variant]
    chosen = list(dict.fromkeys([results.headline, *(score for score in results.scores if score.in_focus)]))
    for metric in LEADING:
        found = sorted((s for s in plain if s.metric == metric), key=lambda s: s.domain not in ("linear", ""))
        if found and found[0] not in chosen and not (metric == "mofd" and any("lpips" in s.metric for s in chosen)):
            chosen.append(found[0])
    return chosen


def heading(score: Score) -> str:
    """A column's heading: title, domain, unit, and the direction where lower is better."""
    return f"{score.axis}{'' if score.higher_is_better else ' (lower is better)'}"


def interval(row: pd.Series, score: Score) -> str:
    """Mean and interval of a score in a row of the table."""
    return score.interval(row[score.key], row[f"{score.key}_lo"], row[f"{score.key}_hi"])


def _effort(results: Results, each: str = "") -> dict[str, str]:
    """Columns of the table that say what the scores took, with their headings.

    Captures for training and those while solving stay apart: the former are taken once. each: added to the latter.
    """
    if results.layout.measure == FILES:
        return {}
    trained = "training_captures" in results.table
    training = {"training_captures": "captures for training", "training_seconds": "seconds of training"}
    solving = {"captures": f"captures{each}{' while solving' * trained}", "seconds": f"seconds{each}"}
    if results.layout.measure == "prediction":
        del solving["captures"]
    return training | solving if trained else solving


def headline_rows(results: Results, condition: str) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of a condition's main table; published figures stand in columns of their own."""
    scores, layout = leading_scores(results), results.layout
    reported = layout.reported_metrics if layout.reported_beside in (None, condition) else ()
    effort = _effort(results)
    rows = []
    for name in results.methods(condition):
        row, published = results.row(name, condition), layout.published(name, condition)
        rows.append(
            [
                label(results, name),
                f"{row['n']:.0f} of {len(results.targets)}",
                *(interval(row, score) for score in scores),
                *(number(row[key]) for key in effort),
                *(number(published.get(metric, float("nan"))) for metric in reported),
            ]
        )
    columns = ["method", "n", *map(heading, scores), *effort.values()]
    return [*columns, *(f"reported {Score(metric, metric).axis}" for metric in reported)], rows


def headline(results: Results, condition: str) -> Markup:
    """The main table of a condition."""
    return table(*headline_rows(results, condition))


def floors(results: Results) -> Markup:
    """What images that no method made score."""
    scores, said = leading_scores(results), results.layout.wording
    rows = []
    for name in results.floors:
        row = results.row(name, REFERENCE)
        rows.append([said.floor_name(name), f"{row['n']:.0f}", *(interval(row, score) for score in scores)])
    return table([said.instead, "n", *map(heading, scores)], rows)


def tests(results: Results, found: Sequence[PairedTest]) -> Markup:
    """Paired tests, one a row."""
    score = results.headline
    rows = []
    for test in found:
        difference = test.difference
        rows.append(
            [
                f"{label(results, test.second)} – {label(results, test.first)}",
                test.condition,
                f"{test.complete} of {test.targets}",
                score.interval(difference.mean, difference.low, difference.high, signed=True),
                "no test" if np.isnan(test.p) else f"{test.p:.4f}",
                "no test" if np.isnan(test.p_holm) else f"{test.p_holm:.4f}",
            ]
        )
    difference_heading = f"mean difference, {score.axis}"
    return table(["comparison", "display", "complete pairs", difference_heading, "p", "p (Holm)"], rows)


def domains(results: Results, condition: str) -> Markup:
    """The plain metrics that the headline table leaves out: other domains, other metrics."""
    shown = leading_scores(results)
    rest = [score for score in results.scores if score.domain and not score.variant and score not in shown]
    names = results.methods(condition)
    by_domain = sorted(rest, key=lambda score: DOMAINS.index(score.domain))
    rows = [
        [heading(score), *(score.number(results.row(name, condition)[score.key]) for name in names)]
        for score in by_domain
    ]
    return table(["metric", *(label(results, name) for name in names)], rows) if rows else Markup("")


def blur(results: Results, condition: str) -> Markup:
    """The headline metric after a Gaussian blur of both images; empty when no blurred score was recorded."""
    keys = blur_keys(results)
    if not keys:
        return Markup("")
    rows = [
        [label(results, name), *(score.number(results.row(name, condition)[score.key]) for score in keys)]
        for name in results.methods(condition)
    ]
    return table(["method", *(f"blur {score.blur:g} px" if score.blur else "no blur" for score in keys)], rows)


def geometry(results: Results, condition: str) -> Markup:
    """Scores with and without the rigid refinement of each capture, and how far it moved; empty without both."""
    plain = {(s.metric, s.domain): s for s in results.scores if s.domain and not s.variant}
    pairs = [(plain[s.metric, s.domain], s) for s in results.scores if s.variant == "refined"]
    if not pairs:
        return Markup("")
    rows = []
    for name in results.methods(condition):
        row, cells = results.row(name, condition), results.cells(name, condition)
        shift = np.hypot(cells["refine_dx_px"], cells["refine_dy_px"]).max()
        scores = [
            text
            for fixed, refined in pairs
            for text in (
                fixed.number(row[fixed.key]),
                fixed.number(row[refined.key]),
                fixed.number(row[refined.key] - row[fixed.key], signed=True),
            )
        ]
        rows.append([label(results, name), *scores, number(shift), number(cells["refine_theta_deg"].abs().max())])
    headings = [text for fixed, _ in pairs for text in (fixed.axis, "refined", "difference")]
    return table(["method", *headings, "largest shift [px]", "largest rotation [deg]"], rows)


def light_and_time(results: Results, condition: str) -> Markup:
    """Captures, computing time and the figures that describe a capture and are no image metric."""
    figures = [score for score in results.scores if not score.domain and not score.key.startswith(ELSEWHERE)]
    effort, sensor = _effort(results, " per target"), results.layout.learned_display is None
    effort |= {MEMORY_COLUMN: MEMORY} if MEMORY_COLUMN in results.table else {}
    rows = []
    for name in results.methods(condition):
        row, cells = results.row(name, condition), results.cells(name, condition)
        done = cells[cells["state"] == DONE]
        saturated = done["saturated"].max() * 100 if len(done) else float("nan")
        rows.append(
            [
                label(results, name),
                *(number(row[key]) for key in effort),
                *([number(saturated)] if sensor else []),
                *(number(row[score.key]) for score in figures),
            ]
        )
    columns = ["method", *effort.values(), *(["most saturated samples [%]"] if sensor else [])]
    return table([*columns, *(score.title for score in figures)], rows)


def timing(results: Results, workers: int) -> str:
    """What was at work beside the solutions that were timed, a sentence; workers: of the run.

    Empty where a single worker left no note of it, as in records of earlier versions.
    """
    each, frame, row = results.layout.wording.each, results.frame, ["method", "condition"]
    done = frame[(frame["state"] == DONE) & (frame["condition"] != REFERENCE)]
    together = f"{each}s computed {f'{workers} ' * (workers > 1)}side by side, which disturb each other"
    if ALONE_COLUMN not in done:
        return f"The seconds are of {together}." if workers > 1 else ""
    alone = done[done[ALONE_COLUMN] == 1]
    if alone.empty:
        return f"The seconds are of {together}."
    if len(alone) == len(done):
        return f"Each {each} was computed with nothing beside it."
    one = alone.groupby(row)["seconds"].nunique().max() == 1  # cells of one solution have one time
    chosen = f"one {each} a row, computed" if one else f"those {each}s of a row that were computed"
    timed = set(alone[row].itertuples(index=False, name=None))
    others = [pair for pair in done[row].drop_duplicates().itertuples(index=False, name=None) if pair not in timed]
    rest = f"; those of {words([' on '.join(pair) for pair in others])} are of {together}" if others else ""
    return f"The seconds are of {chosen} with nothing beside {'it' if one else 'them'}{rest}."


def per_target(results: Results, condition: str) -> Markup:
    """The headline metric of every target."""
    names = results.methods(condition)
    columns = [results.values(name, condition) for name in names]
    rows = [
        [target, *(results.headline.number(column[index]) for column in columns)]
        for index, target in enumerate(results.targets)
    ]
    return table(["target", *(label(results, name) for name in names)], rows)


def holes(results: Results) -> Markup:
    """Every cell without a score, with its reason; empty when there is none."""
    columns = ["method", "condition", "target", "repeat", "state", "reason"]
    rows = [
        [method, condition, target, f"{repeat:.0f}", state, reason or "no reason given"]
        for method, condition, target, repeat, state, reason in results.holes[columns].itertuples(index=False)
    ]
    return table(["method", "display", "target", "repeat", "state", "reason"], rows) if rows else Markup("")


def parameters(methods: Sequence[tuple[str, str, str]]) -> Markup:
    """Methods with their registered names and parameters: (label, name, parameters as text)."""
    return table(["method", "registered as", "parameters"], [[a, code(b), c] for a, b, c in methods])
