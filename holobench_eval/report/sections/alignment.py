"""How given pictures were aligned with their targets, and whether another algorithm agrees."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...study.folders import alignment_name
from ...study.plan import is_reference
from ..markdown import Markdown, bullets, heading, table_of
from ..results import DONE, Results
from ..scores import Score, parse
from ..section import Blocks, Figures, Report, Section
from ..text import FILES

AGREE = 0.2  # dB of the headline PSNR by which two aligners may differ before the report warns
UNKNOWN = "–"
FIGURES = 8  # pictures of alignments in the report, of the worst; the others are beside it

Records = Sequence[Mapping[str, Any]]


def _render(report: Report, figures: Figures) -> Blocks:
    yield heading("Alignment")
    yield bullets(sentences(report.results, report.records))
    yield _captures_table(report.results, report.records)
    yield from figures


def sentences(results: Results, records: Records) -> list[str]:
    """What a reader has to know of the geometry before the scores are believed."""
    kinds = [record["cell"]["geometry"]["kind"] for record in _captures(records)]
    shared, own, given, none = (kinds.count(kind) for kind in ("shared", "own", "given", "none"))
    lines = [
        f"The geometry is given: {_count(given)} had the size of the target and were aligned before. Nothing was "
        "searched. A capture of another picture has a correlation near 0."
        if given
        else "The geometry comes from the images, not from fiducials: features or templates locate a target in its "
        "capture, and the enhanced correlation coefficient refines the homography. No score is used."
    ]
    if shared:
        lines.append(
            f"One shared alignment for {_count(shared)} in one pose: the mean of the alignments that agree within a "
            "pixel, so that none is better fitted than another. It stands for a capture whose own alignment is within "
            "a quarter of a capture pixel (rms), and for one that is not found by itself, such as a speckled baseline, "
            "where the two pictures are alike in this pose."
        )
    if own:
        lines.append(
            f"An alignment of its own for {_count(own)}: "
            f"{'the shared one is further away' if shared else 'there is no shared one'}. Its error affects its score."
        )
    if any("part" in record["cell"] for record in records):
        lines.append(
            "Of some targets only the part is scored that all their captures show, a rectangle of the target's pixels; "
            "so is their floor."
        )
    if none:
        lines.append(f"Refused, without a score: {_count(none)}.")
    return [*lines, *filter(None, [agreement(results)])]


def _captures_table(results: Results, records: Records) -> Markdown | None:
    """Each capture's alignment, and the headline metric by another algorithm's."""
    score, in_part = _doubled(results), any("share_seen" in record["scores"] for record in records)
    rows = []
    for record in _captures(records):
        geometry, scores = record["cell"]["geometry"], record["scores"]
        row = {"method": record["label"], "target": record["cell"]["target"], "alignment": geometry["kind"]}
        row |= _pose(geometry)
        row |= _pair(scores, score) if score else {}
        if in_part:
            row |= {"seen [%]": _percent(scores, "share_seen"), "scored [%]": _percent(scores, "share_scored")}
        rows.append(row)
    return table_of(rows)


def _percent(scores: Mapping[str, float], key: str) -> str:
    return f"{100 * scores[key]:.1f}" if key in scores else UNKNOWN


def _captures(records: Records) -> list[Mapping[str, Any]]:
    return [r for r in records if not is_reference(r["cell"]["condition"]) and r["cell"]["capture_sha256"]]


def _count(captures: int) -> str:
    return f"{captures} capture{'s' * (captures != 1)}"


def _doubled(results: Results) -> Score | None:
    """The PSNR in the headline's domain, where a second aligner was asked."""
    score = parse(f"psnr_{results.headline.domain}")
    return score if parse(f"{score.key}_second") in results.scores else None


