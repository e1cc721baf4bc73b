"""Which files a process opens for reading.

An audit hook sees ``open`` in Python and in all that is written in it: NumPy, Pillow, SciPy, pandas, ``torch.load``,
imports. C code that opens a file by itself is not seen: h5py, pyarrow, safetensors, ctypes. Of what this package
brings along, `SILENT` announces such functions. Neither are files whose names alone are listed or looked up.
"""

from __future__ import annotations

import importlib.util
import os
import site
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache, wraps
from pathlib import Path
from types import FrameType
from typing import Any
from unittest.mock import patch

from .hashing import State, file_state

PACKAGE = __package__.partition(".")[0]
PATHS = {"open": 0, "import": 1, "ctypes.dlopen": 0, "sqlite3.connect": 0}  # events, and which argument is a path
PROCESSES = ("subprocess.Popen", "os.posix_spawn", "os.exec", "os.system", "os.fork")
STARTED = "what programs and processes read that it starts"
SILENT = {"cv2": ("imread", "imreadmulti"), "torch": ("from_file",), "torch.jit": ("load",)}
OURS = tuple(f"{PACKAGE}.{part}" for part in ("display", "lab"))  # what they open, a method does not read
SYSTEM = ("/proc", "/dev", "/sys", "/usr", "/etc", "/lib", "/lib64", "/bin", "/run")
PEOPLES = ("/dev/shm/", "/run/media/", "/usr/local/share/")  # what lies there below the system's folders is not its own


@dataclass
class Seen:
    """What was opened. read: the state of each file when it was first opened for reading, None where it was not there,
    unless it was written before; written: files that were written; starts: whether processes were started, which are
    not seen; began: when [ns]."""

    read: dict[str, State | None] = field(default_factory=dict)
    written: set[str] = field(default_factory=set)
    starts: bool = False
    began: int = field(default_factory=time.time_ns)

    def note(self, path: Any, flags: int = os.O_RDONLY) -> None:
        """Note a file that is being opened."""
        if not isinstance(path, str | bytes | os.PathLike):
            return  # a file that is open already
        name = os.path.normpath(Path(os.fsdecode(path)).absolute())
        if Path(name).parent.name == "__pycache__":
            with suppress(ValueError):
                name = importlib.util.source_from_cache(name)
        if flags & (os.O_WRONLY | os.O_CREAT | os.O_TRUNC):
            self.written.add(name)
        elif name not in self.written and not Path(name).is_dir():
            self.read.setdefault(name, file_state(name))

    def add(self, other: Seen) -> None:
        """Take over what a later call has opened."""
        self.read = {**other.read, **self.read}
        self.written |= other.written
        self.starts |= other.starts

    def of_the_method(self, folder: str) -> Seen:
        """The same without installed files, and without those that were made and removed meanwhile.

        folder: of the method's file; what lies there is not installed.
        """
        read = {
            path: state
            for path, state in self.read.items()
            if not is_installed(path, folder)
            and (state is None or state[-1] < self.began or file_state(path) is not None)
        }
        return replace(self, read=read)


_recorder: Seen | None = None


@contextmanager
def recorded() -> Iterator[Seen]:
    """What this process opens within the context. It writes no bytecode meanwhile.

    Cached bytecode is valid for a source of the same size and the same second, so a file that is rewritten within a
    second would run as it was before.
    """
    global _recorder
    _install()
    before, _recorder = _recorder, Seen()
    try:
        with _announced(), patch.object(sys, "dont_write_bytecode", True):
            yield _recorder
    finally:
        _recorder = before


@cache
def _install() -> None:
    sys.addaudithook(_hook)  # it stays for good


def _hook(event: str, args: tuple[Any, ...]) -> None:
    if _recorder is None or (event not in PATHS and event not in PROCESSES):
        return
    with suppress(Exception):  # whatever is wrong with a path, is wrong when it is opened
        if event in PROCESSES:
            _recorder.starts = True
        elif (path := args[PATHS[event]]) is not None and not _is_ours(sys._getframe(1)):
            flags = args[2] if event == "open" and isinstance(args[2], int) else os.O_RDONLY
            _recorder.note(path, flags)


def _is_ours(frame: FrameType | None) -> bool:
    """Whether the display opens a file, in a method's call. A method's own code comes first on the way out."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith(OURS):
            return True
        if not is_installed(frame.f_code.co_filename) and not frame.f_code.co_filename.startswith("<"):
            return False
        frame = frame.f_back
    return False


@contextmanager
def _announced() -> Iterator[None]:
    """Let functions that open files in C say so."""

    def announced(function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def announce(file: Any, *args: Any, **named: Any) -> Any:
            sys.audit("open", file, "r", os.O_RDONLY)
            return function(file, *args, **named)

        return announce

    with ExitStack() as stack:
        for module in filter(sys.modules.get, SILENT):
            for name in SILENT[module]:
                function = getattr(sys.modules[module], name)
                stack.enter_context(patch.object(sys.modules[module], name, announced(function)))
        yield


@lru_cache(maxsize=1)
def _installed() -> tuple[str, ...]:
    """Folders of Python, of installed packages, of this package and of the system."""
    packages = [importlib.util.find_spec(f"{PACKAGE}.{part}") for part in ("core", "methods", "datasets", "configs")]
    own = [folder for spec in packages if spec for folder in spec.submodule_search_locations or ()]
    folders = [sys.prefix, sys.base_prefix, *sysconfig.get_paths().values(), site.getusersitepackages(), *own]
    package = str(Path(__file__).parents[1])
    return tuple(dict.fromkeys((*map(os.path.realpath, folders), *folders, package, *SYSTEM)))


@lru_cache(maxsize=2**14)
def is_installed(path: str, folder: str = "") -> bool:
    """Whether a file is Python's, an installed package's, this package's or the system's.

    folder: of a study or a method, which may itself lie below such a folder; what is beside it, is not installed.
    """
    if path.startswith(PEOPLES):
        return False
    return any(path.startswith(f"{place}/") and not within(folder, place) for place in _installed())


def within(path: str, folder: str) -> bool:
    """Whether an absolute path is a folder or lies below it."""
    return path == folder or path.startswith(f"{folder.rstrip('/')}/")
