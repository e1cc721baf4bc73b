"""The process of a method, as the harness has it."""

from __future__ import annotations

import os
import signal
import socket
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
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
from ..executors.processes import CONTEXT, children, cpu_of, descendants, number_within, start
from .handles import answer, known
from .inside import opens, serve
from .messages import Channel, GarbledError

KEPT = 32  # processes of methods that stay when they have nothing to do, beside those of the present study
IMPORT_LIMIT = 600.0  # seconds that the import of a method's file may take
MOST_PROCESSES = 2**22  # of Linux, proc(5), pid_max
ANSWER_LIMIT = 10.0  # seconds in which the process that has imported it answers
ERRORS = {cls.__name__: cls for cls in (UserError, CellError, BudgetError)}
Handle = MeteredDisplay | TrainingBench


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
    """A process that has imported a method, and forks one for every call.

    facts: what the method is. UserError for a method that cannot be imported.
    """

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
        self.facts, self.states, self.at_rest = facts, self._states(facts), self._cpu()

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
    def opened(self, device: torch.device, limits: Limits) -> Iterator[tuple[int, Channel, float]]:
        """The number of a process that is ready for its calls, the way to it (see ``call``), and the seconds for which
        the method has worked before; it ends with the context. It computes on a device, with as many threads as this
        one.

        CellError where it ends by itself, sends what is no answer, or reaches a limit.
        """
        usual, idle, began = usually(device), self._cpu() - self.at_rest, time.perf_counter()
        late = threading.Event()
        channel: Channel | None = None
        failure: Exception | None = None

        def stop() -> None:
            late.set()
            if channel is not None:
                with socket.socket(fileno=os.dup(channel.connection.fileno())) as end:  # others may hold the pipe
                    end.shutdown(socket.SHUT_RDWR)

        timer = threading.Timer(min(limits.seconds, threading.TIMEOUT_MAX), stop)
        timer.daemon = True
        try:
            ours, theirs = CONTEXT.Pipe()
            channel = Channel(ours)
            with theirs:
                reduction.send_handle(self.control.connection, theirs.fileno(), self.process.pid)
            threads = torch.get_num_threads()
            channel.send({"device": str(device), "threads": threads, "memory_gib": limits.memory_gib})
            pid = self._number(self._told())
            timer.start()
            channel.receive()
            yield pid, channel, idle + max(0.0, time.perf_counter() - began - usual)
        except (EOFError, OSError, GarbledError) as error:
            failure = error
        except KeyboardInterrupt:
            self.end()  # what it was about to tell would be taken for the answer to the next question
            raise
        finally:
            timer.cancel()
            if channel is not None:
                channel.connection.close()
            ending = self._ending()
            self.at_rest = self._cpu()
        if failure is None:
            return
        if late.is_set():
            raise CellError(f"took more than {limits.seconds:g} s, the limit of the study")
        what = "sent what is no answer" if isinstance(failure, GarbledError) else ending
        raise CellError(f"the process of the method {what}")

    def _cpu(self) -> float:
        """Processor time [s] of all its processes up to now; between two calls they should take none."""
        outer, taken = int(self.process.pid or 0), 0.0
        for number in (outer, *descendants(outer)):
            with suppress(OSError, ValueError):  # of one that has ended, and of a system without /proc
                taken += cpu_of(number)
        return taken

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
            self.control.send("end")
            status = self._told()
        except (EOFError, OSError, GarbledError):
            self.end()
            return "has ended the process that it came from"
        if -status in signal.valid_signals():
            return f"was ended by {signal.Signals(-status).name}"
        return f"ended with exit code {status}"


@cache
def usually(device: torch.device) -> float:
    """Seconds that a process takes which does nothing but open a device: a method's should be ready by then."""
    began = time.perf_counter()
    start(opens, str(device)).join()
    return time.perf_counter() - began


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
