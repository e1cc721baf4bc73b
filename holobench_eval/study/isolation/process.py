"""The process of a method, as the harness has it."""

from __future__ import annotations

import os
import signal
import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import reduction, util
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

import torch
from pydantic import TypeAdapter, ValidationError

from ...core.errors import BudgetError, CellError, ForeignError, UserError
from ...core.hashing import State, file_state
from ...core.reads import Seen
from ...core.schema import FieldError
from ...core.sources import Code
from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench
from ...display.traits import Function
from ..definition import Limits
from ..executors.processes import CONTEXT, start
from .handles import answer, known
from .inside import serve
from .messages import Channel, GarbledError, refuse_unsendable

KEPT = 32  # processes of methods that stay when they have nothing to do
IMPORT_LIMIT = 600.0  # seconds that the import of a method's file may take
ANSWER_LIMIT = 10.0  # seconds in which the process that has imported it answers
ERRORS = {cls.__name__: cls for cls in (UserError, CellError, BudgetError)}
Handle = MeteredDisplay | TrainingBench


@dataclass(frozen=True)
class Facts:
    """What a process tells of its method: see ``inside.serve``.

    flags: what its class declares, among anything else; refused: what its file imports that is hidden from methods;
    code: None for a method of this package; seconds: that its import took.
    """

    name: str
    doc: str
    flags: dict[str, Any]
    functions: list[Function]
    refused: str
    code: Code | None
    seconds: float


FACTS: TypeAdapter[Facts | str] = TypeAdapter(Facts | str)  # a text says why the method cannot be imported
SEEN = TypeAdapter(Seen)


@dataclass(frozen=True)
class Call:
    """A process that is ready for its calls. pid: its number; seen: what they have read."""

    pid: int
    channel: Channel
    seen: Seen = field(default_factory=Seen)

    def __call__(self, function: str, params: dict[str, Any], args: Sequence[Any]) -> Any:
        """What a method's function returns; meanwhile the display in ``args`` answers its requests.

        An error that the method raises is a CellError with the name and text of its own, unless it is a BudgetError.
        """
        handle = next((argument for argument in args if isinstance(argument, Handle)), None)
        plain = [argument for argument in args if not isinstance(argument, Handle)]
        given = {} if handle is None else known(handle)
        self.channel.send({"function": function, "params": params, "args": plain, **given})
        while True:
            got = self.channel.receive()
            if not isinstance(got, dict):
                raise GarbledError("no mapping")
            if "ask" not in got:
                break
            self.channel.send(answer(handle, got))
        self.note(got.get("seen"))
        if "result" not in got:
            raise _raised(got)
        if function == "prepare":
            refuse_unsendable(got["result"], "what prepare returned")
        return got["result"]

    def note(self, told: Any) -> None:
        """Add what a call has read. GarbledError for a message that does not say it."""
        try:
            self.seen.add(SEEN.validate_python(told))
        except ValidationError as error:
            raise GarbledError(f"no reads: {error}") from None


