"""The process of a method, as the harness has it."""

from __future__ import annotations

import os
import signal
import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import reduction, util
from multiprocessing.connection import wait
from pathlib import Path
from typing import Annotated, Any

import psutil
import torch
from annotated_types import Interval
from pydantic import AfterValidator, StringConstraints, TypeAdapter, ValidationError

from ...core import parameters
from ...core.errors import BudgetError, CellError, ForeignError, UserError
from ...core.hashing import State, file_digest, file_state
from ...core.plugins import is_file
from ...core.reads import Seen
from ...core.schema import FieldError
from ...core.sources import Code
from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench
from ...display.traits import Function
from ..definition import Limits
from ..executors.processes import CONTEXT, children, number_within, start
from .handles import answer, known
from .inside import serve
from .messages import Channel, GarbledError

KEPT = 32  # processes of methods that stay when they have nothing to do, beside those of the present study
IMPORT_LIMIT = 600.0  # seconds that the import of a method's file may take
MOST_PROCESSES = 2**22  # of Linux, proc(5), pid_max
ANSWER_LIMIT = 10.0  # seconds in which the process that has imported it answers
ERRORS = {cls.__name__: cls for cls in (UserError, CellError, BudgetError)}
Handle = MeteredDisplay | TrainingBench
Fork = tuple[dict[str, Any], Channel]  # a process for one call: what it gets ready with, and the way to it


def _shown(text: str) -> str:
    """A text that a terminal and a file can take."""
    if not all(character.isprintable() or character in "\n\t" for character in text):
        raise ValueError("characters that cannot be shown")
    return text


Text = Annotated[str, AfterValidator(_shown), StringConstraints(max_length=20_000)]
Name = Annotated[Text, StringConstraints(min_length=1, max_length=200)]


@dataclass(frozen=True)
class Facts:
    """What a process tells of its method: see ``inside.serve``.

    flags: what its class declares, among anything else; refused: what its file imports that is hidden from methods;
    code: None for a method of this package; seconds: that its import took; enclosed: see ``namespace.enter``.
    """

    name: Name
    doc: Text
    flags: dict[str, Any]
    functions: list[Function]
    refused: Text
    code: Code | None
    seconds: Annotated[float, Interval(ge=0, le=IMPORT_LIMIT)]
    enclosed: bool


FACTS: TypeAdapter[Facts | Text] = TypeAdapter(Facts | Text)  # a text says why the method cannot be imported
SEEN = TypeAdapter(Seen)
RESULTS: dict[str, TypeAdapter[Any]] = {  # of functions that a method has beside those that compute
    "params": TypeAdapter(dict[Text, Any]),
    "words": TypeAdapter(parameters.Words),
    "available": TypeAdapter(Text | None),
    "files": TypeAdapter(list[Text]),
    "external": TypeAdapter(dict[Text, Text | None]),
}


