"""How far an answer goes: the sample, the displays, who has the form of the bench, and what was tuned on what."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..data.categories import FLOOR
from ..data.phrases import remarks
from ..data.statistics import FEWEST, SIGNIFICANCE
from ..data.text import FILES, words
from ..markdown import Markdown
from ..section import Report
from .kind import Kind, subjects


def limits(report: Report, kind: Kind) -> Iterator[Markdown]:
    """The items of the list, each with its name in bold."""
    for text in (*_all(report), *kind.limits):
        name, _, rest = text.partition(": ")
        yield Markdown("**{}.** {}").format(name, f"{rest[:1].upper()}{rest[1:]}")


def _all(report: Report) -> Iterator[str]:
    yield f"Sample: {_sample(report)}"
    if report.layout.text.caution:
        yield f"Measured: {report.layout.text.caution}"
    yield from remarks(report.results)
    yield from _displays(report)
    yield from _form(report)
    yield from _tuned(report)
    yield from _without(report)
    if report.layout.note:
        yield f"Note: {report.layout.note}"
    if report.layout.privileged:
        yield (
            f"Oracle: the method {words(sorted(report.layout.privileged))} may differentiate through the simulated "
            "bench, which no real method can; it starts from the best phase of all others, so that no method is above "
            "it, but a better phase than its descent finds may exist. It is not ranked."
        )


def _sample(report: Report) -> str:
    results = report.results
    targets, clusters = len(results.targets), len(set(results.clusters))
    among = (
        f" in {clusters} cluster{'s' * (clusters > 1)} (parts of one picture form a cluster, which counts as one)"
        if clusters < targets
        else ""
    )
    trained = ", nor with another training of a method" if report.trainings else ""
    parts = [
        f"{targets} target{'s' * (targets != 1)}{among}{_dataset(report)}; brackets hold 95 % intervals of how a mean "
        f"varies with other images of the kind, not with other displays{trained}."
    ]
    tests = sum(np.isfinite(test.p) for test in results.against_baseline)
    if tests:
        smallest = 2.0 ** (1 - clusters)
        parts.append(
            f"p comes from sign flips of the {'clusters' if clusters < targets else 'targets'}, adjusted for "
            f"{tests} comparison{'s' * int(tests > 1)} with {results.layout.baseline} (min-p); brackets are not "
            f"adjusted. A difference is shown at p < {SIGNIFICANCE}; not shown does not mean that there is none."
        )
        if smallest >= SIGNIFICANCE:
            parts.append(f"With {clusters} clusters no p can be below {smallest:.2g}: no difference can be shown.")
    elif clusters < FEWEST:
        parts.append(f"Fewer than {FEWEST} clusters give no interval and no test.")
    holes = int((results.holes["category"] != FLOOR).sum())
    if holes:
        parts.append(
            f"{holes} planned cells have no score (details.md says why); a method that lacks one is not ranked."
        )
    return " ".join(parts)


def _dataset(report: Report) -> str:
    """Of which dataset the targets are, where they come from one."""
    names = {record["cell"].get("dataset", "") for record in report.records} - {""}
    return f", of the dataset {words(sorted(names))}" if names else ""


def _displays(report: Report) -> Iterator[str]:
    same: dict[str, list[str]] = {}
    for display in report.description.displays:
        same.setdefault(display.basis or display.heading, []).append(display.name)
    for basis, names in same.items():
        yield f"Display{'s' * (len(names) > 1)} {words(names)}: {basis.rstrip('.')}."
    if report.layout.measure == FILES:
        yield "Display: real, and known from its photographs alone."


def _form(report: Report) -> Iterator[str]:
    """Which methods fit a model that has the bench's own equations for some of its effects."""
    same: dict[tuple[tuple[str, ...], tuple[str, ...]], dict[str, int]] = {}
    for display in report.description.displays:
        here: dict[tuple[str, ...], list[str]] = {}
        for label, effects in display.modelled.items():
            if effects and label in report.results.methods(display.name):
                here.setdefault(effects, []).append(label)
        for effects, labels in here.items():
            same.setdefault((effects, tuple(labels)), {})[display.name] = display.effects
    for (effects, fitted), totals in same.items():
        ends = dict.fromkeys((min(totals.values()), max(totals.values())))
        yield (
            f"Inverse crime on {words(list(totals))}: the model of {words(list(fitted))} has the bench's own form for "
            f"{len(effects)} of its {' to '.join(map(str, ends))} effects "
            f"({', '.join(name.replace('_', ' ') for name in effects)}), so a real display may suit it less."
        )


def _tuned(report: Report) -> Iterator[str]:
    same: dict[str, list[str]] = {}
    for label, text in report.layout.tuned.items():
        same.setdefault(text, []).append(label)
    parts = [f"of {words(labels)}, {text}" for text, labels in same.items()]
    if parts:
        others = "The others have the settings of their papers, of this package or of the config."
        yield f"Tuned: {'; '.join(parts)}. {others}"


def _without(report: Report) -> Iterator[str]:
    """Weights of others that the trained methods of the question take where a machine has them, and that it had not."""
    same: dict[tuple[str, ...], list[str]] = {}
    for training in report.trainings:
        files = (training.fact("description") or {}).get("external") or {}
        absent = tuple(name for name, digest in files.items() if digest == "absent")
        for label in training.labels if absent else ():
            if label in subjects(report.results) and label not in same.setdefault(absent, []):
                same[absent].append(label)
    for absent, labels in same.items():
        yield f"Weights: without {words(list(absent))}, which this machine has not, learned {words(labels)}."
