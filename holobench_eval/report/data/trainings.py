"""What a study had to learn: the trainings behind its rows, with their logs and provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...study.artifacts import TrainingRecord, training_records
from ...study.plan import REFERENCE
from .layout import Layout
from .tables import DONE
from .text import words

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


def trainings(layout: Layout, records: Sequence[Mapping[str, Any]], output: Path) -> list[Training]:
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
    trained = [
        Training(
            words(list(dict.fromkeys(labels))),
            tuple(dict.fromkeys(labels)),
            _display(known.get(identity), conditions[identity]),
            known.get(identity),
            frozenset(used.get(identity, ())),
        )
        for identity, labels in rows.items()
    ]
    return _with_own_names(trained)


def _display(record: TrainingRecord | None, condition: str) -> str:
    return str(record.provenance["description"].get("profile", condition)) if record else condition


def _with_own_names(trained: list[Training]) -> list[Training]:
    names = [item.name for item in trained]
    return [
        item if names.count(item.name) == 1 else replace(item, name=f"{item.name} on {item.display}")
        for item in trained
    ]
