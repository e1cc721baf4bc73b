"""What a study had to learn: the trainings behind its rows, with their logs and provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...study.artifacts import TrainingRecord, training_records
from ...study.plan import is_reference
from ..facts import Facts
from ..results import DONE
from ..text import words

DISPLAY = "the display itself"


@dataclass(frozen=True)
class Training:
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

    def fact(self, name: str) -> Any:
        """What the provenance says under a name; None where it says nothing."""
        return self.record.provenance.get(name) if self.record else None

    def number(self, name: str) -> float:
        """A number of the provenance; NaN where it is not known."""
        value = self.fact(name)
        return float(value) if isinstance(value, int | float) else math.nan

    def text(self, name: str) -> str:
        """A text of the provenance, empty where there is none."""
        value = self.fact(name)
        return value if isinstance(value, str) else ""


def trainings(facts: Facts, records: Sequence[Mapping[str, Any]], output: Path) -> list[Training]:
    """Everything that a study had to learn, in the order of its rows, the display last.

    What a method needs is named first in a cell's ``prepared``, what the display needs last.
    """
    needed: dict[str, list[tuple[str, str, str]]] = {}  # by identity: label, condition, digest of what was learned
    for record in records:
        cell, prepared = record["cell"], record["cell"].get("prepared") or ()
        if prepared and not is_reference(cell["condition"]) and facts.of(record["label"], "trained", False):
            learned = record["learned"]["sha256"] if record["state"] == DONE and record.get("learned") else ""
            needed.setdefault(prepared[0], []).append((record["label"], cell["condition"], learned))
    for record in records if facts.network else ():
        if prepared := record["cell"]["prepared"]:
            needed.setdefault(prepared[-1], []).append((DISPLAY, facts.network, ""))
    known = training_records(output)
    trained = [_training(known.get(identity), uses) for identity, uses in needed.items()]
    names = [item.name for item in trained]
    return [
        item if names.count(item.name) == 1 else replace(item, name=f"{item.name} on {item.display}")
        for item in trained
    ]


def _training(record: TrainingRecord | None, uses: Sequence[tuple[str, str, str]]) -> Training:
    labels, display = tuple(dict.fromkeys(label for label, _, _ in uses)), uses[0][1]
    if record is not None:
        display = str(record.provenance["description"].get("profile", display))
    return Training(words(list(labels)), labels, display, record, frozenset(digest for _, _, digest in uses if digest))
