"""How given pictures were aligned with their targets, and whether another algorithm agrees."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...study.folders import alignment_name
from ...study.plan import is_reference
from ..markdown import bullets, heading, table_of
from ..results import DONE, Results
from ..scores import Score, parse
from ..story import Blocks, Figures, Part, Report
from ..text import FILES

ORDER = 220
AGREE = 0.2  # dB of the headline PSNR by which two aligners may differ before the report warns
UNKNOWN = "–"
FIGURES = 8  # pictures of alignments in the report, of the worst; the others are beside it

Record = Mapping[str, Any]


def _render(report: Report, figures: Figures) -> Blocks:
    captures, score = _captures(report), _doubled(report.results)
    in_part = any("share_seen" in record["scores"] for record in report.records)
    yield heading("Alignment")
    yield bullets([*_sentences(captures), *filter(None, [agreement(report.results)])])
    yield table_of([_row(record, score, in_part) for record in captures])
    yield from figures


def _captures(report: Report) -> list[Record]:
    cells = ((record, record["cell"]) for record in report.records)
    return [record for record, cell in cells if not is_reference(cell["condition"]) and cell["capture_sha256"]]


def _count(captures: int) -> str:
    return f"{captures} capture{'s' * (captures != 1)}"


def _sentences(captures: Sequence[Record]) -> Iterator[str]:
    """What a reader has to know of the geometry before the scores are believed."""
    kinds = Counter(record["cell"]["geometry"]["kind"] for record in captures)
    if kinds["given"]:
        yield (
            f"The geometry is given: {_count(kinds['given'])} had the size of the target and were aligned before. "
            "Nothing was searched. A capture of another picture has a correlation near 0."
        )
    else:
        yield (
            "The geometry comes from the images, not from fiducials: features or templates locate a target in its "
            "capture, and the enhanced correlation coefficient refines the homography. No score is used."
        )
    if kinds["shared"]:
        yield (
            f"One shared alignment for {_count(kinds['shared'])} in one pose: the mean of the alignments that agree "
            "within a pixel, so that none is better fitted than another. It stands for a capture whose own alignment "
            "is within a quarter of a capture pixel (rms), and for one that is not found by itself, such as a speckled "
            "baseline, where the two pictures are alike in this pose."
        )
    if kinds["own"]:
        why = "the shared one is further away" if kinds["shared"] else "there is no shared one"
        yield f"An alignment of its own for {_count(kinds['own'])}: {why}. Its error affects its score."
    if any("part" in record["cell"] for record in captures):
        yield (
            "Of some targets only the part is scored that all their captures show, a rectangle of the target's pixels; "
            "so is their floor."
        )
    if kinds["none"]:
        yield f"Refused, without a score: {_count(kinds['none'])}."


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
    names = done["label"] + ", " + done["target"].astype(str)
    differences = done[parse(f"{score.key}_second").column] - done[score.column] if score else np.nan
    apart = pd.Series(np.asarray(differences), index=names, dtype=np.float64)
    apart = apart[np.isfinite(apart)]
    if apart.empty:
        return "Warning: the second aligner cannot judge any capture."
    silent = f" It cannot judge {_count(len(done) - len(apart))}." if len(apart) < len(done) else ""
    beyond = [f"{name}: {value:+.2f} dB" for name, value in apart.items() if abs(value) > AGREE]
    if not beyond:
        return (
            f"A second aligner, which shares no algorithm with the first, agrees within {AGREE} dB on "
            f"{_count(len(apart))}; its largest difference is {max(apart, key=abs):+.2f} dB.{silent}"
        )
    return (
        "Warning: a second aligner, which shares no algorithm with the first, gives scores that differ by more than "
        f"{AGREE} dB ({'; '.join(beyond)}). These scores depend on the alignment.{silent}"
    )


def _row(record: Record, score: Score | None, in_part: bool) -> dict[str, str]:
    """A capture's alignment, and the headline metric by another algorithm's."""
    geometry, scores = record["cell"]["geometry"], record["scores"]
    row = {"method": record["label"], "target": record["cell"]["target"], "alignment": geometry["kind"]}
    row |= _pose(geometry)
    if score:
        keys = (score.key, f"{score.key}_second", "second_aligner_px")
        first, second, apart = (scores.get(key, np.nan) for key in keys)
        row |= {score.axis: score.number(first), "by the second aligner": score.number(second)}
        row |= {"difference": score.number(second - first, signed=True)}
        row |= {"apart [target px]": UNKNOWN if np.isnan(apart) else f"{apart:.2f}"}
    for part in ("seen", "scored") if in_part else ():
        share = scores.get(f"share_{part}")
        row[f"{part} [%]"] = UNKNOWN if share is None else f"{100 * share:.1f}"
    return row


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
    drawn = [
        (record["cell"]["geometry"].get("correlation", np.nan), path, record["label"], record["cell"]["target"])
        for record in _captures(report)
        if record["state"] == DONE
        and (path := report.figures / alignment_name(record["label"], record["cell"]["target"])).is_file()
    ]
    drawn.sort(key=lambda picture: picture[0])
    more = (
        f" Shown are the {FIGURES} of {len(drawn)} captures with the lowest correlation, the lowest first; the others "
        f"are in the folder {report.figures.name}."
    )
    for correlation, path, method, target in drawn[:FIGURES]:
        yield (
            path,
            f"{method}, {target}, correlation {correlation:.3f}: the outline of the target on the capture, a dot at "
            "the target's upper left corner; and squares of the target and of the aligned, matched capture in "
            f"turn.{more * (len(drawn) > FIGURES)}",
        )


PARTS = (Part(140, _render, applies=lambda report: report.results.study.measure == FILES, figures=_figures),)
