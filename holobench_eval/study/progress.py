"""The progress of a run: a live bar on a terminal, a line every few seconds elsewhere."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TaskID, TextColumn
from rich.progress import Task as RichTask
from rich.text import Text

from .artifacts import read_log
from .plan import Task
from .run import Watch
from .store import Record
from .training import WAITS

SECONDS_BETWEEN_LINES = 5.0
SHARE = "share"  # of all steps of a training, in its log


def _unknown() -> None:
    """The time left before a run has begun."""


def _whole() -> bool:
    """That the time left is no lower limit."""
    return True


def _name(task: Task) -> str:
    return f"{task.label} · {task.cells[0].target}"


def _failure(record: Record) -> str:
    return f"failed: {record.label} · {record.condition} · {record.target}: {record.reason}"


def _untrained(name: str, reason: str) -> str:
    return f"training {name}: {reason}" if reason == WAITS else f"failed: training {name}: {reason}"


def _newest(rows: Sequence[Mapping[str, str]]) -> str:
    """The newest row of a training's log, after the share of its steps that is done and the time left where the log
    has them. The rounds to come take their captures as the past ones did, so that the time is a lower limit."""
    told = ", ".join(f"{key} {value}" for key, value in rows[-1].items() if value and key != SHARE)
    known = [(float(row[SHARE]), float(row["seconds"])) for row in rows if row.get(SHARE) and row.get("seconds")]
    if not known:
        return told
    (first, begun), (share, now) = known[0], known[-1]
    left = (1 - share) * (now - begun) / (share - first) if share > first else math.inf
    time_left = f", at least {duration(left)} left" if 1 <= left < math.inf else ""
    return f"{share:.0%} of the steps{time_left}; {told}"


@dataclass
class Follower:
    """Reports the newest row of each growing ``training.csv`` from a thread.

    Workers of any kind write that file, so it is followed in the same way wherever they run. seconds: between two
    looks; folders: of the artifacts in training, by name; last_lines: the lines reported last, by name.
    """

    seconds: float
    folders: dict[str, Path] = field(default_factory=dict)
    last_lines: dict[str, str] = field(default_factory=dict)
    done: threading.Event = field(default_factory=threading.Event)

    def start(self, names: list[tuple[str, Path]], tell: Callable[[str], object]) -> None:
        """Follow the logs in these folders until each has ``ended``."""
        self.folders = dict(names)
        self.done.clear()
        threading.Thread(target=self._follow, args=(tell,), daemon=True).start()

    def ended(self, name: str) -> None:
        """Stop following this log."""
        self.folders.pop(name, None)
        if not self.folders:
            self.done.set()

    def _follow(self, tell: Callable[[str], object]) -> None:
        while not self.done.wait(self.seconds):
            for name, folder in list(self.folders.items()):
                rows = read_log(folder)
                line = f"{name}: {_newest(rows)}" if rows else ""
                if line and self.last_lines.get(name) != line:
                    self.last_lines[name] = line
                    tell(line)


@dataclass
class Bar:
    """A bar with the task in work, the cells and trainings done, the time left and the number of failures."""

    progress: Progress
    bar: TaskID
    failures: int = 0
    missing: int = 0
    follower: Follower = field(default_factory=lambda: Follower(0.5))

    def expects(self, seconds_left: Callable[[], float | None], is_whole: Callable[[], bool] = _whole) -> None:
        """Show the time left, where it is known."""
        self.progress.update(self.bar, left=seconds_left, whole=is_whole)

    def planned(self, cells: int, missing: int, floors: int) -> None:
        """Set the bar to the number of missing cells."""
        self.missing = missing
        self.progress.reset(self.bar, total=missing, description=f"{cells - missing} of {cells} cells done before")

    def training(self, names: list[tuple[str, Path]], notes: Sequence[str] = ()) -> None:
        """Show the number of trainings, and follow their logs."""
        for note in notes:
            self.progress.console.print(escape(note), highlight=False, soft_wrap=True)
        self.progress.update(self.bar, total=self.missing + len(names), description="training")
        self.follower.start(names, lambda line: self.progress.update(self.bar, description=escape(line)))

    def trained(self, name: str, failure: str) -> None:
        """Advance, and print a failure above the bar."""
        if failure:
            style = None if failure == WAITS else "red"
            self.progress.console.print(escape(_untrained(name, failure)), style=style, highlight=False, soft_wrap=True)
        self.progress.update(self.bar, advance=1)
        self.follower.ended(name)

    def started(self, task: Task) -> None:
        """Name the task in work."""
        self.progress.update(self.bar, description=escape(_name(task)))

    def finished(self, records: list[Record]) -> None:
        """Advance, and print what failed above the bar."""
        for record in records:
            if record.state == "failed":
                self.failures += 1
                self.progress.console.print(escape(_failure(record)), style="red", highlight=False, soft_wrap=True)
        self.progress.update(self.bar, advance=len(records), failures=f"{self.failures} failed" * bool(self.failures))


@dataclass
class Lines:
    """Plain lines: at most one every few seconds, and one for every failure."""

    write: Callable[[str], None]
    clock: Callable[[], float] = time.monotonic
    total: int = 0
    done: int = 0
    failures: int = 0
    follower: Follower = field(default_factory=lambda: Follower(15.0))
    seconds_left: Callable[[], float | None] = field(default_factory=lambda: _unknown, init=False)
    is_whole: Callable[[], bool] = field(default_factory=lambda: _whole, init=False)
    last: float = field(init=False)

    def __post_init__(self) -> None:
        self.last = self.clock()

    def expects(self, seconds_left: Callable[[], float | None], is_whole: Callable[[], bool] = _whole) -> None:
        """Write the time left in every line."""
        self.seconds_left, self.is_whole = seconds_left, is_whole

    def planned(self, cells: int, missing: int, floors: int) -> None:
        """Write the number of cells to compute, and how many of the study's are of no method."""
        self.total = missing
        aside = f" ({floors} of the {cells} are floor images, which no method made)" if floors else ""
        self.write(f"{missing} of {cells} cells to compute{aside}")

    def training(self, names: list[tuple[str, Path]], notes: Sequence[str] = ()) -> None:
        """Name the trainings, and follow their logs."""
        for note in notes:
            self.write(note)
        self.write(f"{len(names)} to train: {', '.join(name for name, _ in names)}")
        self.follower.start(names, self.write)

    def trained(self, name: str, failure: str) -> None:
        """A line for every training that ended."""
        self.write(_untrained(name, failure) if failure else f"trained: {name}")
        self.follower.ended(name)

    def started(self, task: Task) -> None:
        """Name the task in work, if the last line is old enough."""
        now = self.clock()
        if now - self.last >= SECONDS_BETWEEN_LINES:
            self.last = now
            self.write(f"{self.done}/{self.total} cells, {self.failures} failed{self._left()}; now {_name(task)}")

    def finished(self, records: list[Record]) -> None:
        """Count, and write a line for every failure."""
        self.done += len(records)
        for record in records:
            if record.state == "failed":
                self.failures += 1
                self.write(_failure(record))

    def _left(self) -> str:
        seconds, training = self.seconds_left(), len(self.follower.folders)
        beside = f" besides the {training} in training" * bool(training)
        return f", {words} left{beside}" if (words := _expected(seconds, self.is_whole())) else ""


