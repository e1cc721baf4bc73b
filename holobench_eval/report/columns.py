"""The columns of records.csv, table.csv and tests.csv: one list, which files, frames and columns.md follow.

An entry is name | kind | in records.csv: r of the record, c of the config, ? where any record has it | how a row of
table.csv takes it from its cells (empty: not there) | heading where a table says what a row took, {each} being what a
method makes for a target | meaning, and after // the meaning in table.csv. Its further lines are indented. Where a
column has a unit, the unit is the last part of its name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import pandas as pd

from .markdown import Markdown, blocks, code, heading, table
from .scores import DOMAIN_NAMES, METRICS, Score, parse
from .statistics import LEVEL, POWER

UNITS = {"px": "px", "s": "s", "mib": "MiB"}
PUBLISHED = "reported_"  # how columns of published figures begin
BEFORE_SCORES = """
study | text | c | first | | File name of the config without its ending; of scored folders, the folder of the report
measure | text | c | first | | What was scored: `picture` (captures against targets), `prediction` and
    `error_budget` (predictions against captures), `focus` (planes of focal stacks), `files` (pictures that were
    given)
display | text | r | first | | Name of the display: a profile, a bench, or a trained network. Rows of the floor have
    the display whose scored region they share
condition | text | r | first | | The display with what was changed on it, as report.md names it: the key that joins
    the three files. `reference` for rows of the floor
method | text | r | first | | Name of the method in configs
label | text | r | first | | Name of the row in tables: a method with its parameters
category | text | r | first | | What the method knows of the display: `open loop`, `calibrated`, `online` (captures
    the scored image), `oracle`, `given` (pictures from files); `floor`: an image that no method made
capture_limit | count | c | | | The most captures that the display allowed for a target; empty for no limit
panel_height_px | count | c | | | Rows of the panel
panel_width_px | count | c | | | Columns of the panel
parameters | text | | params | | Parameters of the method as JSON, defaults filled in
swept | text | c | swept | | What was changed after the display was calibrated, if anything, as the config names it;
    `plane` in focal stacks
swept_value | number | c | swept | | The change as a number; empty where the values are names
swept_unit | text | c | swept | | Unit of `swept_value`; `1` for a ratio, empty for the number of a draw or a panel
swept_name | text | c | swept | | The change where its values are names, such as a prescription
target | text | r | | | Name of the image
cluster | text | r | | | What the target shares with others, such as the photograph of a crop; else the target
    itself
repeat | count | r | | | Number of the measurement, from 0; repeats differ by their noise
seed | count | c | | | Seed of the study
state | text | r | | | `done`, `failed`, `skipped`, `unavailable` or `missing`
reason | text | r | | | Why a cell has no score
n | count | | n | | Targets with a score
failed | count | | failed | | Cells without a score
clusters | count | | clusters | | Clusters of the targets with a score
"""
AFTER_SCORES = """
captures | count | r | mean | captures per {each} | Captures that the method took while it solved the target, those
    of attempts that failed included // Captures while solving, mean over cells
solving_s | number | r | median_alone | | Time to solve the target, of the solving that made the
    phase, in this run or an earlier one // Time to solve a target, median over the cells timed alone, or over all;
    empty where it is more than 1.3 times that of the processors, as something else was at work
frames | count | r? | mean | frames of a hologram | Frames of the hologram, which share one exposure
panel_time | count | r? | mean | panel time [frames] | Frames shown for the picture, in the captures of solving and
    in the one that is scored
registration_residual_px | number | r | | | Rms residual of registration, in pixels of the scored region
saturated | number | r | | | Share of the capture's samples at full scale
memory_mib | number | r? | | | Most memory that solving took beyond what was in use before
cpu_s | number | r? | median | processor seconds per {each} | Time of all processors that solving took, on one or
    more cores // Time of all processors that solving took, median over cells
timed_alone | count | r? | | | 1 where nothing else was at work beside the solution, else 0
training_captures | count | r? | mean | captures for training | Captures that the method's training took, once for
    all targets // Captures of the training, once for all targets