def agreement(results: Results) -> str:
    """Whether the scores depend on which of two aligners is right, with a warning where they do; empty without scores.

    The first one fixes circles of a fiducial grid, or features of the pictures; the second correlates blocks.
    """
    done, score = results.done, _doubled(results)
    if done.empty:
        return ""
    apart: dict[str, float] = {}
    if score is not None:
        differences = done[parse(f"{score.key}_second").column] - done[score.column]
        names = done["label"] + ", " + done["target"].astype(str)
        apart = {name: value for name, value in zip(names, differences, strict=True) if np.isfinite(value)}
    silent = f" It cannot judge {_count(len(done) - len(apart))}." if len(apart) < len(done) else ""
    if not apart:
        return "Warning: the second aligner cannot judge any capture."
    most = max(apart.values(), key=abs)
    beyond = [f"{name}: {value:+.2f} dB" for name, value in apart.items() if abs(value) > AGREE]
    if not beyond:
        return (
            f"A second aligner, which shares no algorithm with the first, agrees within {AGREE} dB on "
            f"{_count(len(apart))}; its largest difference is {most:+.2f} dB.{silent}"
        )
    return (
        f"Warning: a second aligner, which shares no algorithm with the first, gives scores that differ by more than "
        f"{AGREE} dB ({'; '.join(beyond)}). These scores depend on the alignment.{silent}"
    )


def _pair(scores: Mapping[str, float], score: Score) -> dict[str, str]:
    """The score by both aligners, its difference, and how far apart they put a corner."""
    first, second = (scores.get(key, np.nan) for key in (score.key, f"{score.key}_second"))
    apart = scores.get("second_aligner_px", np.nan)
    return {
        score.axis: score.number(first),
        "by the second aligner": score.number(second),
        "difference": score.number(second - first, signed=True),
        "apart [target px]": UNKNOWN if np.isnan(apart) else f"{apart:.2f}",
    }


def _pose(geometry: Mapping[str, Any]) -> dict[str, str]:
    """Correlation, scale, turn and mirror of a target in its capture, at the target's upper left corner."""
    columns = ("correlation", "capture pixels a target pixel", "turn [deg]", "mirrored")
    if geometry["kind"] == "none":
        return dict.fromkeys(columns, UNKNOWN)
    h = np.array(geometry["homography"])
    linear = (h[:2, :2] - np.outer(h[:2, 2], h[2, :2]) / h[2, 2]) / h[2, 2]
    area, down = np.linalg.det(linear), linear[:, 1]  # a mirror from left to right leaves the latter
    turn, mirrored = np.degrees(np.arctan2(-down[0], down[1])), "yes" if area < 0 else "no"
    values = (f"{geometry['correlation']:.3f}", f"{np.sqrt(abs(area)):.3f}", f"{turn:.1f}", mirrored)
    return dict(zip(columns, values, strict=True))


def _figures(report: Report) -> Iterator[tuple[Path, str]]:
    """Pictures of the captures that are least like their targets; they were drawn when these were scored."""
    done = [(each["label"], each["cell"]) for each in _captures(report.records) if each["state"] == DONE]
    drawn = [
        (cell["geometry"].get("correlation", np.nan), path, label, cell["target"])
        for label, cell in done
        if (path := report.figures / alignment_name(label, cell["target"])).is_file()
    ]
    drawn.sort(key=lambda one: one[0])
    more = (
        f" Shown are the {FIGURES} of {len(drawn)} captures with the lowest correlation, the lowest first; the others "
        f"are in the folder {report.figures.name}."
        if len(drawn) > FIGURES
        else ""
    )
    for correlation, path, method, target in drawn[:FIGURES]:
        yield (
            path,
            f"{method}, {target}, correlation {correlation:.3f}: the outline of the target on the capture, a dot at "
            "the target's upper left corner; and squares of the target and of the aligned, matched capture in "
            f"turn.{more}",
        )


SECTIONS = (
    Section("alignment", 140, _render, applies=lambda report: report.results.study.measure == FILES, figures=_figures),
)
