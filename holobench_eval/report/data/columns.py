"""The columns of records.csv, table.csv and tests.csv: their names, and what each holds.

Where a column has a unit, the unit is the last part of its name in a file: ``psnr_linear_lo_db``, ``solving_s``. Frames
inside this package keep shorter names; :func:`file_name` and :func:`frame_name` translate.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from ...display.simulated.changes import KINDS
from .scores import DOMAIN_NAMES, METRICS, parse
from .statistics import LEVEL

File = Literal["records.csv", "table.csv", "tests.csv"]
Kind = Literal["text", "number", "count"]  # count: a whole number
PUBLISHED = "reported_"
RATIO = "1"  # unit of a swept ratio

# Names in frames and in files, where more than a unit differs.
_RENAMED = {
    "method": "label",
    "name": "method",
    "profile": "display",
    "profile_version": "display_version",
    "seconds": "solving_s",
    "training_seconds": "training_s",
    "track": "category",
    "stopped": "stop_reason",
}
_ORIGINAL = {after: before for before, after in _RENAMED.items()}
_SUFFIXES = tuple(f"_{metric.unit.lower()}" for metric in METRICS.values() if metric.unit)
_BLUR, _BLUR_PX = re.compile(r"(_blur\d+(?:\.\d+)?)"), re.compile(r"(_blur\d+(?:\.\d+)?)px")


@dataclass(frozen=True)
class Column:
    """A column of a file. name: with its unit; kind: of its values; unit: empty for text and pure numbers."""

    name: str
    meaning: str
    kind: Kind = "text"
    unit: str = ""


def _columns(*columns: Column) -> dict[str, Column]:
    return {column.name: column for column in columns}


_CHANGES = ", ".join(f"`{kind}`" for kind in KINDS)
_ROW = _columns(
    Column("study", "File name of the config without its ending; of scored folders, the folder of the report"),
    Column(
        "measure",
        "What was scored: `picture` (captures against targets), `prediction` and `error_budget` (predictions against "
        "captures), `focus` (planes of focal stacks), `files` (pictures that were given)",
    ),
    Column(
        "display",
        "Name of the display: a profile, a bench, or a trained network. Rows of the floor have the display whose "
        "scored region they share",
    ),
    Column(
        "condition",
        "The display with what was changed on it, as report.md names it: the key that joins the three files. "
        "`reference` for rows of the floor",
    ),
    Column("method", "Name of the method in configs"),
    Column("label", "Name of the row in tables: a method with its parameters"),
    Column(
        "category",
        "What the method knows of the display: `open loop`, `calibrated`, `online` (captures the scored image), "
        "`ceiling` (oracle), `given` (pictures from files); `floor`: an image that no method made",
    ),
    Column(
        "swept",
        f"What was changed after the display was calibrated, if anything: {_CHANGES}; `plane` in focal stacks",
    ),
    Column("swept_value", "The change as a number; empty where the values are names", "number", "that of `swept_unit`"),
    Column("swept_unit", f"Unit of `swept_value`; `{RATIO}` for a ratio, empty for the number of a draw or a panel"),
    Column("swept_name", "The change where its values are names, such as a prescription"),
)
_RECORD = _columns(
    Column("capture_limit", "The most captures that the display allowed for a target; empty for no limit", "count"),
    Column("panel_height_px", "Rows of the panel", "count", "px"),
    Column("panel_width_px", "Columns of the panel", "count", "px"),
    Column("target", "Name of the image"),
    Column("cluster", "What the target shares with others, such as the photograph of a crop; else the target itself"),
    Column("repeat", "Number of the measurement, from 0; repeats differ by their noise", "count"),
    Column("seed", "Seed of the study", "count"),
    Column("state", "`done`, `failed`, `skipped`, `unavailable` or `missing`"),
    Column("reason", "Why a cell has no score"),
    Column("stop_reason", "Why the display ended the method before it was done"),
    Column("fell_back", "`yes` where a trained method fell back to Wirtinger holography, else empty"),
    Column("captures", "Captures that the method took while it solved the target", "count"),
    Column("solving_s", "Time to solve the target", "number", "s"),
    Column("registration_residual_px", "Rms residual of registration, in pixels of the scored region", "number", "px"),
    Column("saturated", "Share of the capture's samples at full scale", "number"),
    Column("memory_mib", "Most memory that solving took beyond what was in use before", "number", "MiB"),
    Column("timed_alone", "1 where nothing else was at work beside the solution, else 0", "count"),
    Column("training_captures", "Captures that the method's training took, once for all targets", "count"),
    Column("training_s", "Time that the training took", "number", "s"),
    Column("learned_sha256", "Digest of what was learned; empty for untrained methods"),
    Column("cell", "Digest of everything that the number depends on: the name of its record"),
    Column("exposure", "`equal` light for all methods, or `matched` brightness"),
    Column("display_version", "Version of the profile"),
    Column("protocol", "Version of the metric protocol"),
)
_INTERVAL = f"{100 * LEVEL:.0f} % interval over clusters of targets"
_TABLE = _columns(
    Column("parameters", "Parameters of the method as JSON, defaults filled in"),
    Column("n", "Targets with a score", "count"),
    Column("failed", "Cells without a score", "count"),
    Column("clusters", "Clusters of the targets with a score", "count"),
    Column("captures", "Captures while solving, mean over cells", "number"),
    Column("solving_s", "Time to solve a target, mean over the cells timed alone, or over all", "number", "s"),
    Column("training_captures", "Captures of the training, once for all targets", "number"),
    Column("training_s", "Time of the training", "number", "s"),
    Column("learned_sha256", "Digests of what was learned, with spaces between them"),
    Column("memory_mib", "Memory of solving, median over cells", "number", "MiB"),
    Column("total_captures", "All captures behind the row: of the training, and of every target", "number"),
    Column("rank", "Place by the mean headline score among the rows of its display and category", "count"),
)
_TEST = _columns(
    *(_ROW[name] for name in ("study", "measure", "display", "condition")),
    Column("method", "Name of the tested method in configs"),
    Column("label", "Name of its row in tables"),
    Column("baseline", "Label of the row that it is compared with"),
    Column("metric", "The score that is compared: a column of records.csv"),
    Column("n", "Targets with a score of both", "count"),
    Column("clusters", "Their clusters", "count"),
    Column("better", "Targets with a better score than the baseline's", "count"),
    Column(
        "p_adjusted",
        "Two-sided p of the mean difference, sign-flip max-t over clusters, adjusted for all tests of the study; "
        "empty: not tested",
        "number",
    ),
)
_DIFFERENCES = {
    "difference": "Score minus that of the baseline, mean over targets",
    "difference_lo": f"Lower end of its {_INTERVAL}, of one comparison and not adjusted",
    "difference_hi": "Upper end of that interval",
    "difference_median": "Median of the differences over targets",
}
_FILES: dict[File, dict[str, Column]] = {"records.csv": _ROW | _RECORD, "table.csv": _ROW | _TABLE, "tests.csv": _TEST}

# Scores that are not image metrics: meaning, unit.
_WHITE = "white^2"
_FIGURES = {
    "brightness_ratio": ("Mean of the capture over mean of the target, before the intensity match", ""),
    "efficiency": ("Light in the scored region over light on the panel", ""),
    "refine_dx_px": ("Horizontal motion that the refinement found", "px"),
    "refine_dy_px": ("Vertical motion that the refinement found", "px"),
    "refine_theta_deg": ("Rotation that the refinement found", "deg"),
    "scale_0": ("Factor of the intensity match, red", ""),
    "scale_1": ("Factor of the intensity match, green", ""),
    "scale_2": ("Factor of the intensity match, blue", ""),
    "second_aligner_px": (
        "Most that a corner of the target lies elsewhere in the capture by a second aligner",
        "px",
    ),
    "share_scored": ("Share of the target that is scored, which all its captures show", ""),
    "share_seen": ("Share of the target that its capture shows", ""),
    "speckle_contrast": ("Standard deviation over mean of intensity in flat patches of the target", ""),
    "unexplained_by_target": ("Squared error of the capture that the target leaves, white being 1", _WHITE),
    "unexplained_by_ideal_image": ("The same that the ideal image of the hologram leaves", _WHITE),
    "unexplained": ("The same that the method's prediction leaves", _WHITE),
    "unexplained_but_noise": ("The same that the picture without temporal noise would leave", _WHITE),
    "error_of_ideal_image": ("Squared error of the ideal image against the target", _WHITE),
}
_VARIANTS = {
    "refined": "after a rigid motion of at most 2 px and 0.1 degree",
    "infocus": "of what is in focus at the plane",
    "second": "by a second, independent registration",
}
_STATISTICS = {
    "_lo": f"lower end of the {_INTERVAL}",
    "_hi": f"upper end of the {_INTERVAL}",
    "_median": "median over targets",
}


def file_name(name: str) -> str:
    """The name in files of a column of a frame."""
    if name in _RENAMED:
        return _RENAMED[name]
    unit = parse(name.removeprefix(PUBLISHED)).unit
    return _BLUR.sub(r"\1px", name) + (f"_{unit.lower()}" if unit else "")


def frame_name(name: str) -> str:
    """The name in frames of a column of a file; inverse of :func:`file_name`."""
    if name in _ORIGINAL:
        return _ORIGINAL[name]
    stem = next((name.removesuffix(suffix) for suffix in _SUFFIXES if name.endswith(suffix)), name)
    return _BLUR_PX.sub(r"\1", stem)


def column(file: File, name: str) -> Column | None:
    """What a column of a file holds; None for one that the dictionary lacks."""
    if name in _FILES[file]:
        return _FILES[file][name]
    stem = frame_name(name)
    if file == "tests.csv":
        unit = name.removeprefix(stem).removeprefix("_")
        return Column(name, _DIFFERENCES[stem], "number", _unit(unit)) if stem in _DIFFERENCES else None
    if file == "table.csv" and stem.startswith(PUBLISHED):
        unit = parse(stem.removeprefix(PUBLISHED)).unit
        return Column(name, "Published figure of the metric, of other hardware and images", "number", unit)
    mean = "mean over targets" if file == "table.csv" else ""
    for suffix, meaning in _STATISTICS.items() if mean else ():
        if stem.endswith(suffix):
            stem, mean = stem.removesuffix(suffix), meaning
    return _score(name, stem, mean)


def _score(name: str, key: str, statistic: str) -> Column | None:
    """A score's column. key: without unit and statistic; statistic: over targets, empty for single cells."""
    score = parse(key)
    if key in _FIGURES:
        parts, unit = [_FIGURES[key][0]], _FIGURES[key][1]
    elif score.metric in METRICS and score.domain:
        parts, unit = [f"{score.title} in {DOMAIN_NAMES[score.domain]}"], score.unit
        if score.blur is not None:
            parts.append(f"both pictures blurred by a Gaussian of standard deviation {score.blur:g} px")
        elif score.variant:
            if score.variant not in _VARIANTS:
                return None
            parts.append(_VARIANTS[score.variant])
    else:
        return None
    return Column(name, ", ".join([*parts, *filter(None, [statistic])]), "number", unit)


def _unit(lower: str) -> str:
    """A metric's unit as it is written, from the end of a column's name."""
    return next((metric.unit for metric in METRICS.values() if metric.unit.lower() == lower), "")