training_s | number | r? | mean | seconds of training | Time that the training took // Time of the training
learned_sha256 | text | r? | together | | Digest of what was learned; empty for untrained methods // Digests of what
    was learned, with spaces between them
memory_mib | number | | median | memory [MiB] | Memory of solving, median over cells
total_captures | number | | total_captures | captures in total | All captures behind the row: of the training, and
    of every target
rank | count | | rank | | Place by the mean headline score among the rows of its display and category
stop_reason | text | r? | | | Why the display ended the method before it was done
phase_remark | text | r? | | | What is odd about the phase of a file or of a method of your own, on the nominal
    model
fell_back | text | r? | | | `yes` where a trained method fell back to Wirtinger holography, else empty
cell | text | r | | | Name of the capture: the digest of all that it depends on
exposure | text | r | | | `equal` light for all methods, or `matched` brightness
display_version | text | r | | | Version of the profile
protocol | text | r | | | Version of the metric protocol
"""
_DIFFERENCE = """
baseline | text | | | | Label of the row that it is compared with
metric | text | | | | The score that is compared: a column of records.csv
n | count | | | | Targets with a score of both
clusters | count | | | | Their clusters
better | count | | | | Targets with a better score than the baseline's
difference | number | | | | Score minus that of the baseline, mean over targets
difference_lo | number | | | | Lower end of its 95 % interval over clusters of targets, of one comparison and not
    adjusted
difference_hi | number | | | | Upper end of that interval
difference_median | number | | | | Median of the differences over targets
difference_detectable | number | | | | Size of a mean difference that a test of this one alone shows with
    {power:.0f} % power
p_adjusted | number | | | | Two-sided p of the mean difference, sign-flip min-p over clusters, adjusted for all
    tests of the study; empty: not tested
"""
# Scores that are no image metrics: key | unit | meaning.
_PLAIN = """
brightness_ratio | | Mean of the capture over mean of the target, before the intensity match
efficiency | | Light in the scored region over light on the panel
refine_dx_px | px | Horizontal motion that the refinement found
refine_dy_px | px | Vertical motion that the refinement found
refine_theta_deg | deg | Rotation that the refinement found
match_factor | | Factor of the intensity match
scale_0 | | Factor of the intensity match, red
scale_1 | | Factor of the intensity match, green
scale_2 | | Factor of the intensity match, blue
second_aligner_px | px | Most that a corner of the target lies elsewhere in the capture by a second aligner
share_scored | | Share of the target that is scored, which all its captures show
darkest | | How much brighter the capture's darkest part is than the target's, in parts of its white
odd_pixels | | Samples of the capture that stand out from all around them, as hot and dead pixels do
share_seen | | Share of the target that its capture shows
speckle_contrast | | Standard deviation over mean of intensity in flat patches of the target
unexplained_by_target | white^2 | Squared error of the capture that the target leaves, white being 1
unexplained_by_ideal_image | white^2 | The same that the ideal image of the hologram leaves
unexplained | white^2 | The same that the method's prediction leaves
unexplained_but_noise | white^2 | The same that the picture without temporal noise would leave
control | | Mean of the scores of control of the three changes
control_half | | 1 - squared error of the model's answer over the display's squared, if half of the picture loses
    its light
