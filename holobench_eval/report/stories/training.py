"""Training: what was learned, from how many captures, how well captures of held-out images were foreseen, and what
trained methods say of their displays, beside the truth.

From ``estimates`` and ``missing`` in the provenance of a training (``study.training.diagnosis``).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from ...study.artifacts import TrainingRecord, training_records
from ...study.plan import is_reference
from ..charts.curves import draw_trainings
from ..markdown import bullets, heading, table_of
from ..results import DONE
from ..story import Blocks, Figures, Part, Report, is_many
from ..text import grouped, number, words

ORDER = 210
DISPLAY = "the display itself"
DIGITS = 10  # of a sha256 that are printed
MOST = 1e12  # no quantity is anywhere near; a larger number in a stranger's file is no estimate
T = TypeVar("T")


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

    def fact(self, name: str, kinds: type[T] | tuple[type[T], ...], otherwise: T) -> T:
        """What the provenance says under a name, if that is of these kinds, as a stranger's need not be."""
        value = self.record.provenance.get(name) if self.record else None
        return value if isinstance(value, kinds) else otherwise

    def text(self, name: str) -> str:
        """A text of the provenance, empty where there is none."""
        return self.fact(name, str, "")


def trainings(report: Report) -> list[Training]:
    """Everything that a study had to learn, in the order of its rows, the display last.

    What a method needs is named first in a cell's ``prepared``, what the display needs last.
    """
    facts, uses = (
        report.results.facts,
        list[tuple[str, tuple[str, str, str]]](),
    )  # by identity: label, condition, digest
    prepared = [(record, record["cell"]["prepared"]) for record in report.records if record["cell"].get("prepared")]
    for record, needed in prepared:
        label, condition = record["label"], record["cell"]["condition"]
        if facts.of(label, "trained", False) and not is_reference(condition):
            digest = record["learned"]["sha256"] if record["state"] == DONE and record.get("learned") else ""
            uses.append((needed[0], (label, condition, digest)))
    if facts.network:
        uses += [(needed[-1], (DISPLAY, facts.network, "")) for _, needed in prepared]
    known, learned = training_records(report.output), list[Training]()
    for identity, users in grouped(uses).items():
        labels, display, trained = tuple(dict.fromkeys(label for label, *_ in users)), users[0][1], known.get(identity)
        if trained:
            display = str(trained.provenance["description"].get("profile", display))
        digests = frozenset(digest for *_, digest in users if digest)
        learned.append(Training(words(list(labels)), labels, display, trained, digests))
    names = Counter(training.name for training in learned)
    return [replace(each, name=f"{each.name} on {each.display}") if names[each.name] > 1 else each for each in learned]


def _render(report: Report, figures: Figures) -> Blocks:
    learned = report.once(trainings)
    yield heading("Training")
    yield (
        "Training took place before any target was seen. Held-out images only monitor it; their captures and their "
        "time are counted. The folder training has every round, every estimate, and the effects of a display that a "
        "model cannot represent."
    )
    yield table_of(list(_summary(report)))
    yield bullets([*_doubts(learned), *(() if is_many(report.results) else _estimated(learned))])
    yield from figures


def _summary(report: Report) -> Iterator[dict[str, object]]:
    """What the trainings took, those of the same methods in a row."""
    learned, given = report.once(trainings), report.results.facts.training
    for labels, same in grouped((each.labels, each) for each in learned).items():
        rounds = [len(each.record.rounds) if each.record else math.nan for each in same]
        known = {name: [each.fact(name, (int, float), math.nan) for each in same] for name in ("captures", "seconds")}
        row: dict[str, object] = {"method": words(list(labels)), "trained on": _on(same)}
        row |= {name: _ends(values) for name, values in (known | {"rounds": rounds}).items()}
        row |= {"images": given.images - given.held_out if given else "–", "held out": given.held_out if given else "–"}
        if any(each.text("perceptual") for each in learned):
            row |= {"perceptual features": same[0].text("perceptual") or "none"}
        digests = [each.text("sha256")[:DIGITS] or "not trained" for each in same]
        yield row | {"learned state, sha256": digests[0] if len(same) == 1 else "in training"}


def _on(same: Sequence[Training]) -> str:
    return same[0].display if len(same) == 1 else f"{len(same)} displays"


def _ends(values: Sequence[float]) -> str:
    """A number, or the least and the most of several."""
    return " to ".join(dict.fromkeys(number(end) for end in (min(values), max(values))))


def _estimated(learned: Sequence[Training]) -> Iterator[str]:
    """How many quantities of a display each model estimates as well as it states, and what it cannot represent."""
    known = ((each.labels, (each, rows)) for each in learned if (rows := list(estimates(each))))
    for labels, same in grouped(known).items():
        each = [f"{within(rows)} on {training.display}" for training, rows in same]
        yield f"Within their stated errors, of what {words(list(labels))} estimates: {', '.join(each)}."


def _doubts(learned: Sequence[Training]) -> Iterator[str]:
    """Sentences on trainings that are missing beside the report, are not those that its scores come from, or give a
    method the display itself."""
    for training in learned:
        name, used = training.name, training.used
        if DISPLAY in training.labels[1:]:
            own = words([label for label in training.labels if label != DISPLAY])
            yield f"{own} solves through the network that is the display, and so knows the display exactly."
        if training.record is None:
            yield f"Nothing is known of the training of {name}: it failed, or its log is not in this folder."
        elif used and training.text("sha256") not in used:
            yield f"The figures for {name} here and its scores come from different trainings."
        if lacks := training.text("left_out"):
            yield f"The region is too small for all of the retrieval's loss: {name} has it without {lacks}."
        if outdated := training.text("in_the_place_of"):
            yield f"{name} was trained anew: {outdated}."
        if len(used) > 1:
            yield f"The scores of {name} come from {len(used)} different trainings."


def _figures(report: Report) -> Iterator[tuple[Path, str]]:
    rounds = [(training.name, training.record.rounds) for training in report.once(trainings) if training.record]
    for path in draw_trainings(report.figures / "training", rounds):
        yield (
            path,
            "Training: PSNR on held-out images of the predicted and of the captured picture against the target, and "
            "of the prediction against the capture (fidelity), against the captures taken, a mark per round.",
        )


def estimates(training: Training) -> Iterator[dict[str, Any]]:
    """The estimates of a training with their truths and stated errors, NaN where a stranger's file has no number, and
    how far estimate and truth are ``apart``, phases in rad by the shorter way around."""
    for row in training.fact("estimates", list, []):
        if isinstance(row, dict) and isinstance(row.get("name"), str) and type(row.get("colour")) in (int, type(None)):
            numbers = {key: _number(row.get(key)) for key in ("value", "truth", "error")}
            apart = numbers["value"] - numbers["truth"]
            turned = abs(math.remainder(apart, math.tau) if row.get("unit") == "rad" else apart)
            if not math.isnan(numbers["value"]):
                yield {"colour": None, "unit": None} | row | numbers | {"apart": turned}


def _number(value: object) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool) and -MOST < value < MOST:
        return float(value)
    return math.nan


def within(rows: Sequence[Mapping[str, Any]]) -> str:
    """How many numbers are as near to the truth as is stated, of those that have a truth and a stated error."""
    judged = [row for row in rows if not math.isnan(row["apart"] + row["error"])]
    return f"{sum(row['apart'] <= row['error'] for row in judged)} of {len(judged)} numbers"


PARTS = (Part(100, _render, applies=lambda report: bool(report.once(trainings)), figures=_figures, details=True),)
