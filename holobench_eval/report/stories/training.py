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

from ...core.errors import listed
from ...display.estimates import QUANTITIES
from ...study.artifacts import TrainingRecord, training_records
from ...study.plan import is_reference
from ..charts.curves import draw_trainings
from ..data.tables import DONE
from ..data.text import grouped, number, words
from ..markdown import Markdown, bullets, heading, table_of
from ..story import Blocks, Figures, Part, Report, is_many

ORDER = 210
DISPLAY = "the display itself"
DIGITS = 10  # of a sha256 that are printed
COLOURS = {None: "all", 0: "red", 1: "green", 2: "blue"}
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
    layout, uses = report.layout, list[tuple[str, tuple[str, str, str]]]()  # by identity: label, condition, digest
    prepared = [(record, record["cell"]["prepared"]) for record in report.records if record["cell"].get("prepared")]
    for record, needed in prepared:
        label, condition = record["label"], record["cell"]["condition"]
        if label in layout.trained and not is_reference(condition):
            digest = record["learned"]["sha256"] if record["state"] == DONE and record.get("learned") else ""
            uses.append((needed[0], (label, condition, digest)))
    if layout.learned_display is not None:
        uses += [(needed[-1], (DISPLAY, layout.learned_display, "")) for _, needed in prepared]
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
        "time are counted."
    )
    yield table_of(list(_summary(report)))
    yield bullets(_doubts(learned))
    if rounds := table_of(list(_rounds(learned))):
        yield (
            "Held-out images after every round, matched in intensity. Predicted: the method's prediction against the "
            "target. Captured: the capture against the target. Fidelity: the prediction against the capture. Where "
            "predicted exceeds captured, the prediction promises more than the display shows."
        )
    yield rounds or "No figures on held-out images were logged."
    yield from figures


def _summary(report: Report) -> Iterator[dict[str, object]]:
    """What each training took."""
    learned, given = report.once(trainings), report.layout.training
    for training in learned:
        captures, seconds = (training.fact(name, (int, float), math.nan) for name in ("captures", "seconds"))
        row: dict[str, object] = {"method": training.name, "trained on": training.display}
        row |= {"captures": number(captures), "seconds": number(seconds)}
        row |= {"images": given.images - given.held_out if given else "–", "held out": given.held_out if given else "–"}
        row |= {"rounds": len(training.record.rounds) or "–" if training.record else "–"}
        if any(each.text("perceptual") for each in learned):
            row |= {"perceptual features": training.text("perceptual") or "none"}
        yield row | {"learned state, sha256": training.text("sha256")[:DIGITS] or "not trained"}


def _rounds(learned: Sequence[Training]) -> Iterator[dict[str, object]]:
    """Every round of every training on held-out images; none where no method logged any."""
    for training in learned:
        for step in training.record.rounds if training.record else ():
            figures = {
                "PSNR, predicted [dB]": step.predicted,
                "PSNR, captured [dB]": step.captured,
                "fidelity [dB]": step.fidelity,
            }
            if not all(map(math.isnan, figures.values())):
                row = {"method": training.name, "round": step.number}
                row |= {"captures so far": number(step.captures), "seconds so far": number(step.seconds)}
                yield row | {name: "–" if math.isnan(db) else f"{db:.2f}" for name, db in figures.items()}


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


def _diagnosis(report: Report, _: Figures) -> Blocks:
    learned = report.once(trainings)
    estimated = [(training, rows) for training in learned if (rows := list(estimates(training)))]
    if estimated:
        yield heading("Diagnosis", 3)
        yield (
            "Display parameters as the learned models estimate them, in forms that captures determine; in brackets the "
            "ground truth of the simulated bench, which no method sees. The stated error holds for a model that was "
            "trained on patterns that reach every level of the panel."
        )
    for training, rows in estimated:
        where = f" on {training.display}"
        yield Markdown("**{}.** {}").format(training.name.removesuffix(where) + where, verdict(rows))
        yield quantities(rows)
    if lacking := missing(learned):
        yield (
            "Effects of the benches that the learned models cannot represent, so that no values of their parameters "
            "describe the display exactly:"
        )
        yield bullets(lacking)


def missing(learned: Sequence[Training]) -> list[str]:
    """For every display, what lies outside the form of the models that were trained on it."""
    stated = ((training, training.fact("missing", list, None)) for training in learned)
    lists = grouped(
        ((training.display, *texts), label)
        for training, texts in stated
        if texts is not None and all(isinstance(text, str) for text in texts)
        for label in training.labels
    )
    return [
        f"{display} contains {'effects' if texts else 'no effect'} that {listed(dict.fromkeys(labels))} cannot "
        f"represent{': ' * bool(texts)}{'; '.join(texts)}."
        for (display, *texts), labels in lists.items()
    ]


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


def quantities(rows: Sequence[Mapping[str, Any]]) -> Markdown | None:
    """A row for every quantity, a column for every colour: the estimate and, in brackets, the truth; of what no capture
    shows, neither."""
    colours: list[int | None] = sorted({row["colour"] for row in rows if row["colour"] is not None})
    if colours == [0]:  # of the only laser
        rows, colours = [{**row, "colour": None} for row in rows], []
    if any(row["colour"] is None for row in rows):
        colours.append(None)
    has_truth, lines = any(not math.isnan(row["truth"]) for row in rows), []
    for name, same in grouped((row["name"], row) for row in rows).items():
        first, cells, off = same[0], dict.fromkeys(colours, ""), [-1.0]
        for row in same:
            truth = "–" if math.isnan(row["truth"]) else f"{row['truth']:.3f}"
            seen = row.get("seen") is not False
            cells[row["colour"]] = f"{row['value']:.3f}{f' ({truth})' * has_truth}" if seen else "–"
            off += [row["apart"]] * (seen and not math.isnan(row["apart"]))
        line = {"quantity": QUANTITIES[name].words if name in QUANTITIES else name.replace("_", " ")}
        line |= {"unit": first["unit"] or ""}
        line |= {COLOURS.get(colour, f"colour {colour}"): cell for colour, cell in cells.items()}
        line["largest difference"] = f"{max(off):.3f}" if off[1:] else "–"
        stated = "–" if math.isnan(first["error"]) else f"{first['error']:.2g}"
        lines.append(line | {"stated error": "not seen" if first.get("seen") is False else stated})
    return table_of(lines)


def verdict(rows: Sequence[Mapping[str, Any]]) -> str:
    """Whether the numbers are as near to the truth as is stated."""
    judged = [row for row in rows if not math.isnan(row["apart"] + row["error"])]
    if not judged:
        return "None of these has a ground truth and a stated error to compare with."
    outside = [row["name"].replace("_", " ") for row in judged if row["apart"] > row["error"]]
    if not outside:
        return f"All {len(judged)} numbers are within their stated errors."
    return (
        f"{len(judged) - len(outside)} of {len(judged)} numbers are within their stated errors; outside: "
        f"{', '.join(dict.fromkeys(outside))}."
    )


PARTS = (
    Part(100, _render, applies=lambda report: bool(report.once(trainings)), figures=_figures, details=True),
    # Of many displays these tables are too long to be read; training/*.json has their numbers.
    Part(110, _diagnosis, applies=lambda report: not is_many(report.results), details=True),
)
