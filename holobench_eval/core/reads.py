"""Which files a process opens for reading, and what else it asks of its surroundings.

An audit hook sees ``open`` in Python and in all that is written in it: NumPy, Pillow, SciPy, pandas, ``torch.load``,
imports; and listings of folders. C code that opens a file by itself is not seen: h5py, pyarrow, safetensors, ctypes.
Of what this package brings along, `SILENT` announces such functions.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import site
import sys
import sysconfig
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache, wraps
from pathlib import Path
from types import FrameType
from typing import Any
from unittest.mock import patch

from .hashing import ABSENT, State, digest, file_digest, file_state

PACKAGE = __package__.partition(".")[0]
PATHS = {"open": 0, "import": 1, "ctypes.dlopen": 0, "sqlite3.connect": 0}  # events, and which argument is a path
LISTINGS = ("os.listdir", "os.scandir")
STARTED = "what programs and processes read that it starts"
PROCESSES = ("subprocess.Popen", "os.posix_spawn", "os.exec", "os.system", "os.fork")
UNSEEN = {**dict.fromkeys(PROCESSES, STARTED), "socket.connect": "what others send to it"}
EVENTS = {*PATHS, *LISTINGS, *UNSEEN}
SILENT = {  # by module, how functions begin
    "cv2": ("imread",),
    "torch": ("from_file",),
    "torch.jit": ("load",),
    "kornia_rs": ("read_image",),
    "kornia_rs.io": ("read_image",),
    "os": ("stat", "lstat", "access"),
}
IMPORTS = ("importlib._bootstrap", "_frozen_importlib", "importlib.metadata", f"{PACKAGE}.core.sources")
ENVIRONMENT = ("os", "collections.abc", "posixpath")  # Python's modules through which a variable is read
COMPILED = (".nbi", ".nbc")  # of Numba, which follow from code: see `sources.import_class`
OURS = tuple(f"{PACKAGE}.{part}" for part in ("display", "lab"))  # what they open, a method does not read
SYSTEM = ("/proc", "/dev", "/sys", "/usr", "/etc", "/lib", "/lib64", "/bin", "/run")
PEOPLES = ("/dev/shm/", "/run/media/", "/usr/local/share/")  # what lies there below the system's folders is not its own


@dataclass
class Seen:
    """What was opened. read: the state of each file when it was first opened for reading, None where it was not there,
    unless it was written before, and of each folder whose names were listed; written: files that were written; unseen:
    in words, what else it took from outside; began: when [ns]."""

    read: dict[str, State | str | None] = field(default_factory=dict)
    written: set[str] = field(default_factory=set)
    unseen: set[str] = field(default_factory=set)
    began: int = field(default_factory=time.time_ns)

    def note(self, name: str, flags: int = os.O_RDONLY) -> None:
        """Note a file that is being opened, or a folder, with ``/`` at its end, that is listed."""
        if not name or name.endswith(COMPILED):
            return
        if name.endswith(".pyc"):  # in __pycache__, or below PYTHONPYCACHEPREFIX
            with suppress(ValueError):
                name = importlib.util.source_from_cache(name)
        if flags & (os.O_WRONLY | os.O_CREAT | os.O_TRUNC):
            self.written.add(name)
        elif name not in self.written and Path(name).is_dir() == name.endswith("/"):
            self.read.setdefault(name, state_of(name))

    def add(self, other: Seen) -> None:
        """Take over what a later call has opened."""
        self.read = {**other.read, **self.read}
        self.written |= other.written
        self.unseen |= other.unseen

    def rewrites(self, path: str) -> bool:
        """Whether the code itself writes a file that it reads, or into a folder that it lists."""
        return path in self.written or (path.endswith("/") and state_of(path) != self.read.get(path))

    def of_the_method(self, folder: str) -> Seen:
        """The same without installed files, and without those that were made and removed meanwhile.

        folder: of the method's file; what lies there is not installed.
        """
        read = {
            path: state
            for path, state in self.read.items()
            if not is_installed(path, folder)
            and (state is None or Path(path).exists() or (isinstance(state, tuple) and state[-1] < self.began))
        }
        return replace(self, read=read)


def content(path: str) -> str:
    """The digest of a file; where the path ends with ``/``, of the names in a folder, without what this package and
    Python write there. ``absent`` for what is not there."""
    if not path.endswith("/"):
        return file_digest(path)
    try:
        return digest(sorted(item.name for item in Path(path).iterdir() if not _is_written_here(item)))
    except OSError:
        return ABSENT


def _is_written_here(item: Path) -> bool:
    return item.name == "__pycache__" or any((item / part).is_dir() for part in ("records", "solved"))


def state_of(path: str) -> State | str | None:
    """What changes with the ``content`` of a path; None for a file that is not there."""
    return content(path) if path.endswith("/") else file_state(path)


IMPORTED = Seen()
"""By the imports of users' files and packages in this process."""
_recorder: Seen | None = None
_others: frozenset[int] = frozenset()  # threads that were there before, such as those that serve a scheduler
_noting = threading.local()


