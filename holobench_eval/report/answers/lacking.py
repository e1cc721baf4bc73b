"""Which methods are not ranked since they lack targets, and how to rank them all."""

from __future__ import annotations

from ...core.errors import listed
from ...study.folders.files import remedies
from ..data.results import Results
from ..data.text import FILES

NAMED = 10  # methods, or targets of all of them
NAMED_EACH = 3  # targets of a method

Lacks = dict[tuple[str, str], list[str]]  # the targets that a method lacks on a display


def lacking(results: Results) -> str:
    """Who lacks which targets, and what to do about it; empty where every method has a score for every target."""
    pairs = [(label, condition) for condition in results.conditions for label in results.methods(condition)]
    lacks = {pair: missing for pair in pairs if (missing := _missing(results, *pair))}
    if not lacks:
        return ""
    ranked, total = len(pairs) - len(lacks), len(results.targets)
    several = len(results.conditions) > 1
    who = [
        f"{label}{f' on {condition}' * several} lacks {_of(missing, total)}"
        for (label, condition), missing in lacks.items()
    ]
    if ranked:
        have = "1 method that has every target is" if ranked == 1 else f"{ranked} methods that have every target are"
        said = f"Only the {have} ranked"
    else:
        said = "No method is ranked, since none has every target"
    if results.layout.measure != FILES:
        return f"{said}: {_first(who, NAMED)}. {_by_the_others(results, lacks)}"
    holes = results.holes[["state", "label", "target", "reason"]].itertuples(index=False, name=None)
    way = remedies((str(state), str(method), str(target), str(reason)) for state, method, target, reason in holes)
    return f"{said}: {_first(who, NAMED)}. {_with_fewer(results, lacks, way)}"


def _missing(results: Results, label: str, condition: str) -> list[str]:
    values = results.values(label, condition)
    return [name for name, value in zip(results.targets, values, strict=True) if value != value]


def _of(missing: list[str], total: int) -> str:
    if len(missing) == total:
        return f"all {total} targets" if total > 1 else "the target"
    return f"{len(missing)} of {total} targets ({_first(missing, NAMED_EACH)})"


def _to_leave_out(results: Results, lacks: Lacks) -> tuple[list[str], int, str]:
    """The targets without which all that have any score can be ranked, how many are left, and who is ranked then."""
    some = [missing for missing in lacks.values() if len(missing) < len(results.targets)]
    away = [name for name in results.targets if any(name in missing for missing in some)]
    return away, len(results.targets) - len(away), "all" if len(some) == len(lacks) else "all that have any score"


def _by_the_others(results: Results, lacks: Lacks) -> str:
    """How a study ranks them all."""
    way = "Mend what the reasons in details.md say and run the same command again"
    away, left, who = _to_leave_out(results, lacks)
    fewer = f", or name the other {left} targets with --targets to rank {who} by these" if away and left else ""
    return f"{way}{fewer}."


def _with_fewer(results: Results, lacks: Lacks, way: str) -> str:
    """The remedies, and the targets by which all that have any score can be ranked as they are."""
    away, left, who = _to_leave_out(results, lacks)
    if not away or not left:
        return way
    moved = f"move the targets and captures of {_first(away, NAMED)} away"
    return f"{way[:-1]}, or {moved} and rank {who} by the {left} target{'s' * (left > 1)} left."


def _first(names: list[str], most: int) -> str:
    more = len(names) - most
    return f"{listed(names[:most])}{f' and {more} more' if more > 0 else ''}"
