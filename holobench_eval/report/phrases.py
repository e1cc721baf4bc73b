"""Rows and differences in words, with all that belongs to them.

A row of a table is marked where its method is an oracle, fell back, learned too little or is dominated; a difference
has its interval, sample and p value, and says whether it is shown.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..core import plugins
from ..core.errors import listed, one_line
from ..study.folders.files import named
from ..study.versions import EDITED, dataset_version
from .facts import ORACLE, PLACES
from .results import DONE, Results
from .scores import Score
from .statistics import FEWEST, SIGNIFICANCE, Estimate, PairedTest
from .text import words

UNSHOWN, ALIKE = "not shown to differ", "alike"
# By the unit of a headline: the least difference that matters, which begins the next letter of a board, since another
# seed moves a score by 0.03 dB, and how far behind the best of its letter a row is at most.
MARGINS = {"dB": (0.1, 1.0)}
INSTALLED = frozenset({"site-packages", "dist-packages"})  # folders of packages that pip has installed


def difference(score: Score, estimate: Estimate) -> str:
    """``+1.20 dB [+0.80, +1.60]``."""
    return score.estimate(estimate, signed=True, unit=True)


def effect(score: Score, test: PairedTest) -> str:
    """``verdict``, but ``alike`` where a difference is shown and smaller than what matters."""
    told, margin = verdict(score, test), MARGINS.get(score.unit, (0.0, np.inf))[0]
    return ALIKE if told in ("better", "worse") and abs(test.estimate.mean) < margin else told


def verdict(score: Score, test: PairedTest) -> str:
    """``better``, ``worse``, ``not shown to differ`` or, without a test, ``not tested``."""
    if np.isnan(test.p):
        return "not tested"
    if not test.is_shown:
        return UNSHOWN
    return "better" if score.better(test.estimate.mean, 0.0) else "worse"


def value(results: Results, label: str, condition: str) -> str:
    """The mean of the headline with its unit: ``20.62 dB``."""
    return results.headline.with_unit(float(results.values(label, condition).mean()))


def marked(results: Results, label: str, condition: str) -> str:
    """A method's label with what must be known of its row: an oracle, a fallback, a network that learned too little."""
    return ", ".join([results.facts.marked(label), *marks(results, label, condition)])


def counted(results: Results, label: str, condition: str) -> str:
    """``marked``, and how many targets have a score where that is not all: for tables without a column of that."""
    scored, total = results.rows[label, condition]["n"], len(results.targets)
    return f"{marked(results, label, condition)}{f', {scored:.0f} of {total} targets' * bool(scored < total)}"


def marks(results: Results, label: str, condition: str) -> Iterator[str]:
    """What must be known of a row."""
    cells = results.cells[label, condition]
    if "fell_back" in cells and (cells["fell_back"] != "").any():
        yield "fell back to Wirtinger"
    if "stop_reason" in cells and (ended := cells.loc[cells["stop_reason"] != "", "target"].nunique()):
        yield f"stopped by the display on {ended} target{'s' * (ended > 1)}"
    if results.study.measure == "prediction" and (below := _below(results, label, condition)):
        yield f"not trained to convergence: below {words(below)}"
    if results.study.measure == "picture" and (rival := _dominating(results, label, condition)):
        yield f"dominated by {rival}"


def _below(results: Results, label: str, condition: str) -> list[str]:
    """What predicts the captures better than a trained method though it takes no training."""
    is_identity = results.facts.labels("identity")
    if label not in results.facts.labels("trained") - is_identity or not results.is_complete(label, condition):
        return []
    untrained = [name for name in is_identity if name in results.methods(condition)]
    means = [("the ideal image", results.values(name, condition).mean()) for name in untrained]
    if (floor := results.floor(condition)) is not None:
        means.insert(0, ("the constant image", floor))
    ours, better = results.values(label, condition).mean(), results.headline.better
    return [text for text, mean in means if better(mean, ours)]


def _dominating(results: Results, label: str, condition: str) -> str:
    """The best method without photographs that is as fast as a network without photographs, where the network is not
    shown to be better; empty where there is none."""
    rows = {name: results.rows[name, condition] for name in results.ranking(condition)}
    blind = {name: row.get("cpu_s", np.nan) for name, row in rows.items() if row.get("total_captures") == 0}
    if label not in blind or label not in results.facts.labels("trained"):
        return ""
    rival = next(name for name, seconds in blind.items() if name == label or seconds <= blind[label])
    gain = results.estimate(results.values(label, condition) - results.values(rival, condition))
    least = gain.low if results.headline.sign > 0 else gain.high
    return "" if rival == label or results.headline.better(least, 0.0) else rival


def uncovered(records: Sequence[Mapping[str, Any]]) -> str:
    """What methods and datasets were seen to take that no cell is named after; empty for nothing. Installed files do
    not count: their packages have versions."""
    found: dict[str, dict[str, None]] = {}
    for record in records:
        own = [name for name in record.get("uncovered") or () if not INSTALLED.intersection(Path(name).parts)]
        found.setdefault(str(record["label"]), {}).update(dict.fromkeys(map(one_line, own)))
    parts = [f"{label} reads {named(list(names))}" for label, names in found.items() if names]
    again = ", with --retrain" * any(record.get("learned") for record in records if record.get("uncovered"))
    remedy = f"a change there is not noticed; after one choose another --output{again}"
    return f"Not covered: {'; '.join(parts)}: {remedy}." if parts else ""


def edited(records: Sequence[Mapping[str, Any]]) -> str:
    """Which methods and datasets of this package differ from those that were released; empty for none."""
    labels = [str(record["label"]) for record in records if EDITED in str(record["cell"].get("code"))]
    datasets = {str(record["cell"].get("dataset")) for record in records}
    shipped = [name for name in sorted(datasets) if plugins.is_shipped("datasets", name)]
    labels += [name for name in shipped if dataset_version(name, plugins.find("datasets", name))]
    whose = listed(dict.fromkeys(labels), "and")
    return f"Edited: the code of {whose} is not as released; its cells have names of their own." if labels else ""


def too_few(results: Results) -> str:
    """That no test of two methods can show anything on so few clusters; empty where one can, and without any test."""
    rivals = max(
        (
            len({*results.methods(name)} - {*[label for label in results.labels if results.category(label) == ORACLE]})
            for name in results.conditions
        ),
        default=0,
    )
    clusters, enough = len(set(results.clusters)), 1 + math.ceil(-math.log2(SIGNIFICANCE))
    if rivals < 2 or not FEWEST <= clusters < enough:
        return ""
    groups = "scenes" if results.study.measure in PLACES else "targets that are independent"
    return f"No difference can be shown: {clusters} {groups} are too few for a test, {enough} are needed."


def remarks(results: Results) -> list[str]:
    """A sentence for all that is odd about phases; remarks that differ in numbers alone share one."""
    if "phase_remark" not in results.frame:
        return []
    odd = results.frame[(results.frame["state"] == DONE) & (results.frame["phase_remark"] != "")]
    alike = odd["phase_remark"].str.replace(r"-?\d+\.\d+", "0", regex=True)
    sentences = []
    for (name, _), cells in odd.groupby(["label", alike], sort=False):
        displays, targets = words(list(cells["condition"].unique())), cells["target"].unique()
        others = f" and {len(targets) - 1} more" * (len(targets) > 1)
        remark = f"for {targets[0]}{others}, the phase {cells['phase_remark'].iloc[0]}"
        sentences.append(f"Check the phases of {name} on {displays}: {remark}.")
    return sentences
