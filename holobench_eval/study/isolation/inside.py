"""What runs in the process of a method: it imports the method's code once, and forks for every call.

So no call begins with what an earlier one left in memory, and one that ends its process ends nothing else.
"""

from __future__ import annotations

import inspect
import os
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from importlib.machinery import ModuleSpec
from multiprocessing import reduction, set_start_method
from multiprocessing.connection import Connection, wait
from multiprocessing.process import current_process
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import psutil
import torch

from ... import display
from ...core import plugins, sources
from ...core.device import find, moved, repeatable
from ...core.errors import CellError, UserError
from ...core.parameters import words
from ...core.reads import PACKAGE, recorded
from ...core.schema import FieldError
from ...display.phases import from_numpy
from ...display.traits import FLAGS, traits_of
from . import namespace
from .handles import SolvingHandle, TrainingHandle
from .messages import Channel

# The bench and the harness.
HIDDEN = tuple(f"{PACKAGE}.{part}" for part in ("display.simulated", "study", "lab", "report", "commands", "testing"))
HANDLES = {"MeteredDisplay": SolvingHandle, "TrainingBench": TrainingHandle}


def serve(control: Connection, name: str, folder: Path, home: Path) -> None:
    """Import a method, tell what it is, and fork for every connection that ``control`` brings, until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.chdir(home)
    torch.set_num_threads(1)
    cv2.setNumThreads(1)  # it looks for libraries when it is first called, which is here once for all calls
    current_process()._config["daemon"] = False  # type: ignore[attr-defined]  # else a method could start no process
    set_start_method("fork", force=True)  # its file is no module that another process could import
    channel, enclosed = Channel(control), namespace.enter()
    namespace.adopt()
    began = time.perf_counter()
    try:
        cls, refused = _imported(name, folder)
        _flush()
        signal.signal(signal.SIGTERM, signal.SIG_DFL)  # the file may have set another one
        code = None if sources.ships(cls) else sources.code_of(cls)
        facts = {
            "name": cls.__qualname__,
            "doc": inspect.getdoc(cls) or "",
            "flags": {flag: getattr(cls, flag) for flag in FLAGS if hasattr(cls, flag)},
            "functions": list(traits_of(cls, name).functions),
            "refused": refused,
            "code": code and asdict(code),
            "seconds": time.perf_counter() - began,
            "enclosed": enclosed,
        }
        channel.send(facts)
    except (UserError, CellError) as error:
        channel.send(str(error))
        with suppress(EOFError, OSError):
            channel.receive()  # until the harness ends it, with what it has started
        os._exit(1)
    with suppress(EOFError, OSError):
        while True:
            number = reduction.recv_handle(control)
            child = os.fork()
            if child == 0:
                namespace.end_with_parent()
                control.close()
                os.setsid()
                with suppress(EOFError, ConnectionError):  # the harness has ended
                    _call(Channel(Connection(number)), cls, f"method '{name}'", code.folder if code else "")
                os._exit(0)
            os.close(number)
            channel.send(child)
            # The call is over, or the harness is, or the process has ended by itself; then what it started must end,
            # too, since that may hold the pipe on which the harness waits.
            watched = os.pidfd_open(child)
            wait([control, watched])
            os.close(watched)
            status = _ended(child, enclosed)
            with suppress(EOFError, OSError):
                channel.receive()
            channel.send(status)
    os._exit(0)  # whatever threads the file has left


def opens(device: str) -> None:
    """Open a device, as every call begins with it."""
    torch.zeros(1, device=find(device))


def _imported(name: str, folder: Path) -> tuple[type[Any], str]:
    """A method's class, and what it imports that is hidden from methods, empty for nothing. UserError as
    ``plugins.find``, and for a file that starts threads, since a process with threads cannot be forked."""
    threads, refusal, refused = _threads(), _hide(), ""
    try:
        cls = plugins.find("methods", name, folder)
    except UserError:
        if not refusal.refused:
            raise
        refused = refusal.refused
        sys.meta_path.remove(refusal)  # to see what it declares; it cannot run here
        cls = plugins.find("methods", name, folder)
    started = "threads" if _threads() > threads else "processes" if _has_started() else ""
    if started:
        raise UserError(f"method '{name}' starts {started} while its file is imported; start them in solve or prepare")
    if plugins.is_file(name):
        sys.path.append(sources.code_of(cls).folder)  # for processes that it starts
    return cls, refused


def _threads() -> int:
    return len(list(Path("/proc/self/task").iterdir()))


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()


def _ended(child: int, enclosed: bool) -> int:
    """End a process and all that it has started, in whichever group; its exit code, or less than 0 the signal.

    enclosed: whether this process is the first of a namespace, in which no other is left then.
    """
    statuses = dict[int, int]()
    while True:
        numbers = [-1] if enclosed else [process.pid for process in psutil.Process().children()]
        for number in numbers:
            with suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)
        try:
            number, status = os.waitpid(-1, 0)  # whose own processes then come to this one
        except ChildProcessError:
            return os.waitstatus_to_exitcode(statuses[child])
        statuses[number] = status


def _has_started() -> bool:
    """Whether a process that this one has started is at work."""
    with suppress(ChildProcessError):
        while True:
            if os.waitpid(-1, os.WNOHANG)[0] == 0:
                return True
    return False


def _hide() -> _Refusal:
    """Hide the modules that hold the bench and the harness from all imports that follow."""
    for name in list(sys.modules):
        if name.startswith(HIDDEN):
            parent, _, child = name.rpartition(".")
            vars(sys.modules.get(parent, display)).pop(child, None)
            del sys.modules[name]
    for name, value in list(vars(display).items()):
        if getattr(value, "__module__", "").startswith(HIDDEN):
            delattr(display, name)
    refusal = _Refusal()
    sys.meta_path.insert(0, refusal)
    return refusal


class _Refusal:
    refused = ""  # the first name that was

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        if name.startswith(HIDDEN):
            self.refused = self.refused or name
            raise ImportError(f"{name} is not for methods: the bench and the harness are in another process")
        return None


def _call(channel: Channel, cls: type[Any], owner: str, folder: str) -> None:
    """Get ready, and answer one call. folder: of the method's code."""
    setting = channel.receive()
    device = find(setting["device"])
    if setting["memory_gib"] is not None:
        _limit_memory(setting["memory_gib"])
    with repeatable(setting["threads"], device):
        opens(setting["device"])
        channel.send("ready")
        call = channel.receive()
        with recorded() as opened:
            try:
                told = {"result": _result(channel, cls, owner, device, call)}
                _flush()
            except BaseException as error:
                told = _told(error, cls)
        reads = {"seen": vars(opened.of_the_method(folder))}
        try:
            channel.send(told | reads)
        except Exception as error:  # a result that is no message
            refused = CellError(f"what {call['function']} returned: {error}")
            channel.send(_told(refused, cls) | reads)
    with suppress(EOFError, OSError):
        channel.receive()  # until the harness has read what memory this took


