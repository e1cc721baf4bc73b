"""The main results: the headline metric of every method, the floor that it must clear, and its charts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from ..charts import paired
from ..charts.quality import draw_quality
from ..data.results import Results
from ..data.scores import parse
from ..data.tables import DONE, MEDIAN, PUBLISHED
from ..data.text import FILES, words
from ..markdown import Markdown, bullets, heading, table
from ..section import Blocks, Column, Figures, Report, Section, column, method_rows

WEIGHTS = "https://download.pytorch.org/models/alexnet-owt-7be5be79.pth"


def _render(report: Report, figures: Figures) -> Blocks:
    results, layout = report.results, report.layout
    yield heading("Results")
    yield (
        f"The headline metric is {results.headline.axis}{layout.text.axis}. Brackets hold 95 % intervals over "
        "clusters of targets; n is the number of targets with a score."
    )
    if layout.privileged:
        yield (
            'Rows marked "ceiling (privileged)" are oracles: they may differentiate through the simulated bench, which '
            "no real method can. They bound what is possible and do not compete."
        )
    for condition in results.conditions:
        yield heading(condition, 3)
        yield table(*headline_rows(results, condition))
        yield bullets(stopped(results, condition))
    if layout.reported_source:
        yield (
            'Columns named "reported" hold published figures from other hardware and other images; they were not '
            f"measured here. Source: {layout.reported_source}"
        )
    yield _without_lpips(results)
    yield heading("The floor", 3)
    if results.floors:
        yield layout.text.floor
        yield _floors(results)
    else:
        yield "No reference row has a score."
    yield from figures


def _without_lpips(results: Results) -> str:
    """Why LPIPS is missing where it was wanted, and how to have it."""
    metrics, wanted = {score.metric for score in results.scores}, results.layout.metrics
    lpips = any(name.startswith("lpips") for name in metrics)
    if lpips or not (wanted is None or any(name.startswith("lpips") for name in wanted)):
        return ""
    option = "" if results.layout.measure == FILES else "or set `protocol: {lpips_weights: ...}` to its path, "
    mofd = (
        " The tables have MOFD (multi-scale oriented feature distance) instead, a perceptual distance without trained "
        "weights; its values are not LPIPS values."
    )
    return Markdown(
        f"LPIPS is not in these tables: no package contains the weights of its trunk. To add it, put <{WEIGHTS}> into "
        f"the folder `checkpoints` of torch's hub cache, {option}and run again.{mofd if 'mofd' in metrics else ''}"
    )


def cost_columns(results: Results, each: str = "") -> dict[str, str]:
    """Columns of the table that say what the scores took, with their headings.

    Captures for training and those while solving stay apart: the former are taken once. each: added to the latter.
    """
    if results.layout.measure == FILES:
        return {}
    trained = "training_captures" in results.table
    training = {"training_captures": "captures for training", "training_s": "seconds of training"}
    solving = {"captures": f"captures{each}{' while solving' * trained}", "solving_s": f"seconds{each}"}
    if results.layout.predicts:
        del solving["captures"]
    if results.table["solving_s"].isna().all():  # phases from files alone
        del solving["solving_s"]
    return training | solving if trained else solving


def headline_rows(results: Results, condition: str) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of a condition's main table; published figures stand in columns of their own."""
    layout = results.layout
    reported = layout.reported_metrics if layout.reported_beside in (None, condition) else ()
    columns: list[Column] = [
        ("n", lambda row: f"{row['n']:.0f} of {len(results.targets)}"),
        (results.headline.heading, results.headline.in_row),
        *_beside_the_mean(results, condition),
        *((score.heading, score.in_row) for score in results.leading[1:]),
        *(column(title, key) for key, title in cost_columns(results).items()),
        *(column(f"reported {parse(metric).axis}", f"{PUBLISHED}{parse(metric).column}") for metric in reported),
    ]
    return method_rows(results, condition, columns)


def _beside_the_mean(results: Results, condition: str) -> list[Column]:
    """The headline's median over targets, and its mean above a constant image of the same target."""
    score = results.headline
    above = {name: results.above_floor(name, condition) for name in results.methods(condition)}

    def difference(row: pd.Series) -> str:
        found = above[row["label"]]
        return score.estimate(found, signed=True) if found else "–"

    columns = [(f"median{score.brackets}", lambda row: score.number(row[score.statistic(MEDIAN)]))]
    return [*columns, (f"above a constant image{score.brackets}", difference)] if any(above.values()) else columns


def stopped(results: Results, condition: str) -> list[str]:
    """A sentence for every method that the display ended on this display, with the reason it gave."""
    if "stop_reason" not in results.frame:
        return []
    frame, targets = results.frame, len(results.targets)
    ended = frame[(frame["condition"] == condition) & (frame["state"] == DONE) & (frame["stop_reason"] != "")]
    return [
        f"The display stopped {name} on {cells['target'].nunique()} of {targets} targets: {reason}. Its best hologram "
        "until then was scored."
        for (name, reason), cells in ended.groupby(["label", "stop_reason"], sort=False)
    ]


def _floors(results: Results) -> Markdown:
    """What images that no method made score."""
    text, shown = results.layout.text, results.by_reference
    rows = []
    for condition, displays in shown.items():
        for name in results.floors:
            row = results.row(name, condition)
            on = [words(displays)] * (len(shown) > 1)
            rows.append(
                [text.floor_name(name), *on, f"{row['n']:.0f}", *(score.in_row(row) for score in results.leading)]
            )
    displays_too = ["display"] * (len(shown) > 1)
    return table([text.instead, *displays_too, "n", *(score.heading for score in results.leading)], rows)


def _figures(report: Report) -> Iterator[tuple[Path, str]]:
    results, text = report.results, report.layout.text
    if results.done.empty:
        return
    for condition, stem in paired.displays(results)[1:]:  # that of the first display stands on the first page
        path = report.figures / f"quality-paired-{stem}.png"
        paired.draw(results, condition, path)
        yield path, paired.caption(results, condition)
    floors = [name for name in ("floor_constant", "floor_speckle") if name in results.floors]
    path = report.figures / "quality-by-target.png"
    draw_quality(path, results, floors if all(map(results.has_pictures, results.conditions)) else ())
    yield (
        path,
        f"{results.headline.axis}{text.axis}, by method and display. Small dots: targets, at the same height in every "
        "row; marks and bars: mean and its 95 % interval over clusters of targets; vertical lines: the floor.",
    )


SECTIONS = (Section("results", 30, _render, figures=_figures, details=True),)
