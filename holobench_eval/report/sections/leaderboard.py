"""The leaderboard: what each method reaches on a display, and what that cost in captures, time and memory."""

from __future__ import annotations

import numpy as np
import pandas as pd
from markupsafe import Markup

from ..data.categories import ONLINE, TRACKS, meanings
from ..data.results import Results
from ..data.tables import DONE, MEMORY_COLUMN, STOPPED_COLUMN
from ..markdown import table
from .tables import MEMORY, interval, label, number


def wanted(results: Results) -> bool:
    """Whether a study has costs besides computing time to set against quality."""
    return results.layout.spends_captures


def tracks(results: Results) -> list[tuple[str, str]]:
    """(track, what it means in words) of the study's tracks."""
    return meanings(results.tracks)


def order(results: Results, condition: str) -> list[str]:
    """Methods track by track, best mean first; those that lack targets last in their track."""

    def place(name: str) -> tuple[int, float]:
        rank = results.row(name, condition)["rank"]
        return TRACKS.index(results.layout.track(name)), np.inf if np.isnan(rank) else rank

    return sorted(results.methods(condition), key=place)


def leaderboard(results: Results, condition: str) -> Markup:
    """The table of a display; empty for a study without captures, or whose records are of an earlier version."""
    if not wanted(results) or "rank" not in results.table:
        return Markup("")
    each = results.layout.wording.each
    closed = {name: results.closed(name, condition) for name in results.methods(condition)}
    way = ["way to the ceiling [%]"] if np.isfinite(list(closed.values())).any() else []
    columns = {
        "total_captures": "total captures",
        "training_captures": "captures for training",
        "captures": f"captures per {each}",
        "seconds": f"seconds per {each}",
        "training_seconds": "seconds of training",
        MEMORY_COLUMN: MEMORY,
    }
    known = {key: heading for key, heading in columns.items() if key in results.table}
    rows = []
    for name in order(results, condition):
        row = results.row(name, condition)
        rows.append(
            [
                results.layout.track(name),
                "–" if np.isnan(row["rank"]) else f"{row['rank']:.0f}",
                label(results, name),
                f"{row['n']:.0f} of {len(results.targets)}",
                interval(row, results.headline),
                *([_percent(closed[name])] if way else []),
                *(number(row[key]) for key in known),
            ]
        )
    return table(["track", "rank", "method", "n", results.headline.axis, *way, *known.values()], rows)


def _percent(share: float) -> str:
    return "–" if np.isnan(share) else f"{100 * share:z.0f}"


def reading(results: Results) -> str:
    """How the columns of the leaderboard are to be read."""
    each = results.layout.wording.each
    sentences = [
        "Ranks go by the mean of the headline, within a display and a track; a method that lacks a target has none.",
        "Total captures are all that the row took: those of its training, and those of every target.",
        f"Seconds of training are spent once, seconds per {each} for every image.",
    ]
    if results.layout.baseline and any(results.ceiling(condition) for condition in results.conditions):
        sentences.append(
            f"The way to the ceiling is 0 % for the baseline {results.layout.baseline} and 100 % for the best "
            "privileged method, by means of the headline."
        )
    if ONLINE in results.tracks:
        sentences.append(
            "Methods that see the camera for the scored image compete in a track of their own: with a camera at hand "
            "for every image more is possible, and it says nothing about a display that has none."
        )
    return " ".join(sentences)


def stopped(results: Results, condition: str) -> list[str]:
    """A sentence for every method that the display ended on this display, with the reason it gave."""
    if STOPPED_COLUMN not in results.frame:
        return []
    frame = results.frame
    ended = frame[(frame["condition"] == condition) & (frame["state"] == DONE) & (frame[STOPPED_COLUMN] != "")]
    return [
        f"Stopped by the display, {name}: {reason}, on {_targets(cells, results)}. Its best hologram so far was scored."
        for (name, reason), cells in ended.groupby(["method", STOPPED_COLUMN], sort=False)
    ]


def _targets(cells: pd.DataFrame, results: Results) -> str:
    return f"{cells['target'].nunique()} of {len(results.targets)} targets"
