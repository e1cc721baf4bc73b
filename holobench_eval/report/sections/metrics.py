"""The scores behind the headline: other metrics and domains, refined geometry, and blur."""

from __future__ import annotations

import numpy as np

from ..data.results import Results
from ..data.scores import DOMAINS
from ..data.text import FILES, number
from ..markdown import Markdown, heading, table
from ..section import Blocks, Figures, Report, Section


def _domains(report: Report, _: Figures) -> Blocks:
    yield heading("Other metrics and domains")
    yield report.by_display(_other_metrics, instead="Nothing else was recorded.")


def _other_metrics(results: Results, condition: str) -> Markdown | None:
    """The plain metrics that the headline table leaves out."""
    names = results.methods(condition)
    rest = [score for score in results.scores if score.domain and not score.variant and score not in results.leading]
    rows = [
        [score.heading, *(score.number(results.row(name, condition)[score.key]) for name in names)]
        for score in sorted(rest, key=lambda score: DOMAINS.index(score.domain))
    ]
    return table(["metric", *map(results.layout.marked, names)], rows) if rows else None


def _geometry(report: Report, _: Figures) -> Blocks:
    layout = report.layout
    network, files = layout.learned_display is not None, layout.measure == FILES
    kind = "as predicted" if network else "as aligned" if files else "registration only"
    yield heading(f"Geometry: {kind}, and refined")
    yield layout.text.geometry
    yield report.by_display(_refined, instead="Only one of the two was recorded.")


def _refined(results: Results, condition: str) -> Markdown | None:
    """Scores with and without the rigid refinement of each capture, and how far it moved."""
    plain = {(s.metric, s.domain): s for s in results.scores if s.domain and not s.variant}
    pairs = [(plain[s.metric, s.domain], s) for s in results.scores if s.variant == "refined"]
    if not pairs:
        return None
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
        turn = number(cells["refine_theta_deg"].abs().max())
        rows.append([results.layout.marked(name), *scores, number(shift), turn])
    headings = [text for fixed, _ in pairs for text in (fixed.axis, "refined", "difference")]
    return table(["method", *headings, "largest shift [px]", "largest rotation [deg]"], rows)


def _blur(report: Report, _: Figures) -> Blocks:
    text, score = report.layout.text, next(iter(report.results.blur_scores), report.results.headline)
    yield heading("Sensitivity to blur")
    yield (
        f"{score.axis} after {text.scored} and {text.truth} are blurred alike, {text.compared} and before the "
        f"intensity match, by a Gaussian of the given standard deviation. {text.blur}"
    )
    yield report.by_display(_blurred, instead="No blurred scores were recorded.")


def _blurred(results: Results, condition: str) -> Markdown | None:
    """The headline metric after a Gaussian blur of both images."""
    scores = results.blur_scores
    rows = [
        [results.layout.marked(name), *(score.number(results.row(name, condition)[score.key]) for score in scores)]
        for name in results.methods(condition)
    ]
    widths = (f"blur {score.blur:g} px" if score.blur else "no blur" for score in scores)
    return table(["method", *widths], rows) if scores else None


SECTIONS = (
    Section("domains", 130, _domains),
    Section("geometry", 150, _geometry),
    Section("blur", 160, _blur),
)
