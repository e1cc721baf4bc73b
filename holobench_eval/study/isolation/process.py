"""The process of a method, as the harness has it."""

from __future__ import annotations

import os
import signal
import socket
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import reduction, util
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

import torch
from pydantic import TypeAdapter, ValidationError

from ...core.device import moved
from ...core.errors import BudgetError, CellError, ForeignError, Pending, StopError, UserError
from ...core.hashing import State, file_state
from ...core.reads import Seen
from ...core.schema import FieldError
from ...core.sources import Code
from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench
from ..definition import Limits
from ..executors.processes import CONTEXT, start
from .handles import answer, known
from .inside import serve
from .messages import Channel, GarbledError, refuse_unsendable

KEPT = 32  # processes of methods that stay when they have nothing to do
IMPORT_LIMIT = 600.0  # seconds that the import of a method's file may take
ANSWER_LIMIT = 10.0  # seconds in which the process that has imported it ends a call
SEEN = TypeAdapter(Seen)
Handle = MeteredDisplay | TrainingBench


@dataclass(frozen=True)
class Call:
    """A process that is ready for its calls. pid: its number; seen: what they have read."""

    pid: int
    channel: Channel
    seen: Seen = field(default_factory=Seen)

    def note(self, told: Any) -> None:
        """Add what a call has read. GarbledError for a message that does not say it."""
        try:
            self.seen.add(SEEN.validate_python(told))
        except ValidationError as error:
            raise GarbledError(f"no reads: {error}") from None


class MethodProcess:
    """A process that has imported a method, and forks one for every call.

    facts: what the method is, as ``inside.serve`` tells it; seconds: that its import took. UserError for a method that
    cannot be imported.
    """

    def __init__(self, name: str, folder: Path) -> None:
        ours, theirs = CONTEXT.Pipe()
        self.control, self.name = Channel(ours), name
        self.process = start(serve, theirs, name, folder, Path.cwd())
        theirs.close()
        ready = wait([ours, self.process.sentinel], IMPORT_LIMIT)  # others of its processes may hold the pipe
        try:
            if ours not in ready and not ours.poll():
                raise EOFError
            told = self.control.receive()
        except (EOFError, OSError, GarbledError):
            self.end()
            why = f"ends its process ({self.process.exitcode})" if ready else f"takes more than {IMPORT_LIMIT:g} s"
            raise UserError(f"method '{name}': the import of its file {why}") from None
        if not isinstance(told, dict) or "facts" not in told:
            raise UserError(told["error"] if isinstance(told, dict) else f"method '{name}' does not say what it is")
        self.facts: dict[str, Any] = told["facts"]
        try:
            self.code = TypeAdapter(Code | None).validate_python(self.facts["code"])
        except ValidationError as error:
            self.end()
            raise UserError(f"method '{name}' does not say what its code is: {error}") from None
        self.states = self._states()
        self.seconds: float = told["seconds"]

    def is_current(self) -> bool:
        """Whether it lives, and its code is still what it has imported."""
        return self.process.is_alive() and self.states == self._states()

    def _states(self) -> list[State | None]:
        return [file_state(path) for path in self.code.paths] if self.code else []

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
        channel = Channel(ours)
        reduction.send_handle(self.control.connection, theirs.fileno(), self.process.pid)
        theirs.close()
        if not self.control.connection.poll(ANSWER_LIMIT):
            self.end()
            raise CellError("the process that has imported the method does not answer")
        pid = int(self.control.receive())

        def stop() -> None:
            with suppress(OSError):
                os.kill(pid, signal.SIGKILL)
            with socket.socket(fileno=os.dup(ours.fileno())) as end:  # others of its processes may hold the pipe
                end.shutdown(socket.SHUT_RDWR)

        with _ending_after(limits.seconds, stop) as late:
            try:
                channel.send(
                    {"device": str(device), "threads": torch.get_num_threads(), "memory_gib": limits.memory_gib}
                )
                channel.receive()
                yield Call(pid, channel)
            except (EOFError, OSError, GarbledError) as error:
                status = self._close(channel, pid)
                if late:
                    raise CellError(f"took more than {limits.seconds:g} s, the limit of the study") from None
                what = "sent what is no answer" if isinstance(error, GarbledError) else _ending(status)
                raise CellError(f"the process of the method {what}") from None
            finally:
                if not channel.connection.closed:
                    self._close(channel, pid)

    def _close(self, channel: Channel, pid: int) -> int | None:
        """End a call; its status as ``os.waitpid`` gives it, None where this process is gone, too."""
        channel.close()
        try:
            self.control.send("end")
            if not self.control.connection.poll(ANSWER_LIMIT):
                raise EOFError
            return int(self.control.receive())
        except (EOFError, OSError, GarbledError):
            with suppress(OSError):
                os.killpg(pid, signal.SIGKILL)
            self.end()
            return None


