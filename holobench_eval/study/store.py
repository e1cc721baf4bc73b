"""A small file for each cell, written atomically, so that a run can be killed at any moment and resumed."""

from __future__ import annotations

import fcntl
import json
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Ge, Interval
from pydantic import FiniteFloat, StringConstraints, TypeAdapter, ValidationError

from ..core.errors import UserError
from ..core.hashing import digest
from ..core.io import TEMPORARY, file_name, write_atomically
from .plan import Cell, Plan

# ``missing``: a planned cell without a record; ``Store.load`` gives this state, and no file holds it.
State = Literal["done", "failed", "skipped", "unavailable", "missing"]

LATE = 10.0  # s after which all machines should see a file on a shared disk
# Of a record's file. 1: without `schema` and `sha256`, the digest of all other entries.
SCHEMA = 2
MOST_BYTES = 1_000_000  # of a record's file, which takes a few thousand
AGAIN = "delete the file and run the study again"

Column = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_.]{0,99}$")]
Amount = Annotated[FiniteFloat, Ge(0)]


@dataclass(frozen=True)
class Record:
    """The measurement of a cell.

    cell: its description; state: ``done``, or why there is no score in ``reason``; scores: flat metric names
    to numbers; captures: camera captures the method used; seconds: wall time of the solution; alone: whether it
    was timed without concurrent workers (None: unknown); memory_mib: peak of resident memory above the level before the
    solution [MiB]; label: the method's name in tables;
    registration_residual_px: rms error of the registration, in pixels of the scored region; saturated: fraction of
    saturated samples; learned: sha256, captures and seconds of the training that the method needed first; stopped: why
    the display ended the solution, whose best hologram so far was scored (empty: it did not). None: does not apply, as
    to a floor cell.
    """

    cell: dict[str, Any]
    state: State
    label: str
    reason: str = ""
    scores: dict[Column, FiniteFloat] = field(default_factory=dict)
    captures: Annotated[int, Interval(ge=0, le=10**9)] = 0
    seconds: Amount | None = None
    alone: bool | None = None
    memory_mib: Amount | None = None
    registration_residual_px: Amount | None = None
    saturated: Annotated[float, Interval(ge=0, le=1)] | None = None
    learned: dict[str, Any] | None = None
    stopped: str = ""

    @property
    def id(self) -> str:
        """The name of the record: the hash of its cell."""
        return digest(self.cell)


_FIELDS = frozenset(entry.name for entry in fields(Record))


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

    def target_thumbnail(self, target: str) -> Path:
        """The target as a small sRGB picture."""
        return self.folder / f"target-{file_name(target)}.png"

    def write(self, record: Record) -> None:
        """Write a record atomically. A failure never replaces a score: that cell was only to be timed again.

        UserError for what `read` would refuse.
        """
        if record.state == "failed" and (earlier := self.read(record.id)) is not None and earlier.state == "done":
            return
        content = {**vars(record), "schema": SCHEMA}
        path = self.path(record.id)
        text = json.dumps({**content, "sha256": digest(content)}, indent=1, sort_keys=True, allow_nan=False)
        _checked(path, record.id, json.loads(text) if len(text) < MOST_BYTES else None)
        write_atomically(path, f"{text}\n".encode())

    def read(self, identity: str) -> Record | None:
        """The record of a cell, None if there is none. UserError for a file that is not that record."""
        path = self.path(identity)
        try:
            with path.open("rb") as file:
                text = file.read(MOST_BYTES + 1)
            content = json.loads(text) if len(text) <= MOST_BYTES else None
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError) as error:
            raise UserError(f"{path}: unreadable record ({error}); {AGAIN}") from error
        return _checked(path, identity, content)

    def remove(self, identities: Iterable[str]) -> None:
        """Remove the records of these cells, where there are any."""
        for identity in identities:
            self.path(identity).unlink(missing_ok=True)

    def load(self, plan: Plan) -> list[dict[str, Any]]:
        """A record for every cell of the plan, in its order, under the plan's labels.

        A cell without a record has the state ``missing``, so that every gap in a table is visible.
        """
        records = []
        for label, cell in plan.labelled():
            record = self.read(cell.id)
            if record is None:
                record = Record(cell.description(), "missing", label, "no record: not run")
            records.append({**vars(record), "label": label})
        return records

    def missing(
        self, cells: tuple[Cell, ...], retry_failed: bool = False, timed: frozenset[str] = frozenset()
    ) -> list[Cell]:
        """The cells that a run has to compute: those without a record, failed ones if they are to be retried, and of
        ``timed`` those whose solution was not timed alone."""
        states = self.states(cells, timed)
        return [
            cell for cell in cells if states[cell.id] == "missing" or (retry_failed and states[cell.id] == "failed")
        ]

    def states(self, cells: tuple[Cell, ...], timed: frozenset[str] = frozenset()) -> dict[str, State]:
        """State of every cell's record, by the cell's id; those of ``timed`` that were not timed alone are missing."""
        recorded = {path.stem for path in self.folder.glob("*.json")}  # faster than trying to open each missing file

        def state(cell: Cell) -> State:
            record = self.read(cell.id) if cell.id in recorded else None
            untimed = cell.id in timed and record is not None and record.state == "done" and not record.alone
            return "missing" if record is None or untimed else record.state

        return {cell.id: state(cell) for cell in cells}

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs out of the folder. The lock dies with its process, so it never outlives a kill."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / ".lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise UserError(
                    f"{self.output}: another run is using this folder; wait for it or give --output"
                ) from None
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
    schema, stated = content.get("schema", 1), content.pop("sha256", None)
    if type(schema) is not int or schema not in (1, SCHEMA):
        raise UserError(f"{path}: a record of schema {schema!r}, and this version reads up to {SCHEMA}; {AGAIN}")
    if schema == SCHEMA and stated != digest(content):
        raise UserError(f"{path}: the record is not as it was written, its digest is another; {AGAIN}")
    content.pop("schema", None)
    if unknown := content.keys() - _FIELDS:
        raise UserError(f"{path}: a record has no entry {min(unknown)[:100]!r}; {AGAIN}")
    try:
        record = _adapter().validate_json(json.dumps(content), strict=True)
    except ValidationError as error:
        fault = error.errors()[0]
        where = ".".join(map(str, fault["loc"]))[:100]
        raise UserError(f"{path}: {where}: {fault['msg']}; {AGAIN}") from error
    if digest(record.cell) != identity:
        raise UserError(f"{path}: holds another cell than its name says; {AGAIN}")
    return record


@cache
def _adapter() -> TypeAdapter[Record]:
    return TypeAdapter(Record)
