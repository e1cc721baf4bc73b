"""How far an answer goes: the sample, the displays, who has the form of the bench, and what was tuned on what."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..data.layout import FLOOR
from ..data.phrases import edited, remarks, too_few, uncovered
from ..data.statistics import FEWEST, SIGNIFICANCE
from ..data.text import FILES, grouped, words
from ..markdown import Markdown
from ..section import Report
from ..stories.training import trainings
from ..story import subjects

WEIGHTS = "https://download.pytorch.org/models/alexnet-owt-7be5be79.pth"
MOST_NAMED = 4  # displays of one basis
FIRST = 5  # that stand in report.md; the others are in details.md


def limits(report: Report, kind: Any) -> list[Markdown]:
    """The items of the list, each with its name in bold, what matters most first."""
    texts = [
        *remarks(report.results),
        *_sample(report),
        *_form(report),
        *getattr(kind, "LIMITS", ()),
        *_displays(report),
    ]
    texts += [f"Measured: {report.layout.text.caution}"] * bool(report.layout.text.caution)
    texts += [f"Published: {report.layout.reported_source}."] * bool(report.layout.reported_source)
    texts += [f"Note: {report.layout.note}"] * bool(report.layout.note)
    texts += [text for text in (uncovered(report.records), edited(report.records)) if text]
    texts += [*_weights(report), *_tuned(report), *_seconds(report), *_lpips(report)]
    found = []
    for text in texts:
        name, _, rest = text.partition(": ")
        found.append(Markdown("**{}:** {}").format(name, rest))
    return found


def _sample(report: Report) -> Iterator[str]:
    results = report.results
    targets, clusters = len(results.targets), len(set(results.clusters))
    among = f" in {clusters} cluster{'s' * (clusters > 1)}" if clusters < targets else ""
    trained = ", nor with another training" * bool(report.once(trainings))
    parts = [
        f"{targets} target{'s' * (targets != 1)}{among}; brackets are of how a mean varies with other pictures of the "
        f"kind, not with other displays{trained}."
    ]
    tests = sum(np.isfinite(test.p) for test in results.against_baseline)
    if few := too_few(results):
        parts.append(few)
    elif tests:
        parts.append(
            f"Shown: p < {SIGNIFICANCE} by sign flips, adjusted for {tests} comparison{'s' * int(tests > 1)} with "
            f"{results.layout.baseline}; not shown does not mean that there is none."
        )
    elif clusters < FEWEST:
        parts.append(f"Fewer than {FEWEST} clusters give no interval and no test.")
    holes = int((results.holes["category"] != FLOOR).sum())
    if holes:
        parts.append(f"{holes} planned cells have no score (details.md says why).")
    yield f"Sample: {' '.join(parts)}"


def _displays(report: Report) -> Iterator[str]:
    displays = report.description.displays
    for basis, names in grouped((each.basis or each.heading, each.name) for each in displays).items():
        yield f"{words(names) if len(names) <= MOST_NAMED else f'{len(names)} displays'}: {basis.rstrip('.')}."
    for label, model in report.description.models.items():
        yield f"{label}: descends through {model}."
    if report.layout.measure == FILES:
        yield "Display: real, and known from its photographs alone."


def _form(report: Report) -> Iterator[str]:
    """Which methods fit a model that has the bench's own equations for some of its effects."""
    shares = grouped(
        (label, share)
        for display in report.description.displays
        for label, share in display.modelled.items()
        if share[0] and label in report.results.methods(display.name)
    )
    ends = {label: [f"{own} of {of}" for own, of in (min(each), max(each))] for label, each in shares.items()}
    known = grouped((" to ".join(dict.fromkeys(both)), label) for label, both in ends.items())
    parts = [f"{words(labels)} for {count}" for count, labels in known.items()]
    if parts:
        yield f"Inverse crime: effects modelled by the simulation's own equations: {'; '.join(parts)}; expect less."


def _tuned(report: Report) -> Iterator[str]:
    same = grouped((text, label) for label, text in report.layout.tuned.items())
    parts = [f"of {words(labels)}, {text}" for text, labels in same.items()]
    if parts:
        others = "The others have the settings of their papers, of this package or of the config."
        yield f"Tuned: {'; '.join(parts)}. {others}"


def _weights(report: Report) -> Iterator[str]:
    """Weights of others that the trained methods of the question take where a machine has them, and that it had not."""
    lacking = list[tuple[tuple[str, ...], str]]()
    for training in report.once(trainings):
        files = training.fact("description", dict, {}).get("external") or {}
        absent = tuple(name for name, digest in files.items() if digest == "absent")
        lacking += [(absent, label) for label in training.labels if absent and label in subjects(report.results)]
    for absent, labels in grouped(dict.fromkeys(lacking)).items():
        yield f"Weights: without {words(list(absent))}, which this machine has not, learned {words(labels)}."


def _seconds(report: Report) -> Iterator[str]:
    """Whether solutions were timed beside other work."""
    done, workers = report.results.done, int(report.provenance.get("workers") or 1)
    alone = done["timed_alone"] == 1 if "timed_alone" in done else np.zeros(len(done), dtype=bool)
    if workers > 1 and not alone.any():
        yield f"Seconds: of {workers} workers side by side, so longer than alone."
    elif alone.any():
        beside = sorted({*done["label"][done["category"] != FLOOR]} - {*done["label"][alone]})
        but = f", but for {words(beside)}" * bool(beside)
        yield f"Seconds: of holograms that were solved with nothing beside them{but}."


def _lpips(report: Report) -> Iterator[str]:
    """Why LPIPS is missing where it was wanted, and how to have it."""
    metrics, wanted = {score.metric for score in report.results.scores}, report.layout.metrics
    has = any(name.startswith("lpips") for name in metrics)
    if not has and (wanted is None or any(name.startswith("lpips") for name in wanted)):
        yield (
            f"LPIPS: left out, since no package contains the weights of its trunk. Put {WEIGHTS} into the folder "
            "checkpoints of torch's hub cache and run again."
        )
