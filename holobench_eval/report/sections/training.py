"""The section on training: what was learned, from how many captures, and how well held-out captures were foreseen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ...study.artifacts import TrainingRecord, training_records
from ...study.plan import REFERENCE
from ..data.layout import Layout
from ..data.tables import DONE
from ..data.text import words
from ..markdown import table
from .tables import number

DISPLAY = "the display itself"
DIGITS = 10
"""Of a sha256 that are printed."""


@dataclass(frozen=True)
class Trained:
    """Something that a study had to learn.

    name: the rows that need it, ``labels``, in words; display: what it was trained on; record: what is known of its
    training (None: there is none beside the report); used: sha256 of the learned states that the study's scores come
    from.
    """

    name: str
    labels: tuple[str, ...]
    display: str
    record: TrainingRecord | None
    used: frozenset[str] = frozenset()

    def fact(self, name: str) -> float:
        """A number of the provenance; NaN where it is not known."""
        value = self.record.provenance.get(name) if self.record else None
        return float(value) if isinstance(value, int | float) else math.nan

    def text(self, name: str) -> str:
        """A text of the provenance, empty where there is none."""
        value = self.record.provenance.get(name) if self.record else None
        return value if isinstance(value, str) else ""


def trainings(layout: Layout, records: Sequence[Mapping[str, Any]], output: Path) -> list[Trained]:
    """Everything that a study had to learn, in the order of its rows, the display last.

    What a method needs is named first in a cell's ``prepared``, what the display needs last.
    """
    known, rows, used = training_records(output), dict[str, list[str]](), dict[str, set[str]]()
    conditions: dict[str, str] = {}
    for record in records:
        cell, prepared = record["cell"], record["cell"].get("prepared") or ()
        if not prepared or cell["condition"] == REFERENCE:
            continue
        if record["label"] in layout.trained:
            rows.setdefault(prepared[0], []).append(record["label"])
            conditions.setdefault(prepared[0], cell["condition"])
            if record["state"] == DONE and record.get("learned"):
                used.setdefault(prepared[0], set()).add(str(record["learned"]["sha256"]))
    if layout.learned_display is not None:
        for identity in dict.fromkeys(
            record["cell"]["prepared"][-1] for record in records if record["cell"]["prepared"]
        ):
            rows.setdefault(identity, []).append(DISPLAY)
            conditions.setdefault(identity, layout.learned_display)
    found = [
        Trained(
            words(list(dict.fromkeys(labels))),
            tuple(dict.fromkeys(labels)),
            _display(known.get(identity), conditions[identity]),
            known.get(identity),
            frozenset(used.get(identity, ())),
        )
        for identity, labels in rows.items()
    ]
    return _told_apart(found)


def _display(record: TrainingRecord | None, condition: str) -> str:
    return str(record.provenance["description"].get("profile", condition)) if record else condition


def _told_apart(found: list[Trained]) -> list[Trained]:
    names = [one.name for one in found]
    return [one if names.count(one.name) == 1 else replace(one, name=f"{one.name} on {one.display}") for one in found]


def summary(layout: Layout, found: Sequence[Trained]) -> Markup:
    """What each training took."""
    given, features = layout.training, any(one.text("perceptual") for one in found)
    images, held_out = (given.images - given.held_out, given.held_out) if given else ("–", "–")
    rows = [
        [
            one.name,
            one.display,
            number(one.fact("captures")),
            number(one.fact("seconds")),
            images,
            held_out,
            (len(one.record.rounds) or "–") if one.record else "–",
            *([one.text("perceptual") or "none"] if features else []),
            one.text("sha256")[:DIGITS] or "not trained",
        ]
        for one in found
    ]
    columns = ["method", "trained on", "captures", "seconds", "images", "held out", "rounds"]
    return table([*columns, *(["perceptual features"] if features else []), "learned state, sha256"], rows)


def rounds(found: Sequence[Trained]) -> Markup:
    """Every round of every training on held-out images; empty where no method logged any."""

    def decibel(value: float) -> str:
        return "–" if math.isnan(value) else f"{value:.2f}"

    rows = [
        [
            one.name,
            step.number,
            number(step.captures),
            number(step.seconds),
            *map(decibel, (step.predicted, step.captured, step.fidelity)),
        ]
        for one in found
        for step in (one.record.rounds if one.record else ())
        if not all(map(math.isnan, (step.predicted, step.captured, step.fidelity)))
    ]
    figures = ("PSNR, predicted [dB]", "PSNR, captured [dB]", "fidelity [dB]")
    return table(["method", "round", "captures so far", "seconds so far", *figures], rows) if rows else Markup("")


def paragraph(layout: Layout, found: Sequence[Trained]) -> str:
    """Who is trained, on what, and that no training image is scored; empty for a study in which nothing is trained."""
    given = layout.training
    if given is None or not found:
        return ""
    methods = [label for label in layout.methods if label in layout.trained]
    who = words([*methods, *([DISPLAY] if layout.learned_display is not None else [])])
    many = len(methods) + (layout.learned_display is not None) > 1
    limit = "" if given.captures is None else f", and none may take more than {given.captures} captures for it"
    return (
        f"{who[:1].upper() + who[1:] if who.startswith('the ') else who} {'are' if many else 'is'} trained on captures "
        f"of a display before any target is seen. The {given.images} training images come from the dataset "
        f"{given.dataset}; {given.held_out} of them only watch the training. All methods of the study are "
        f"given the same{limit}. Training images are never scored: a study in which one is a target is refused. "
        f"{_taken(found)}"
    )


def _taken(found: Sequence[Trained]) -> str:
    counts = sorted(value for one in found if math.isfinite(value := one.fact("captures")))
    if not counts:
        return "No training has been finished."
    if counts[0] == counts[-1]:
        each = "The training" if len(counts) == 1 else f"Each of the {len(counts)} trainings"
        return f"{each} took {counts[0]:.0f} captures, those of held-out images included."
    return (
        f"The {len(counts)} trainings took {counts[0]:.0f} to {counts[-1]:.0f} captures, those of held-out images "
        "included."
    )


def doubts(found: Sequence[Trained]) -> list[str]:
    """Sentences on trainings that are missing beside the report, are not those that its scores come from, or give a
    method the display itself."""
    said = []
    for one in found:
        if DISPLAY in one.labels[1:]:
            own = words([label for label in one.labels if label != DISPLAY])
            said.append(f"{own} solves through the very network that is the display here, and so knows it exactly.")
        if one.record is None:
            said.append(f"Nothing is known of the training of {one.name}: it failed, or its log is not in this folder.")
        elif one.used and one.text("sha256") not in one.used:
            said.append(f"The figures for {one.name} here are of another training than its scores come from.")
        if len(one.used) > 1:
            said.append(f"The scores of {one.name} come from {len(one.used)} different trainings.")
    return said