@contextmanager
def recorded() -> Iterator[Seen]:
    """What this process opens within the context. It writes no bytecode meanwhile.

    Cached bytecode is valid for a source of the same size and the same second, so a file that is rewritten within a
    second would run as it was before.
    """
    global _recorder, _others
    _install()
    before, _recorder = (_recorder, _others), Seen()
    _others = frozenset(thread.ident or 0 for thread in threading.enumerate()) - {threading.get_ident()}
    try:
        with _announced(), patch.object(sys, "dont_write_bytecode", True):
            yield _recorder
    finally:
        _recorder, _others = before


@cache
def _install() -> None:
    sys.addaudithook(_hook)  # it stays for good


def _hook(event: str, args: tuple[Any, ...]) -> None:
    if (seen := _recorder) is None or event not in EVENTS or getattr(_noting, "now", False):
        return
    _noting.now = True
    with suppress(Exception):  # whatever is wrong with a path, is wrong when it is opened
        if _is_anothers(sys._getframe(1), importing=event in LISTINGS):
            pass
        elif event in UNSEEN:
            seen.unseen.add(UNSEEN[event])
        elif event in LISTINGS:
            seen.note(f"{_absolute('.' if args[0] is None else args[0])}/")
        elif args[PATHS[event]] is not None:
            flags = args[2] if event == "open" and isinstance(args[2], int) else os.O_RDONLY
            seen.note(_absolute(args[PATHS[event]]), flags)
    _noting.now = False


def _absolute(path: Any, folder: int | None = None) -> str:
    """The name of a file or a folder; empty for a file that is open already. folder: number of that where it starts."""
    if isinstance(path, int) and Path(f"/proc/self/fd/{path}").is_dir():
        path, folder = "", path
    if not isinstance(path, str | bytes | os.PathLike):
        return ""
    start = Path.cwd() if folder is None else Path(f"/proc/self/fd/{folder}").readlink()
    return os.path.normpath(start / os.fsdecode(path))


def _is_anothers(frame: FrameType | None, importing: bool = False) -> bool:
    """Whether it is not the user's code that opens a file, but the display, in a method's call, or an installed package
    as it is imported, which happens once in a process, or a thread from before. A method's own code comes first on the
    way out.

    importing: whether what an import itself opens is not the user's either.
    """
    while frame is not None:
        name, file = str(frame.f_globals.get("__name__")), frame.f_code.co_filename
        if name.startswith(OURS) or (importing and name.startswith(IMPORTS)):
            return True
        if not name.startswith(IMPORTS) and not file.startswith("<"):
            if not is_installed(file):
                return False
            importing = True
        frame = frame.f_back
    return threading.get_ident() in _others


def so_far() -> str | None:
    """A digest of what users' imports and the present call have read; None where that has changed since, or they took
    more than files."""
    seen = Seen()
    for each in (IMPORTED, _recorder or Seen()):
        seen.add(each.of_the_method(""))
    if seen.unseen or any(state_of(path) != state for path, state in seen.read.items()):
        return None
    return digest({path: content(path) for path in seen.read})


@contextmanager
def _announced() -> Iterator[None]:
    """Let functions say what they read that no event tells: of C code, by the number of a folder, by a look alone."""

    def announced(function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def announce(file: Any, *args: Any, **named: Any) -> Any:
            with suppress(Exception):
                sys.audit("open", _absolute(file, named.get("dir_fd")), "r", os.O_RDONLY)
            return function(file, *args, **named)

        return announce

    def opened(path: Any, flags: int, mode: int = 0o777, *, dir_fd: int | None = None) -> int:
        return by_name(path if dir_fd is None else _absolute(path, dir_fd), flags, mode)

    def variable(environment: Any, key: Any) -> Any:
        frame: FrameType | None = sys._getframe(1)
        while frame is not None and str(frame.f_globals.get("__name__")).startswith(ENVIRONMENT):
            frame = frame.f_back
        if _recorder and key != "HOME" and frame is not None and not is_installed(frame.f_code.co_filename):
            _recorder.unseen.add(f"the environment variable {os.fsdecode(key)}")
        return value_of(environment, key)

    by_name, value_of = os.open, type(os.environ).__getitem__
    told: list[tuple[Any, str, Any]] = [(os, "open", opened), (type(os.environ), "__getitem__", variable)]
    for place, start in SILENT.items():
        with suppress(ImportError):
            module = importlib.import_module(place)  # before a user's code takes functions from it
            names = [name for name in vars(module) if name.startswith(start)]
            told += [(module, name, announced(getattr(module, name))) for name in names]
    with ExitStack() as stack:
        for owner, name, function in told:
            stack.enter_context(patch.object(owner, name, function))
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