class MethodProcess:
    """A process that has imported a method, and forks one for every call; after a call the next at once, which gets
    ready while the result is scored.

    facts: what the method is. UserError for a method that cannot be imported.
    """

    _next: Fork | None = None
    _ends = False  # whether it is still to tell how the last call ended, before the number of the next

    def __init__(self, name: str, folder: Path, home: Path) -> None:
        ours, theirs = CONTEXT.Pipe()
        self.control, self.key, self.file = Channel(ours), (name, folder, home), folder / name.rpartition(":")[0]
        self.process = start(serve, theirs, name, folder, home)
        # Before it is asked to end, which a method's file may have forbidden.
        self.at_exit = util.Finalize(None, self.end, exitpriority=100)
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
            self.end()
            raise UserError(facts)
        if not self._is_told_truly(facts.code):
            self.end()
            raise UserError(f"method '{name}': its process does not say which files its code is; run the command again")
        self.facts, self.states = facts, self._states(facts)

    def _is_told_truly(self, code: Code | None) -> bool:
        """Whether the code can be that of the file, where one is named: what the file does while it is imported could
        make the process hide an edit."""
        if code is None:
            return not is_file(self.key[0])
        if is_file(self.key[0]) and file_digest(self.file) not in code.files.values():
            return False
        texts = (code.name, code.folder, *code.files, *code.files.values(), *code.bases, *code.uncovered)
        return all(map(str.isprintable, texts)) and Path(code.folder).is_dir()

    def is_current(self) -> bool:
        """Whether it lives, and its code, with the Python files beside it, is still what it has imported."""
        return self.process.is_alive() and self.states == self._states(self.facts)

    def _states(self, facts: Facts) -> dict[Path, State | None]:
        if facts.code is None:
            return {}
        beside = Path(facts.code.folder).glob("*.py")  # one more may be what an import finds
        return {path: file_state(path) for path in (*map(Path, facts.code.paths), self.file, *beside)}

    def end(self) -> None:
        """Kill the process and all that it has started."""
        self.at_exit.cancel()  # it would keep this object, and its files open, until the harness ends
        if self._next is not None:
            self._next[1].connection.close()
        left = list[psutil.Process]()
        with suppress(psutil.Error):
            left = psutil.Process(self.process.pid).children(recursive=True)
        self.process.kill()
        for process in left:
            with suppress(psutil.Error):
                process.kill()
        self.process.join()
        self.control.connection.close()

    @contextmanager
    def opened(self, device: torch.device, limits: Limits) -> Iterator[tuple[int, Channel]]:
        """The number of a process that is ready for its calls, and the way to it (see ``call``); it ends with the
        context. It computes on a device, with as many threads as this one.

        CellError where it ends by itself, sends what is no answer, or reaches a limit.
        """
        setting = {"device": str(device), "threads": torch.get_num_threads(), "memory_gib": limits.memory_gib}
        late = threading.Event()
        channel: Channel | None = None
        failure: Exception | None = None
        is_left = False

        def stop() -> None:
            late.set()
            if channel is not None:
                with socket.socket(fileno=os.dup(channel.connection.fileno())) as end:  # others may hold the pipe
                    end.shutdown(socket.SHUT_RDWR)

        timer = threading.Timer(min(limits.seconds, threading.TIMEOUT_MAX), stop)
        timer.daemon = True
        try:
            pid, channel = self._forked(setting)
            timer.start()
            channel.receive()
            yield pid, channel
            with suppress(OSError):  # one that has ended is not current
                self._end_call()
                is_left = True
                if device.type == "cpu":  # on a GPU it would hold memory while it waits
                    self._next = self._fork(setting)
            return
        except (EOFError, OSError, GarbledError) as error:
            failure = error
        except KeyboardInterrupt:
            self.end()  # what it was about to tell would be taken for the answer to the next question
            raise
        finally:
            timer.cancel()
            if channel is not None:
                channel.connection.close()
            ending = "" if is_left else self._ending()
        if late.is_set():
            raise CellError(f"took more than {limits.seconds:g} s, the limit of the study")
        what = "sent what is no answer" if isinstance(failure, GarbledError) else ending
        raise CellError(f"the process of the method {what}")

    def _forked(self, setting: dict[str, Any]) -> tuple[int, Channel]:
        """The number of a process that gets ready for a call, and the way to it. EOFError, OSError without one."""
        (prepared, channel), self._next = self._next or self._fork(setting), None
        if self._ends:
            self._told()
            self._ends = False
        pid = self._number(self._told())
        if prepared == setting:
            return pid, channel
        channel.connection.close()
        self._end_call()
        return self._forked(setting)

    def _fork(self, setting: dict[str, Any]) -> Fork:
        """Ask for a process that gets ready for a call."""
        ours, theirs = CONTEXT.Pipe()
        with theirs:
            reduction.send_handle(self.control.connection, theirs.fileno(), self.process.pid)
        channel = Channel(ours)
        channel.send(setting)
        return setting, channel

    def _end_call(self) -> None:
        self.control.send("end")
        self._ends = True

    def _number(self, within: int) -> int:
        """The number here of a process that it has forked, which has another one within; 0 for one that has ended."""
        outer = int(self.process.pid or 0)
        numbers = (number for parent in (outer, *children(outer)) for number in children(parent))
        return next((number for number in numbers if number_within(number) == within), 0)

    def _told(self) -> int:
        """A number that the process tells. EOFError where it does not in time, which ends it."""
        if not self.control.connection.poll(ANSWER_LIMIT):
            self.end()
            raise EOFError
        number = self.control.receive()
        if type(number) is not int or abs(number) > MOST_PROCESSES:
            raise GarbledError("no number of a process, nor a status")
        return number

    def _ending(self) -> str:
        """End a call, and say how it ended by itself."""
        try:
            if self._ends:
                raise GarbledError("no end of the call before")
            self._end_call()
            status, self._ends = self._told(), False
        except (EOFError, OSError, GarbledError):
            self.end()
            return "has ended the process that it came from"
        if -status in signal.valid_signals():
            return f"was ended by {signal.Signals(-status).name}"
        return f"ended with exit code {status}"


def call(channel: Channel, seen: Seen, function: str, params: dict[str, Any], args: Sequence[Any]) -> Any:
    """What a method's function returns; meanwhile the display in ``args`` answers its requests, and what is read
    is added to ``seen``.

    An error that the method raises is a CellError with the name and text of its own, unless it is a BudgetError.
    GarbledError for what is no message, or does not say what was read.
    """
    handle = next((argument for argument in args if isinstance(argument, Handle)), None)
    plain = [argument for argument in args if not isinstance(argument, Handle)]
    given = {} if handle is None else known(handle)
    channel.send({"function": function, "params": params, "args": plain, **given})
    while True:
        got = channel.receive()
        if not isinstance(got, dict):
            raise GarbledError("no mapping")
        if "ask" not in got:
            break
        channel.send(answer(handle, got))
    try:
        seen.add(SEEN.validate_python(got.get("seen")))
    except ValidationError as error:
        raise GarbledError(f"no reads: {error}") from None
    if "result" not in got:
        raise _raised(got)
    result = got["result"]
    try:
        return RESULTS[function].validate_python(result) if function in RESULTS else result
    except ValidationError as error:
        first = error.errors()[0]
        where = "".join(f"[{part!r}]" for part in first["loc"])
        raise CellError(f"what {function} returned{where}: {first['msg'].lower()}") from None


def _raised(told: dict[str, Any]) -> Exception:
    name, message = str(told.get("error")), str(told.get("message"))
    if told.get("fault"):
        where, at_key = told["fault"]
        return FieldError(tuple(where), message, bool(at_key))
    kind = ERRORS.get(name) or type(name if name.isidentifier() else "Error", (ForeignError,), {})
    error: Exception = kind(message)
    error.add_note(f"In the method's process:\n{told.get('traceback', '')}")
    return error


_processes: list[MethodProcess] = []  # the last one is that which was used last


def process_of(name: str, folder: Path) -> MethodProcess:
    """The process of a method, the same one while its code and the Python files beside it stay as they are."""
    key = (name, folder, Path.cwd())
    found = next((process for process in _processes if process.key == key), None)
    if found is not None:
        _processes.remove(found)
    ending = [process for process in _processes[:-KEPT] if process.key[1:] != key[1:]]
    if found is not None and not found.is_current():
        ending, found = [*ending, found], None
    for process in ending:
        process.end()
    _processes[:] = [process for process in _processes if process not in ending] + [found or MethodProcess(*key)]
    return _processes[-1]
