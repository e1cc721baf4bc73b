"""How many captures were taken: of a handle, within its budget, and in all, on disk, whatever ended the process."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any, NoReturn

from ..core.errors import BudgetError, StorageError


@dataclass(frozen=True)
class Journal:
    """All captures of a solution or a training, those of attempts that came to nothing included.

    A file with an empty line for each, so its size is their number. A line is written before the camera is asked: a
    process that is killed has counted each capture that it took. What the kernel has outlives the process, so the disk
    is not waited for.
    """

    path: Path

    def add(self) -> int:
        """Count a capture; how many there are now. StorageError: it cannot be counted, so it may not be taken."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("ab", buffering=0) as file:
                file.write(b"\n")
                return file.tell()
        except OSError as error:
            raise StorageError(f"{self.path} cannot be written: {error.strerror}; mend that, and run again") from error

    @property
    def captures(self) -> int:
        """How many were taken."""
        try:
            return self.path.stat().st_size
        except FileNotFoundError:
            return 0

    def close(self) -> None:
        """Forget them: they are in the record of what they were taken for."""
        self.path.unlink(missing_ok=True)


class Account:
    """The captures of a handle. It has no copies, and so no handle that holds it can be copied into a second budget;
    threads take their captures one after the other.

    budget: captures allowed in all, None for no limit; captures: taken of it; total: taken up to now, those of earlier
    attempts included, which no budget counts.
    """

    def __init__(self, label: str, budget: int | None, purpose: str = "", journal: Journal | None = None) -> None:
        self.budget, self.captures, self.total = budget, 0, 0
        self._refusal = f"{label} has used its {budget} captures{purpose}"
        self._journal = journal
        self._lock = Lock()

    def __copy__(self) -> Account:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Account:
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError("a display's account of captures cannot be sent to another process")

    def take(self) -> None:
        """Count a capture. BudgetError when none is left, StorageError where the journal cannot be written."""
        with self._lock:
            if self.budget is not None and self.captures >= self.budget:
                raise BudgetError(self._refusal)
            self.total = self.total + 1 if self._journal is None else self._journal.add()
            self.captures += 1

    def resume(self, captures: int, total: int) -> None:
        """Go on from what an earlier attempt kept; an older count changes nothing."""
        self.captures, self.total = max(self.captures, captures), max(self.total, total)

    def left(self) -> int | None:
        """How many captures may be taken, None for no limit."""
        return None if self.budget is None else max(0, self.budget - self.captures)
