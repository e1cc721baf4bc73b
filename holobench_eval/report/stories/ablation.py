"""Ablation: which single change of the baseline method matters, and in which direction?"""

from __future__ import annotations

from collections.abc import Iterator

from ..phrases import MARGINS, effect
from ..results import Results
from ..text import grouped, words

ORDER = 80
QUESTION = "Which single change of the method matters?"
LIMITS = ("Training: each row was trained once, and no interval holds what another training would change.",)
FEWEST = 3  # variants of the baseline method that make a study an ablation
NAMED = 2  # changes that the verdict lists with their differences


def applies(results: Results) -> bool:
    """Whether most rows are variants of the baseline."""
    return len(_variants(results)) >= max(FEWEST, len(results.labels) / 2 - 1)


def _variants(results: Results) -> dict[str, set[str]]:
    """The parameters that differ from the baseline's, of the rows that are its own method with other settings; with
    another file it shows another's phases."""
    names, params, baseline = results.names, results.facts.methods["params"], str(results.baseline)
    variants, own = dict[str, set[str]](), params.get(baseline, {})
    for label in results.labels:
        given = params.get(label, {})
        changed = {key for key in given.keys() | own.keys() if given.get(key) != own.get(key)}
        if label != baseline and names.get(label) == names.get(baseline) and "file" not in changed:
            variants[label] = changed
    return variants


def verdicts(results: Results) -> Iterator[str]:
    """Two a display: what lowers and raises the score; what does not, and what another seed of the training moves."""
    score, variants = results.headline, _variants(results)
    for condition in results.conditions:
        tests = [test for label in variants if (test := results.tested(label, condition))]
        reseeded = [test for test in tests if variants[test.second] == {"seed"}]
        changes = sorted((test for test in tests if test not in reseeded), key=lambda test: -abs(test.estimate.mean))
        groups, sentences, left = grouped((effect(score, test), test) for test in changes), list[str](), len(changes)
        for told, word in (("worse", "Worse"), ("better", "Better"), ("not tested", "Untested")):
            same = groups.get(told, [])
            named = [f"{test.second}, {score.with_unit(test.estimate.mean, signed=True)}" for test in same[:NAMED]]
            more = f"; {len(same) - NAMED} more" if len(same) > NAMED else ""
            sentences += [f"{word}: {'; '.join(named)}{more}."] * bool(same)
            left -= len(same)
        least = f"change it by less than {MARGINS[score.unit][0]:g} {score.unit} or " if score.unit in MARGINS else ""
        rest = [f"{left} of {len(changes)} {least}are not shown to change it."] * bool(left)
        moved = [score.with_unit(abs(test.estimate.mean)) for test in reseeded]
        chance = [f"Another seed: {words(moved)}."] * bool(moved)
        for part in (sentences, [*rest, *chance]) if changes else ():
            yield f"{f'{condition}: ' * (len(results.conditions) > 1)}{' '.join(part)}" * bool(part)
