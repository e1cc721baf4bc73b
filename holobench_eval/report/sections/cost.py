"""Captures, computing time and light."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from ..data.results import Results
from ..data.tables import DONE
from ..data.text import FILES, number, words
from ..markdown import Markdown, heading
from ..section import Blocks, Figures, Report, Section, by_method, column
from .results import cost_columns

ELSEWHERE = ("refine_", "second_", "share_")  # how keys of figures begin that stand where the geometry is


def _render(report: Report, _: Figures) -> Blocks:
    results, text = report.results, report.layout.text
    yield heading("Light" if report.layout.measure == FILES else "Captures, time and light")
    if report.layout.measure == FILES:
        yield f"{text.cost} Match factors and brightness ratios are computed {text.compared}."
    else:
        memory, timed = "memory_mib" in results.table, results.done["solving_s"].notna().any()
        sentences = [
            text.cost,
            *(
                [_measured(report.provenance, memory), timing(results, report.provenance.get("workers", 1))]
                if timed
                else []
            ),
        ]
        if timed:
            sentences.append("A phase is solved once for all displays and studies; its seconds are of that solving.")
        if memory:
            sentences.append(
                f"Memory is the peak of a {text.each} above what the process held before it, the median over targets; "
                "training is not included."
            )
        if report.trainings:
            sentences.append(
                "Captures and seconds of training were spent once, before any target was seen; those per target do not "
                "include them."
            )
        yield " ".join(filter(None, sentences))
    yield report.by_display(_light_and_time)


def _measured(provenance: Mapping[str, Any], memory: bool) -> str:
    """When the seconds were measured, a sentence; without a noted load they may be of an earlier study."""
    what = f"Seconds {'and memory ' * memory}"
    runs = [*provenance.get("earlier", ()), provenance]
    loads = [run["load"] for run in runs if "load" in run]
    if len(loads) < len(runs):
        return f"{what}are the first measurement on that machine, which may be of an earlier study."
    if len(runs) > 1:
        spread = f"from {min(loads):g} to {max(loads):g}"
        return (
            f"{what}were measured in the {len(runs)} runs of this study; the machine's load before them was {spread}."
        )
    return f"{what}were measured in this study; the machine's load before it was {loads[0]:g}."


def _light_and_time(results: Results, condition: str) -> Markdown:
    """Captures, computing time and the figures that describe a capture and are no image metric."""

    def saturated(row: pd.Series) -> str:
        cells = results.cells(row["label"], condition)
        return number(cells.loc[cells["state"] == DONE, "saturated"].max() * 100)

    costs = cost_columns(results, " per target")
    measured = {"cpu_s": "processor seconds per target", "memory_mib": "memory [MiB]"}
    costs |= {key: title for key, title in measured.items() if key in results.table}
    sensor = results.layout.learned_display is None
    figures = [score for score in results.scores if not score.domain and not score.key.startswith(ELSEWHERE)]
    columns = [
        *(column(title, key) for key, title in costs.items()),
        *([("most saturated samples [%]", saturated)] if sensor else []),
        *(column(score.title, score.column) for score in figures),
    ]
    return by_method(results, condition, columns)


def timing(results: Results, workers: int) -> str:
    """What was at work beside the solutions that were timed, a sentence; workers: of the run.

    Empty where a single worker left no note of it.
    """
    each, done, row = results.layout.text.each, results.done, ["label", "condition"]
    inflated = f"timed with {f'{workers} ' * (workers > 1)}concurrent workers and are inflated"
    if "timed_alone" not in done:
        return f"Seconds were {inflated}." if workers > 1 else ""
    alone = done[done["timed_alone"] == 1]
    if alone.empty:
        return f"Seconds were {inflated}."
    if len(alone) == len(done):
        return f"Each {each} was timed alone."
    single = alone.groupby(row)["solving_s"].nunique().max() == 1  # cells of one solution have one time
    chosen = f"one {each} per row," if single else f"the {each}s"
    timed = set(alone[row].itertuples(index=False, name=None))
    others = [pair for pair in done[row].drop_duplicates().itertuples(index=False, name=None) if pair not in timed]
    rest = f"; those of {words([' on '.join(pair) for pair in others])} were {inflated}" if others else ""
    return f"Seconds are those of {chosen} timed alone{rest}."


SECTIONS = (Section("cost", 170, _render, details=True),)
