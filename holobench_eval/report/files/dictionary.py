"""columns.md: what every column of a report's files holds, those of scores included, which no list has one by one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import pandas as pd

from ..data.column import Column
from ..data.columns import recorded, tabled
from ..data.scores import DOMAIN_NAMES, METRICS, Score, parse
from ..data.statistics import LEVEL
from ..data.tables import PUBLISHED
from ..markdown import Markdown, blocks, code, heading, table
from .tests_csv import of_tests

File = Literal["records.csv", "table.csv", "tests.csv"]

# Scores that are not image metrics: meaning, unit.
_WHITE = "white^2"
_KEYS = {
    "brightness_ratio": ("Mean of the capture over mean of the target, before the intensity match", ""),
    "efficiency": ("Light in the scored region over light on the panel", ""),
    "refine_dx_px": ("Horizontal motion that the refinement found", "px"),
    "refine_dy_px": ("Vertical motion that the refinement found", "px"),
    "refine_theta_deg": ("Rotation that the refinement found", "deg"),
    "match_factor": ("Factor of the intensity match", ""),
    "scale_0": ("Factor of the intensity match, red", ""),
    "scale_1": ("Factor of the intensity match, green", ""),
    "scale_2": ("Factor of the intensity match, blue", ""),
    "second_aligner_px": ("Most that a corner of the target lies elsewhere in the capture by a second aligner", "px"),
    "share_scored": ("Share of the target that is scored, which all its captures show", ""),
    "darkest": ("How much brighter the capture's darkest part is than the target's, in parts of its white", ""),
    "odd_pixels": ("Samples of the capture that stand out from all around them, as hot and dead pixels do", ""),
    "share_seen": ("Share of the target that its capture shows", ""),
    "speckle_contrast": ("Standard deviation over mean of intensity in flat patches of the target", ""),
    "unexplained_by_target": ("Squared error of the capture that the target leaves, white being 1", _WHITE),
    "unexplained_by_ideal_image": ("The same that the ideal image of the hologram leaves", _WHITE),
    "unexplained": ("The same that the method's prediction leaves", _WHITE),
    "unexplained_but_noise": ("The same that the picture without temporal noise would leave", _WHITE),
    "control": ("Mean of the scores of control of the three changes", ""),
    "control_half": (
        "1 - squared error of the model's answer over the display's squared, if half of the picture loses its light",
        "",
    ),
    "control_patch": ("The same, if a patch of the picture becomes white, or black where it was bright", ""),
    "control_phase": ("The same, if the phase in the middle of the panel moves by 0.5 rad rms", ""),
    "control_most": ("The mean that noise allows a perfect model, from a second capture", ""),
    "error_of_ideal_image": ("Squared error of the ideal image against the target", _WHITE),
}
_VARIANTS = {
    "": "",
    "refined": ", after a rigid motion of at most 2 px and 0.1 degree",
    "infocus": ", of what is in focus at the plane",
    "second": ", by a second, independent registration",
    "mended": ", without what stands out from all around it, as hot and dead pixels do",
}
_INTERVAL = f"{100 * LEVEL:.0f} % interval over clusters of targets"
_STATISTICS = {
    "": "mean over targets",
    "_lo": f"lower end of the {_INTERVAL}",
    "_hi": f"upper end of the {_INTERVAL}",
    "_median": "median over targets",
}


def column(file: File, name: str) -> Column | None:
    """What a column of a file holds; None for one that nothing is known of."""
    if file == "tests.csv":
        listed = [column for metric in METRICS for column in of_tests(Score(metric, metric))]
    else:
        listed = recorded() if file == "records.csv" else tabled()
    found = next((column for column in listed if column.name == name), None)
    if found or file == "tests.csv":
        return found
    if file == "table.csv" and name.startswith(PUBLISHED):
        unit = parse(name.removeprefix(PUBLISHED)).unit
        return Column(name, "Published figure of the metric, of other hardware and images", "number", unit)
    for end, meaning in (_STATISTICS if file == "table.csv" else {"": ""}).items():
        score = parse(name.replace(end, ""))
        if score.statistic(end) == name and (found := _score(score, name, meaning)):
            return found
    return None


def _score(score: Score, name: str, statistic: str) -> Column | None:
    """A score's column. statistic: over targets, empty for single cells."""
    if score.key in _KEYS:
        meaning, unit = _KEYS[score.key]
    elif score.metric in METRICS and score.domain and (score.blur is not None or score.variant in _VARIANTS):
        blurred = f", both pictures blurred by a Gaussian of standard deviation {score.blur or 0:g} px"
        variant = _VARIANTS.get(score.variant, blurred)
        meaning, unit = f"{score.title} in {DOMAIN_NAMES[score.domain]}{variant}", score.unit
    else:
        return None
    return Column(name, f"{meaning}, {statistic}" if statistic else meaning, "number", unit)


def dictionary(files: Mapping[File, pd.DataFrame]) -> Markdown:
    """A section for every file, a row for every column that it has."""
    parts: list[object] = [
        heading("Columns", 1),
        "Where a column has a unit, the unit is the last part of its name. Numbers have six significant digits, and an "
        "empty cell is an unknown number. Text that a spreadsheet would run as a formula has an apostrophe before it.",
    ]
    for file, frame in files.items():
        parts += [
            heading(file),
            table(["column", "meaning", "unit", "type"], [_row(file, str(name)) for name in frame]),
        ]
    return blocks(parts)


def _row(file: File, name: str) -> list[object]:
    found = column(file, name) or Column(name, "Not described", "number")
    return [code(name), Markdown(found.meaning), Markdown(found.unit), found.kind]