def _result(channel: Channel, cls: type[Any], owner: str, device: torch.device, call: dict[str, Any]) -> Any:
    function = call["function"]
    if function == "words":
        return asdict(words(cls))
    method = plugins.made(cls, owner, call["params"])
    if function == "params":
        return plugins.params_of(method)
    args = moved(call["args"], device)
    if "handle" in call:
        args.append(HANDLES[call["handle"]](channel, moved(call["known"], device)))
    result = getattr(method, function)(*args)
    if function == "external":
        return {name: path and str(path) for name, path in result.items()}
    if function == "files":
        return [str(path) for path in result]
    return list(result) if function == "estimates" else from_numpy(result)


def _told(error: BaseException, cls: type[Any]) -> dict[str, Any]:
    """An error as a message, with the last line of the method's own file on the way to it: `` (mine.py, line 7)``."""
    file = str(getattr(sys.modules.get(cls.__module__), "__file__", None))
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    place = f" ({Path(file).name}, line {lines[-1]})" if lines and not isinstance(error, UserError | CellError) else ""
    fault = [list(error.where), error.at_key] if isinstance(error, FieldError) else None
    text = "".join(traceback.format_exception(error))
    return {"error": type(error).__name__, "message": f"{error}{place}", "fault": fault, "traceback": text}


def _limit_memory(gib: float) -> None:
    import resource  # not on Windows

    pages = int(Path("/proc/self/statm").read_text().split()[5])  # of data, those of the libraries
    limit = int(gib * 2**30) + pages * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