class MethodProcess:
    """A process that has imported a method, and forks one for every call.

    facts: what the method is. UserError for a method that cannot be imported.
    """

    def __init__(self, name: str, folder: Path) -> None:
        ours, theirs = CONTEXT.Pipe()
        self.control, self.file = Channel(ours), folder / name.rpartition(":")[0]
        self.process = start(serve, theirs, name, folder, Path.cwd())
        theirs.close()
        ready = wait([ours, self.process.sentinel], IMPORT_LIMIT)  # others of its processes may hold the pipe
        try:
            if not ours.poll():
                raise EOFError
            facts = FACTS.validate_python(self.control.receive())
        except (EOFError, OSError, GarbledError, ValidationError):
            self.end()
            why = f"ends its process ({self.process.exitcode})" if ready else f"takes more than {IMPORT_LIMIT:g} s"
            raise UserError(f"method '{name}': the import of its file {why}") from None
        if isinstance(facts, str):
            raise UserError(facts)
        self.facts, self.states = facts, self._states(facts)

    def is_current(self) -> bool:
        """Whether it lives, and its code, with the Python files beside it, is still what it has imported."""
        return self.process.is_alive() and self.states == self._states(self.facts)

    def _states(self, facts: Facts) -> dict[Path, State | None]:
        if facts.code is None:
            return {}
        beside = Path(facts.code.folder).glob("*.py")  # one more may be what an import finds
        return {path: file_state(path) for path in (*map(Path, facts.code.paths), self.file, *beside)}

    def end(self) -> None:
        """Kill the process."""
        self.process.kill()
        self.process.join()
        self.control.close()

    @contextmanager
    def opened(self, device: torch.device, limits: Limits) -> Iterator[Call]:
        """A process for one call, which ends with the context: on a device, with as many threads as this one.

        CellError where it ends by itself, sends what is no answer, or reaches a limit.
        """
        ours, theirs = CONTEXT.Pipe()
        channel, late = Channel(ours), threading.Event()
        failure: Exception | None = None
        try:
            reduction.send_handle(self.control.connection, theirs.fileno(), self.process.pid)
            pid = self._told()
        except (EOFError, OSError, GarbledError):
            self.end()
            raise CellError("the process that has imported the method does not answer") from None
        finally:
            theirs.close()

        def stop() -> None:
            late.set()
            with socket.socket(fileno=os.dup(ours.fileno())) as end:  # others of its processes may hold the pipe
                end.shutdown(socket.SHUT_RDWR)

        timer = threading.Timer(min(limits.seconds, threading.TIMEOUT_MAX), stop)
        timer.daemon = True
        timer.start()
        setting = {"device": str(device), "threads": torch.get_num_threads(), "memory_gib": limits.memory_gib}
        try:
            channel.send(setting)
            channel.receive()
            yield Call(pid, channel)
        except (EOFError, OSError, GarbledError) as error:
            failure = error
        finally:
            timer.cancel()
            channel.close()
            ending = self._ending(pid)
        if failure is not None and late.is_set():
            raise CellError(f"took more than {limits.seconds:g} s, the limit of the study")
        if failure is not None:
            what = "sent what is no answer" if isinstance(failure, GarbledError) else ending
            raise CellError(f"the process of the method {what}")

    def _told(self) -> int:
        """A number that the process tells. EOFError where it does not in time."""
        if not self.control.connection.poll(ANSWER_LIMIT):
            raise EOFError
        return int(self.control.receive())

    def _ending(self, pid: int) -> str:
        """End a call; in words, how it did by itself."""
        try:
            self.control.send("end")
            status = self._told()
        except (EOFError, OSError, GarbledError):
            with suppress(OSError):
                os.killpg(pid, signal.SIGKILL)
            self.end()
            return "has ended the process that it came from"
        return f"was ended by {signal.Signals(-status).name}" if status < 0 else f"ended with exit code {status}"


def _raised(told: dict[str, Any]) -> Exception:
    name, message = str(told.get("error")), str(told.get("message"))
    if told.get("fault"):
        where, at_key = told["fault"]
        return FieldError(tuple(where), message, bool(at_key))
    kind = ERRORS.get(name) or type(name if name.isidentifier() else "Error", (ForeignError,), {})
    error: Exception = kind(message)
    error.add_note(f"In the method's process:\n{told.get('traceback', '')}")
    return error


_processes: dict[tuple[object, ...], MethodProcess] = {}


def process_of(name: str, folder: Path) -> MethodProcess:
    """The process of a method, the same one while its code and the Python files beside it stay as they are."""
    key = (name, folder, Path.cwd())
    if key in _processes and not _processes[key].is_current():
        former = _processes.pop(key)
        _processes[(*key, id(former))] = former  # a call may still run in it
    _processes[key] = _processes.pop(key) if key in _processes else MethodProcess(name, folder)
    while len(_processes) > KEPT:
        _processes.pop(next(iter(_processes))).end()  # that whose last use is longest ago
    return _processes[key]


def _end_all() -> None:
    for process in _processes.values():
        process.end()


# Before they are asked to end, which a method's file may have forbidden.
util.Finalize(None, _end_all, exitpriority=100)