def call(opened: Call, function: str, params: dict[str, Any], args: Sequence[Any]) -> Any:
    """What a method's function returns; meanwhile the display in ``args`` answers its requests.

    An error that the method raises is a CellError with the name and text of its own, unless it is a BudgetError.
    """
    handle = next((argument for argument in args if isinstance(argument, Handle)), None)
    sent = [known(argument) if isinstance(argument, Handle) else argument for argument in args]
    opened.channel.send({"function": function, "params": params, "args": sent})
    while True:
        got = opened.channel.receive()
        if not isinstance(got, dict):
            raise GarbledError("no mapping")
        if "result" in got or "error" in got:
            opened.note(got.get("seen"))
        if "result" in got:
            if function == "prepare":
                refuse_unsendable(got["result"], "what prepare returned")
            return got["result"]
        if "error" in got:
            raise _raised(got)
        opened.channel.send(_answer(handle, got))


def _answer(handle: Handle | None, request: dict[str, Any]) -> dict[str, Any]:
    args, named = request.get("args", ()), request.get("named", {})
    if handle is not None:
        args = moved(list(args), handle.device)
    try:
        return {"value": answer(handle, str(request.get("ask")), args, named)}
    except (Pending, StopError):
        raise
    except Exception as error:  # the method's to see
        return {"error": type(error).__name__, "message": str(error)}


def _raised(told: dict[str, Any]) -> Exception:
    name, message = str(told["error"]), str(told["message"])
    if told.get("fault"):
        where, at_key = told["fault"]
        return FieldError(tuple(where), message, bool(at_key))
    if name == "UserError":
        return UserError(message)
    own = {cls.__name__: cls for cls in (CellError, BudgetError)}
    kind = own.get(name) or type(name if name.isidentifier() else "Error", (ForeignError,), {})
    error = kind(message)
    error.add_note(f"In the method's process:\n{told.get('traceback', '')}")
    return error


def _ending(status: int | None) -> str:
    """What a status of ``os.waitpid`` says, in words."""
    if status is None:
        return "has ended the process that it came from"
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        return f"was ended by {signal.Signals(number).name}"
    return f"ended with exit code {os.WEXITSTATUS(status)}"


@contextmanager
def _ending_after(seconds: float, stop: Callable[[], None]) -> Iterator[list[bool]]:
    """Call ``stop`` after a time; the list is then not empty."""
    late: list[bool] = []

    def end() -> None:
        late.append(True)
        stop()

    timer = threading.Timer(min(seconds, threading.TIMEOUT_MAX), end)
    timer.daemon = True
    timer.start()
    try:
        yield late
    finally:
        timer.cancel()


_processes: OrderedDict[tuple[Any, ...], MethodProcess] = OrderedDict()


def process_of(name: str, folder: Path) -> MethodProcess:
    """The process of a method, the same one while its code and the Python files beside it stay as they are."""
    key = (name, folder, Path.cwd(), _state(name, folder))
    if key in _processes and not _processes[key].is_current():
        former = _processes.pop(key)
        _processes[(*key, id(former))] = former  # a call may still run in it
    if key not in _processes:
        _processes[key] = MethodProcess(name, folder)
    _processes.move_to_end(key)
    while len(_processes) > KEPT:
        _processes.popitem(last=False)[1].end()
    return _processes[key]


def _state(name: str, folder: Path) -> tuple[tuple[str, int, int], ...]:
    """Names, times and sizes of a method's file and those beside it; empty for a method of an installed package."""
    file = name.rpartition(":")[0]
    if not file.endswith(".py"):
        return ()
    beside = next((path.parent for path in (folder / file, Path(file)) if path.is_file()), folder)
    found = []
    for path in sorted(beside.glob("*.py")):
        with suppress(OSError):  # an editor's lock, which points to nothing
            state = path.stat()
            found.append((path.name, state.st_mtime_ns, state.st_size))
    return tuple(found)


def _end_all() -> None:
    for process in _processes.values():
        process.end()


# Before they are asked to end, which a method's file may have forbidden.
util.Finalize(None, _end_all, exitpriority=100)