def duration(seconds: float) -> str:
    """A time as people say it, to two digits at least: ``45 s``, ``22 min``, ``3.5 h``."""
    if seconds < 99.5:
        return f"{seconds:.0f} s" if seconds >= 9.5 else f"{seconds:.2g} s"
    return f"{seconds / 60:.0f} min" if seconds < 99.5 * 60 else f"{seconds / 3600:.1f} h"


def _expected(seconds: float | None, is_whole: bool) -> str:
    """The time left in words; empty where nothing is known of it, also where less than a second is a lower limit."""
    if seconds is None or (seconds < 1 and not is_whole):
        return ""
    return f"{'about' if is_whole else 'at least'} {duration(round(seconds))}"


class _TimeLeft(ProgressColumn):
    """The time left, by what the rows have cost so far."""

    def render(self, task: RichTask) -> Text:
        return Text(_expected(task.fields["left"](), task.fields["whole"]()), style="progress.remaining")


@contextmanager
def watching(console: Console) -> Iterator[Watch]:
    """The watch that suits a console."""
    if not console.is_terminal:
        yield Lines(lambda line: console.print(line, markup=False, highlight=False, soft_wrap=True))
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        _TimeLeft(),
        TextColumn("[red]{task.fields[failures]}"),
    )
    with Progress(*columns, console=console) as progress:
        yield Bar(progress, progress.add_task("planning", total=None, failures="", left=_unknown, whole=_whole))