control_patch | | The same, if a patch of the picture becomes white, or black where it was bright
control_phase | | The same, if the phase in the middle of the panel moves by 0.5 rad rms
control_most | | The mean that noise allows a perfect model, from a second capture
error_of_ideal_image | white^2 | Squared error of the ideal image against the target
"""
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


@dataclass(frozen=True)
class Column:
    """A column: a line of the lists above. unit: of its values, empty for text and pure numbers."""

    name: str
    kind: str
    source: str
    table: str
    heading: str
    meaning: str
    unit: str = ""


def _entries(text: str) -> list[str]:
    return text.strip().replace("\n    ", " ").splitlines()


def _parsed(text: str) -> list[Column]:
    """The columns of a list, each with the unit that ends its name."""
    own = {"panel_time": "frames", "swept_value": "that of `swept_unit`"}
    columns = [Column(*(part.strip() for part in entry.split("|", 5))) for entry in _entries(text)]
    return [replace(each, unit=own.get(each.name) or UNITS.get(each.name.rpartition("_")[2], "")) for each in columns]


BEFORE, AFTER = _parsed(BEFORE_SCORES), _parsed(AFTER_SCORES)
RECORDED = {column.name: column for column in (*BEFORE, *AFTER) if column.source}
OF_STUDY = [name for name, column in RECORDED.items() if column.source == "c"]
TESTED = ["study", "measure", "display", "condition", "method", "label"]  # columns of table.csv that tests.csv has
_OWN = {"method": "Name of the tested method in configs", "label": "Name of its row in tables"}


def costs(rows: pd.DataFrame, each: str) -> dict[str, str]:
    """Headings of the known figures of a table that have one. each: what a method makes for a target."""
    headed = [column for column in AFTER if column.heading and column.table and column.name in rows]
    return {column.name: column.heading.format(each=each) for column in headed if rows[column.name].notna().any()}


def described(file: str, name: str) -> tuple[str, str, str]:
    """Meaning, unit and kind of a column of a file; ``Not described`` of one that nothing is known of."""
    columns = list(RECORDED.values()) if file == "records.csv" else [each for each in (*BEFORE, *AFTER) if each.table]
    if file == "tests.csv":
        unit = next(
            (metric.unit for metric in METRICS.values() if metric.unit and name.endswith(f"_{metric.unit.lower()}")), ""
        )
        name = name.removesuffix(f"_{unit.lower()}") if unit else name
        columns = [*(each for each in columns if each.name in TESTED), *_parsed(_DIFFERENCE.format(power=100 * POWER))]
    for column in columns:
        if column.name == name:
            own, _, there = column.meaning.partition(" // ")
            if file == "tests.csv":
                return _OWN.get(name, there or own), unit if column.name.startswith("difference") else "", column.kind
            if file == "table.csv":
                return there or own, column.unit, "number" if column.table == "mean" else column.kind
            return own, column.unit, column.kind
    if file == "table.csv" and name.startswith(PUBLISHED):
        return (
            "Published figure of the metric, of other hardware and images",
            parse(name.removeprefix(PUBLISHED)).unit,
            "number",
        )
    for end, statistic in (_STATISTICS if file == "table.csv" else {"": ""}).items() if file != "tests.csv" else ():
        score = parse(name.replace(end, ""))
        if score.statistic(end) == name and (known := _score(score)):
            return ", ".join(filter(None, (known[0], statistic))), known[1], "number"
    return "Not described", "", "number"


def _score(score: Score) -> tuple[str, str] | None:
    """Meaning and unit of a score; None of one that nothing is known of."""
    for key, unit, meaning in (map(str.strip, entry.split("|", 2)) for entry in _entries(_PLAIN)):
        if key == score.key:
            return meaning, unit
    if score.metric in METRICS and score.domain and (score.blur is not None or score.variant in _VARIANTS):
        blurred = f", both pictures blurred by a Gaussian of standard deviation {score.blur or 0:g} px"
        return f"{score.title} in {DOMAIN_NAMES[score.domain]}{_VARIANTS.get(score.variant, blurred)}", score.unit
    return None


def dictionary(files: Mapping[str, pd.DataFrame]) -> Markdown:
    """columns.md: a section for each file, a row for each column that it has."""
    parts: list[object] = [
        heading("Columns", 1),
        "Where a column has a unit, the unit is the last part of its name. Numbers have six significant digits, and an "
        "empty cell is an unknown number. Text that a spreadsheet would run as a formula has an apostrophe before it.",
    ]
    for file, frame in files.items():
        rows = []
        for name in map(str, frame):
            meaning, unit, kind = described(file, name)
            rows.append([code(name), Markdown(meaning), Markdown(unit), kind])
        parts += [heading(file), table(["column", "meaning", "unit", "type"], rows)]
    return blocks(parts)
