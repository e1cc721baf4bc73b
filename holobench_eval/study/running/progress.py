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
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn

from ..artifacts import read_log
from ..plan import Task
from ..store import Record
from ..training import WAITS

SECONDS_BETWEEN_LINES = 5.0
SHARE = "share"  # of all steps of a training, in its log


def _name(task: Task) -> str:
    return f"{task.label} · {task.cells[0].target}"


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


def seldom(clock: Callable[[], float] = time.monotonic) -> Callable[[], bool]:
    """What says whether the next line may be written: one every few seconds."""
    last = clock()

    def is_due() -> bool:
        nonlocal last
        if is_late := clock() - last >= SECONDS_BETWEEN_LINES:
            last = clock()
        return is_late

    return is_due


@dataclass
class Lines:
    """Sees a run's progress, and writes plain lines: at most one every few seconds, and one for every failure.

    write: takes a line; clock: seconds. A lower limit of the time left has ``is_whole`` False.
    """

    write: Callable[[str], object]
    clock: Callable[[], float] = time.monotonic
    total: int = 0
    done: int = 0
    failures: int = 0
    follower: Follower = field(default_factory=lambda: Follower(15.0))

    def __post_init__(self) -> None:
        self.is_due = seldom(self.clock)
        self.expects(lambda: None)

    def planned(self, cells: int, missing: int, floors: int) -> None:
        """The run begins: cells of the study, those that have to be computed, and those of floor images."""
        self.total = missing
        aside = f" ({floors} of the {cells} are floor images, which no method made)" if floors else ""
        self.write(f"{missing} of {cells} cells to compute{aside}")

    def expects(self, seconds_left: Callable[[], float | None], is_whole: Callable[[], bool] = lambda: True) -> None:
        """What gives the time [s] that the cells still take, at any moment; None where it is not known. is_whole:
        whether it is that of all cells, and not a lower limit."""
        self.seconds_left, self.is_whole = seconds_left, is_whole

    def training(self, names: list[tuple[str, Path]], notes: Sequence[str] = ()) -> None:
        """Training begins: label and artifact folder, where ``training.csv`` grows, of everything to be trained; and
        sentences on what is trained in the place of another artifact."""
        for note in notes:
            self.write(note)
        self.announce(f"{len(names)} to train: {', '.join(name for name, _ in names)}")
        self.follower.start(names, self.announce)

    def trained(self, name: str, failure: str) -> None:
        """A training ended; failure: why it failed, empty if it did not."""
        if failure:
            self.say(f"{'failed: ' * (failure != WAITS)}training {name}: {failure}", failure != WAITS)
        else:
            self.announce(f"trained: {name}")
        self.follower.ended(name)

    def started(self, task: Task) -> None:
        """A task is taken up."""
        if self.is_due():
            training = len(self.follower.folders)
            left = f", {self.time_left} left" if self.time_left else ""
            left += f" besides the {training} in training" * bool(left and training)
            self.write(f"{self.done}/{self.total} cells, {self.failures} failed{left}; now {_name(task)}")

    def finished(self, records: list[Record]) -> None:
        """A task's cells have their records."""
        self.done += len(records)
        for record in records:
            if record.state == "failed":
                self.failures += 1
                self.say(f"failed: {record.label} · {record.condition} · {record.target}: {record.reason}", True)

    @property
    def time_left(self) -> str:
        """The time left in words; empty where nothing is known, also where less than a second is a lower limit."""
        seconds, is_whole = self.seconds_left(), self.is_whole()
        if seconds is None or (seconds < 1 and not is_whole):
            return ""
        return f"{'about' if is_whole else 'at least'} {duration(round(seconds))}"

    def say(self, line: str, is_failure: bool) -> None:
        """Write a line that people should see."""
        self.write(line)

    def announce(self, line: str) -> None:
        """Write what goes on now."""
        self.write(line)


@dataclass
class Bar(Lines):
    """A bar with the task in work, the cells and trainings done, the time left and the number of failures."""

    progress: Progress = field(kw_only=True)
    bar: TaskID = field(default=TaskID(0), kw_only=True)

    @property
    def failed(self) -> str:
        """The number of failures in words; empty for none."""
        return f"{self.failures} failed" * bool(self.failures)

    def planned(self, cells: int, missing: int, floors: int) -> None:
        """Set the bar to the number of missing cells."""
        self.total, self.follower.seconds = missing, 0.5
        self.bar = self.progress.add_task(f"{cells - missing} of {cells} cells done before", total=missing, watch=self)

    def training(self, names: list[tuple[str, Path]], notes: Sequence[str] = ()) -> None:
        """Add the trainings to the bar."""
        self.progress.update(self.bar, total=self.total + len(names))
        super().training(names, notes)

    def trained(self, name: str, failure: str) -> None:
        """Advance."""
        super().trained(name, failure)
        self.progress.update(self.bar, advance=1)

    def started(self, task: Task) -> None:
        """Name the task in work."""
        self.announce(_name(task))

    def finished(self, records: list[Record]) -> None:
        """Advance, and print what failed above the bar."""
        super().finished(records)
        self.progress.update(self.bar, advance=len(records))

    def say(self, line: str, is_failure: bool) -> None:
        """Print above the bar."""
        style = "red" if is_failure else None
        self.progress.console.print(escape(line), style=style, highlight=False, soft_wrap=True)

    def announce(self, line: str) -> None:
        """Show beside the bar."""
        self.progress.update(self.bar, description=escape(line))


def duration(seconds: float) -> str:
    """A time as people say it, to two digits at least: ``45 s``, ``22 min``, ``3.5 h``."""
    if seconds < 99.5:
        return f"{seconds:.0f} s" if seconds >= 9.5 else f"{seconds:.2g} s"
    return f"{seconds / 60:.0f} min" if seconds < 99.5 * 60 else f"{seconds / 3600:.1f} h"


@contextmanager
def watching(console: Console) -> Iterator[Lines]:
    """The watch that suits a console."""

    def write(line: str) -> None:
        console.print(line, markup=False, highlight=False, soft_wrap=True)

    if not console.is_terminal:
        yield Lines(write)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[watch].time_left}", style="progress.remaining"),
        TextColumn("{task.fields[watch].failed}", style="red"),
    )
    with Progress(*columns, console=console) as progress:
        yield Bar(write, progress=progress)
