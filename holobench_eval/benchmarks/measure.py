"""Times of all benchmarks. Versions of the same work take turns, so that a machine's changes of speed meet all of them.

A version that others are compared with, and each of those, has a process of its own, twice: with a steady heap and with
a fresh one. The others share a process with a steady heap. Neither lets two libraries' threads meet.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from random import Random
from statistics import median, quantiles
from tempfile import TemporaryDirectory

from ..core.seeds import seed
from .report import Timing
from .suite import FRESH, STEADY, Answer, Case, MissingError, Worker, cases, in_turns

FRESH_SECONDS, STEADY_SECONDS, SHARED_SECONDS = 1.0, 2.0, 0.8  # of a version's turns
FEWEST, MOST = 3, 15  # turns
TURN_SECONDS, LONG = 0.05, 0.4  # the least length of a turn; a call that is not repeated within one


@dataclass
class Measured:
    """Timings; modules that are not installed, with the cases they are needed for; reasons why others have no time."""

    timings: list[Timing] = field(default_factory=list)
    missing: dict[str, list[str]] = field(default_factory=dict)
    faults: dict[str, str] = field(default_factory=dict)

    def note(self, case: Case, error: LookupError) -> None:
        """Remember why a case has no timing."""
        if isinstance(error, MissingError):
            names = self.missing.setdefault(error.args[1], [])
            names += [case.version] if case.version not in names else []
        else:
            self.faults[case.name] = str(error)


def measure(only: str, advance: Callable[[str, float, float], None]) -> Measured:
    """Time all benchmarks whose names hold a text.

    Parameters
    ----------
    only
        The text. UserError: no name holds it.
    advance
        Called with what is timed next, the seconds of turns that are done and those of all.
    """
    groups: dict[str, list[Case]] = {}
    for case in cases(only):
        groups.setdefault(case.group, []).append(case)
    lengths = {group: sum(map(_seconds, rows)) for group, rows in groups.items()}
    measured, draw, done = Measured(), Random(seed("order of turns")), 0.0
    with TemporaryDirectory() as folder:
        for apart in (True, False):  # the processes of those apart end before the others are timed
            with ExitStack() as stack:
                start = cache(partial(_start, stack, Path(folder)))
                for group, rows in groups.items():
                    if rows[0].apart is apart:
                        advance(group, done, sum(lengths.values()))
                        measured.timings += _timings(rows, start, draw, measured)
                        done += lengths[group]
    return measured


def _start(stack: ExitStack, cache: Path, heap: str, version: str = "") -> Worker:
    """A process with a heap, ``steady`` or ``fresh``, for a version or for all; it ends with the stack."""
    options, settings = {"steady": (("--steady", "0"), STEADY), "fresh": (("--fresh",), FRESH)}[heap]
    return stack.enter_context(Worker(*options, cache=cache, heap=settings))


def _timings(rows: Sequence[Case], start: Callable[..., Worker], draw: Random, measured: Measured) -> list[Timing]:
    """Of the versions of a group that can be timed."""
    fresh: dict[Case, Answer] = {}
    try:
        if rows[0].apart:
            workers = {case: start("steady", case.version) for case in rows}
            start("fresh", "reference").ask(rows[0].name, "reference")  # where no version's memory is measured
            fresh = _alone({case: start("fresh", case.version) for case in rows}, draw, measured, FRESH_SECONDS)
            steady = _alone(workers, draw, measured, STEADY_SECONDS)
        else:
            workers = dict.fromkeys(rows, start("steady"))
            steady = _take_turns(workers, draw, measured, SHARED_SECONDS)
        steady = {case: row | workers[case].ask(case.name, "facts")["facts"] for case, row in steady.items()}
    except LookupError as error:  # what could be done once, and then could not
        measured.faults[rows[0].group] = str(error)
        return []
    return [_timing(case, steady[case], fresh.get(case)) for case in rows if case in steady]


def _seconds(case: Case) -> float:
    return FRESH_SECONDS + STEADY_SECONDS if case.apart else SHARED_SECONDS


def _alone(workers: Mapping[Case, Worker], draw: Random, measured: Measured, seconds: float) -> dict[Case, Answer]:
    """Each version in a process of its own: its turns, and what it holds."""
    held = {}
    for case, worker in workers.items():  # all are prepared at the same time
        worker.send(case.name, "memory")
    for case, worker in workers.items():
        try:
            held[case] = worker.receive()
        except LookupError as error:
            measured.note(case, error)
    answers = _take_turns({case: workers[case] for case in held}, draw, measured, seconds)
    return {case: answer | held[case] for case, answer in answers.items()}


def _take_turns(workers: Mapping[Case, Worker], draw: Random, measured: Measured, seconds: float) -> dict[Case, Answer]:
    """Seconds and page faults of every turn, as lists."""
    versions = {}
    for case, worker in workers.items():
        try:
            once = worker.ask(case.name, 1)["seconds"]
        except LookupError as error:
            measured.note(case, error)
        else:
            calls = 1 if once > LONG else max(2, math.ceil(TURN_SECONDS / once))
            versions[case] = partial(worker.ask, case.name, calls)
    turns = in_turns(versions, draw, seconds * len(versions), FEWEST, MOST)
    return {case: {key: [turn[case][key] for turn in turns] for key in ("seconds", "faults")} for case in versions}


def _timing(case: Case, steady: Answer, fresh: Answer | None) -> Timing:
    lower, _, upper = quantiles(steady["seconds"], n=4, method="inclusive")
    rows, columns = steady.get("padded") or (None, None)
    return Timing(
        case.group,
        case.version,
        median(steady["seconds"]),
        lower,
        upper,
        len(steady["seconds"]),
        rows,
        columns,
        steady.get("error"),
        steady.get("bytes"),
        round(median(steady["faults"])),
        *((median(fresh["seconds"]), fresh.get("bytes"), round(median(fresh["faults"]))) if fresh else ()),
    )
