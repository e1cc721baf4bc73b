"""A small file for each cell, written atomically, so that a run can be killed at any moment and resumed."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, fields
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

from annotated_types import Ge, Interval
from pydantic import FiniteFloat, StringConstraints, TypeAdapter, ValidationError
from typing_extensions import TypedDict  # pydantic takes that of Python from 3.12 on alone

from ..core.errors import UserError
from ..core.hashing import canonical, digest
from ..core.io import TEMPORARY, file_name, locked, read_regular, write_atomically
from . import identity, isolation
from .plan import Cell, Plan

# No file holds the last three: ``missing`` is a planned cell without a record, ``untimed`` one that is done and has to
# be timed alone, ``unscored`` one whose record lacks a metric, or has it of another version.
State = Literal["done", "failed", "skipped", "unavailable", "missing", "untimed", "unscored"]
MEASURED = ("done", "untimed", "unscored")

LATE = 10.0  # s after which all machines should see a file on a shared disk
SCHEMA = 3  # of a record's file
MOST_BYTES = 1_000_000  # of a record's file, which takes a few thousand
AGAIN = "delete the file and run the study again"

Column = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_.]{0,99}$")]
Amount = Annotated[FiniteFloat, Ge(0)]


class Scores(TypedDict):
    """What a metric made of a capture: its version, and its values by column."""

    version: str
    values: dict[Column, FiniteFloat]


@dataclass(frozen=True)
class Record:
    """A capture that was taken, and its scores.

    capture: its description (``identity.capture``), which names the record; state: ``done``, or why there is none in
    ``reason``; label, condition, target: its names in tables; scores: by metric; figures: what else was measured of
    it, by column; captures: camera captures that the method took, those of failed attempts included; frames: of the
    hologram, which share the exposure; shown: frames that the solution's captures showed; seconds: wall time of the
    solution; reused: whether that was solved before, for another display, study or run; alone: whether it
    was timed without concurrent workers (None: unknown); memory_mib: peak of resident memory above the level before the
    solution [MiB]; cpu_s: its time of all processors;
    registration_residual_px: rms error of the registration, in pixels of the scored region; saturated: fraction of
    saturated samples; learned: sha256, captures and seconds of the training that the method needed first; stopped: why
    the display ended the solution, whose best hologram so far was scored (empty: it did not); remark: what is odd
    about the phase (``display.phases``), empty where nothing is or it was not looked at; reads, uncovered: what a
    user's code was seen to read, see ``isolation.Reads``. None: does not apply, as to a floor cell.
    """

    capture: dict[str, Any]
    state: State
    label: str
    condition: str = ""
    target: str = ""
    reason: str = ""
    scores: dict[str, Scores] = field(default_factory=dict)
    figures: dict[Column, FiniteFloat] = field(default_factory=dict)
    captures: Annotated[int, Interval(ge=0, le=10**9)] = 0
    frames: Annotated[int, Interval(ge=1, le=256)] = 1
    shown: Annotated[int, Interval(ge=0)] | None = None
    seconds: Amount | None = None
    reused: bool = False
    alone: bool | None = None
    memory_mib: Amount | None = None
    cpu_s: Amount | None = None
    registration_residual_px: Amount | None = None
    saturated: Annotated[float, Interval(ge=0, le=1)] | None = None
    learned: dict[str, Any] | None = None
    stopped: str = ""
    remark: str = ""
    reads: dict[str, str] = field(default_factory=dict)
    uncovered: tuple[str, ...] = ()

    @cached_property
    def id(self) -> str:
        """The name of the record: the hash of its description."""
        return digest(self.capture)

    def values(self) -> dict[str, float]:
        """Figures and scores by column; a score of another version of its metric is a hole."""
        return self.figures | identity.flat(self.scores)

    def row(self, facts: Mapping[str, Any]) -> dict[str, Any]:
        """The record as reports read it. facts: of its cell, see ``Cell.facts``."""
        fields = {name: getattr(self, name) for name in _FIELDS if name not in ("capture", "figures")}
        return {**fields, "id": self.id, "cell": dict(facts), "scores": self.values()}


_FIELDS = tuple(entry.name for entry in fields(Record))


@dataclass(frozen=True)
class Store:
    """The records of an output folder."""

    output: Path

    @property
    def folder(self) -> Path:
        """Where the records are."""
        return self.output / "records"

    def path(self, identity: str) -> Path:
        """The record's file."""
        return self.folder / f"{identity}.json"

    def log(self, identity: str) -> Path:
        """The file with the traceback of a failed cell."""
        return self.folder / f"{identity}.log"

    def thumbnail(self, identity: str) -> Path:
        """The matched, rectified capture as a small sRGB picture."""
        return self.folder / f"{identity}.png"

    def capture(self, identity: str) -> Path:
        """The registered capture, ``(C, h, w)`` float32, exact, for metrics to come; of a prediction ``(2, C, h, w)``,
        with the picture that it is compared with."""
        return self.folder / f"{identity}.npy"

    def target_thumbnail(self, target: str, shape: Sequence[int] = ()) -> Path:
        """The target as a small sRGB picture. shape: ``(C, h, w)`` as displays show it; none: as it is."""
        return self.folder / f"target-{file_name(' '.join(['x'.join(map(str, shape)), target]).strip())}.png"

    def write(self, record: Record, lasting: bool = True) -> None:
        """Write a record atomically. A failure never replaces a score: that cell was only to be timed again.

        lasting: see `write_atomically`. UserError for what `read` would refuse.
        """
        if record.state == "failed" and (earlier := self.read(record.id)) is not None and earlier.state == "done":
            return
        content = {**{name: getattr(record, name) for name in _FIELDS}, "schema": SCHEMA}
        path = self.path(record.id)
        text = json.dumps({**content, "sha256": digest(content)}, indent=1, sort_keys=True, allow_nan=False)
        _checked(path, record.id, json.loads(text) if len(text) < MOST_BYTES else None)
        write_atomically(path, f"{text}\n".encode(), lasting)

    def read(self, identity: str) -> Record | None:
        """The record of a cell, None if there is none. UserError for a file that is not that record."""
        path = self.path(identity)
        try:
            content = json.loads(read_regular(path, MOST_BYTES))
            canonical(content)
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError, UserError) as error:
            why = str(error).removeprefix(f"{path}: ")
            raise UserError(f"{path}: unreadable record ({why}); {AGAIN}") from error
        return _checked(path, identity, content)

    def remove(self, identities: Iterable[str]) -> None:
        """Remove the records of these cells, where there are any."""
        for name in identities:
            self.path(name).unlink(missing_ok=True)

    def load(self, plan: Plan) -> list[dict[str, Any]]:
        """A record for every cell of the plan, in its order, under the plan's labels.

        A cell without a record has the state ``missing``, so that every gap in a table is visible.
        """
        records = []
        for label, cell in plan.labelled():
            record = self.read(cell.id)
            if record is None:
                record = Record(cell.description(), "missing", label, reason="no record: not run")
            records.append({**record.row(cell.facts()), "label": label})
        return records

    def states(
        self,
        cells: tuple[Cell, ...],
        timed: frozenset[str] = frozenset(),
        metrics: Mapping[str, str] = MappingProxyType({}),
        folder: Path = Path(),
        networks: Mapping[str, str] = MappingProxyType({}),
    ) -> dict[str, State]:
        """State of every cell's record, by the cell's id. Missing is also one whose method read a changed file, or has
        learned something else since.

        timed: cells to be timed alone; metrics: versions by name; folder: of the study; networks: see
        ``Artifacts.networks``.
        """
        recorded = {path.stem for path in self.folder.glob("*.json")}  # faster than trying to open each missing file

        def state(cell: Cell) -> State:
            record = self.read(cell.id) if cell.id in recorded else None
            if record is None or isolation.changed(record.reads, folder):
                return "missing"
            learned = (record.learned or {}).get("sha256")  # of what there is none now, it is taken for the same
            if learned is not None and networks.get(cell.prepared[0], learned) != learned:
                return "missing"
            if record.state != "done":
                return record.state
            if cell.id in timed and not record.alone:
                return "untimed"
            return "unscored" if identity.lacking(record.scores, metrics) else "done"

        return {cell.id: state(cell) for cell in cells}

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs out of the folder."""
        with ExitStack() as held:
            try:
                held.enter_context(locked(self.folder / ".lock", waits=False))
            except BlockingIOError:
                used = "another run is using this folder; wait for it or give --output"
                raise UserError(f"{self.output}: {used}") from None
            for left in self.folder.glob(f"{TEMPORARY}*"):
                left.unlink()
            yield


def late() -> float:
    """When all machines should see what has been written up to now, for ``appears``."""
    return time.monotonic() + LATE


def appears(path: Path, until: float) -> bool:
    """Whether a file is there or appears until a time; another machine may just have written it."""
    while not path.exists():
        if time.monotonic() > until:
            return False
        time.sleep(0.1)
    return True


def _checked(path: Path, identity: str, content: Any) -> Record:
    """The record in a file. UserError for one that was edited or damaged, or is of another cell or a later version."""
    if not isinstance(content, dict):
        raise UserError(f"{path}: not a record; {AGAIN}")
    schema, stated = content.pop("schema", None), content.pop("sha256", None)
    if schema != SCHEMA:
        raise UserError(f"{path}: a record of schema {schema!r}, and this version reads {SCHEMA}; {AGAIN}")
    if stated != digest({**content, "schema": schema}):
        raise UserError(f"{path}: the record is not as it was written, its digest is another; {AGAIN}")
    if unknown := content.keys() - set(_FIELDS):
        raise UserError(f"{path}: a record has no entry {min(unknown)[:100]!r}; {AGAIN}")
    try:
        record = _adapter().validate_json(json.dumps(content), strict=True)
    except ValidationError as error:
        fault = error.errors()[0]
        where = ".".join(map(str, fault["loc"]))[:100]
        raise UserError(f"{path}: {where}: {fault['msg']}; {AGAIN}") from error
    if record.id != identity:
        raise UserError(f"{path}: holds another cell than its name says; {AGAIN}")
    return record


@cache
def _adapter() -> TypeAdapter[Record]:
    return TypeAdapter(Record)
