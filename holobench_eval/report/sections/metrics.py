"""The scores behind the headline: other metrics and domains, refined geometry, and blur."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..data.results import Results
from ..data.scores import DOMAINS, Score
from ..data.text import FILES, number
from ..markdown import Markdown, heading, table
from ..section import Blocks, Column, Figures, Report, Section, by_method


def _domains(report: Report, _: Figures) -> Blocks:
    yield heading("Other metrics and domains")
    yield report.by_display(_other_metrics, instead="Nothing else was recorded.")


def _other_metrics(results: Results, condition: str) -> Markdown | None:
    """The plain metrics that the headline table leaves out."""
    names = results.methods(condition)
    rest = [score for score in results.scores if score.domain and not score.variant and score not in results.leading]
    rows = [
        [score.heading, *(score.mean_in(results.row(name, condition)) for name in names)]
        for score in sorted(rest, key=lambda score: DOMAINS.index(score.domain))
    ]
    return table(["metric", *map(results.layout.marked, names)], rows) if rows else None


def _geometry(report: Report, _: Figures) -> Blocks:
    layout, text = report.layout, report.layout.text
    network, files = layout.learned_display is not None, layout.measure == FILES
    kind = "as predicted" if network else "as aligned" if files else "registration only"
    yield heading(f"Geometry: {kind}, and refined")
    yield (
        f'{text.registered}"Refined" allows each {"aligned " * files}{text.scored} a rigid motion of at most 2 px and '
        "0.1 degree, estimated by correlation and not by maximising the score. A large difference means that "
        f"{text.drifted}."
    )
    yield report.by_display(_refined, instead="Only one of the two was recorded.")


def _refined(results: Results, condition: str) -> Markdown | None:
    """Scores with and without the rigid refinement of each capture, and how far it moved."""
    plain = {(s.metric, s.domain): s for s in results.scores if s.domain and not s.variant}
    pairs = [(plain[s.metric, s.domain], s) for s in results.scores if s.variant == "refined"]
    if not pairs:
        return None

    def difference(fixed: Score, refined: Score) -> Column:
        return "difference", lambda row: fixed.number(row[refined.column] - row[fixed.column], signed=True)

    def moved(row: pd.Series) -> str:
        cells = results.cells(row["label"], condition)
        return number(np.hypot(cells["refine_dx_px"], cells["refine_dy_px"]).max())

    def turned(row: pd.Series) -> str:
        return number(results.cells(row["label"], condition)["refine_theta_deg"].abs().max())

    scores = [
        column
        for fixed, refined in pairs
        for column in ((fixed.axis, fixed.mean_in), ("refined", refined.mean_in), difference(fixed, refined))
    ]
    columns = [*scores, ("largest shift [px]", moved), ("largest rotation [deg]", turned)]
    return by_method(results, condition, columns)


def _blur(report: Report, _: Figures) -> Blocks:
    text, score = report.layout.text, next(iter(report.results.blur_scores), report.results.headline)
    yield heading("Sensitivity to blur")
    yield (
        f"{score.axis} after a Gaussian blur of both {text.scored} and {text.truth}, {text.compared}, before the "
        f"intensity match; widths are standard deviations. {text.blur}"
    )
    yield report.by_display(_blurred, instead="No blurred scores were recorded.")


def _blurred(results: Results, condition: str) -> Markdown | None:
    """The headline metric after a Gaussian blur of both images."""
    scores = results.blur_scores
    columns = [(f"blur {score.blur:g} px" if score.blur else "no blur", score.mean_in) for score in scores]
    return by_method(results, condition, columns) if scores else None


SECTIONS = (
    Section("domains", 130, _domains, details=True),
    Section("geometry", 150, _geometry, details=True),
    Section("blur", 160, _blur, details=True),
)
