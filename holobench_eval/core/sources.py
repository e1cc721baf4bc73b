"""The code of a user's file: the file itself, and what is read for its import and is installed with no package.

Files count whole, comments and docstrings included, since code can read both. What functions import or read later is
seen when they do.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

from .errors import UserError
from .hashing import digest
from .reads import IMPORTED, PACKAGE, Seen, content, is_installed, recorded, so_far, state_of, within
from .released import edited, file_of, imports, used


@dataclass(frozen=True)
class Code:
    """The code of a class that does not ship with this package.

    name: of the class in its file; files: sha256 by path, seen from the folder of its file, also of folders whose names
    were listed (``reads.content``); bases: versions of the classes of this package that it derives from or that its
    files have imported; folder: of its file; uncovered: what else was read for its import; study: folder of the study
    that names it, empty where there is none; installed: whether it is that of a package.
    """

    name: str
    files: Mapping[str, str]
    bases: tuple[str, ...]
    folder: str
    uncovered: tuple[str, ...] = ()
    study: str = ""
    installed: bool = False

    @property
    def sha256(self) -> str:
        """Another one for any other byte in any of the files, and for another place seen from the study: the same code
        may read other files there."""
        place = "" if self.installed or not self.study else self.folder
        place = os.path.relpath(place, self.study) if place and within(place, self.study) else place
        return digest({"name": self.name, "files": dict(self.files), "bases": list(self.bases), "place": place})

    @property
    def paths(self) -> list[str]:
        """Its files, absolute."""
        return [os.path.normpath(Path(self.folder, file)) + "/" * file.endswith("/") for file in self.files]


_codes: WeakKeyDictionary[type[Any], Code] = WeakKeyDictionary()
_mains: set[str] = set()  # names of the modules of users' files
_served: set[str] = set()  # names of modules that these have imported from their folders
_read: set[str] = set()  # files that were part of their code


def code_of(cls: type[Any]) -> Code:
    """The code of a class that was imported by its file; of another one, its module and that one's package."""
    if cls not in _codes:
        _codes[cls] = _of_module(cls)
    return _codes[cls]


def remember(cls: type[Any], code: Code) -> None:
    """Let ``code_of`` give this code for a class."""
    _codes[cls] = code


def is_fresh(cls: type[Any]) -> bool:
    """Whether a class is in the memory of its file's last import alone."""
    spec = getattr(sys.modules.get(cls.__module__), "__spec__", None)
    return isinstance(getattr(spec, "loader", None), _FromSource)


def ships(cls: type[Any]) -> bool:
    """Whether a class is of this package; one that stands for a user's is not."""
    return cls not in _codes and cls.__module__.startswith(f"{PACKAGE}.")


def declared_version(cls: type[Any]) -> str:
    """The version that a class of this package declares, 1 where it says nothing."""
    return f"{cls.__qualname__} {getattr(cls, 'version', 1)}"


def import_file(path: Path) -> ModuleType:
    """Import a Python file from its source, anew each time: nothing that one cell computes may reach the next.

    What it imports from its own folder is imported anew as well, and needs no ``PYTHONPATH``.

    Parameters
    ----------
    path : Path
        The file. Its module has a name of its own for every path.

    Raises
    ------
    Exception
        Whatever the file raises while it runs; OSError where it cannot be read.
    """
    path = path.absolute()  # a file may ask where it is, and its code is identified by where it lies
    folder = str(path.parent)
    _forget(folder)
    if not any(isinstance(finder, _Beside) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Beside())
    importlib.invalidate_caches()
    package = f"holobench_user_{hashlib.sha256(str(path.parent.resolve()).encode()).hexdigest()[:12]}"
    parent = ModuleType(package)  # for what the file imports relatively
    parent.__path__ = [folder]
    sys.modules[package] = parent
    loader = _FromSource(f"{package}.{path.stem.replace('.', '_')}", str(path))
    spec = ModuleSpec(loader.name, loader, origin=str(path), loader_state=folder)
    module = importlib.util.module_from_spec(spec)
    module.__file__ = str(path)
    sys.modules[loader.name] = module  # dataclasses look their module up
    _mains.add(loader.name)
    loader.exec_module(module)
    return module


def import_class(path: Path, name: str, study: Path | None) -> tuple[ModuleType, Code]:
    """Import a file, and tell what the code of its class ``name`` is, but for what it derives from.

    study: the folder of the study. UserError for a file that changes meanwhile, and whatever the file raises.
    """
    folder = str(path.absolute().parent)
    with imports_recorded() as opened:
        module = import_file(path)
    seen = opened.of_the_method(folder)
    files = {file for file in seen.read if not seen.rewrites(file)}  # which would be other code each time
    if any(state_of(file) != seen.read[file] for file in files):
        raise UserError(f"{path} was changed while it was imported; start again")
    home = "" if study is None else str(study.absolute())
    _read.update(file for file in files if file.endswith(".py"))
    uncovered = [file for file, state in sorted(seen.read.items()) if state and file not in files]
    uncovered += sorted(seen.unseen)
    bases = (*_used(module), *_edits(files))
    code = Code(name, _digests(files, folder), bases, folder, tuple(uncovered), home)
    return module, code


def _used(module: ModuleType) -> tuple[str, ...]:
    """The versions of the methods of this package that a user's module, or one from its folder, has imported."""
    modules = [module, *filter(None, map(sys.modules.get, _served))]
    values = [value for each in modules for value in vars(each).values() if isinstance(value, type)]
    return tuple(sorted({declared_version(cls) for cls in values if ships(cls) and hasattr(cls, "solve")}))


def _edits(files: Iterable[str]) -> list[str]:
    """What of this package these files use and is not as it was released."""
    changes = edited(name for file in files if file.endswith(".py") for name in imports(Path(file)))
    return [f"edited {changes}"] if changes else []


def _digests(files: Iterable[str], folder: str) -> dict[str, str]:
    return {f"{os.path.relpath(file, folder)}{'/' * file.endswith('/')}": content(file) for file in sorted(files)}


@contextmanager
def imports_recorded() -> Iterator[Seen]:
    """What is opened within the context, in which a user's file or package is imported."""
    _keep_compiled_apart()
    with recorded() as opened:
        yield opened
    IMPORTED.add(opened)


@cache
def _keep_compiled_apart() -> None:
    """Let what Numba has compiled of users' functions be for the code and the files that were read so far alone, since
    it holds what they call and their global values. Where more than files was taken, nothing is kept."""
    try:
        from numba.core.caching import Cache
    except ImportError:
        return
    key_of = Cache._index_key

    def key(kept: Any, *args: Any) -> Any:
        known, read = key_of(kept, *args), so_far()
        if is_installed(kept._py_func.__code__.co_filename):
            return known
        if read is None:
            kept.disable()
            return object()  # is none that is kept
        return *known, read

    Cache._index_key = key


def _of_module(cls: type[Any]) -> Code:
    """The code of a class of an installed package, or of a test: all files of the package, since an import that has
    happened is no longer seen, and what these import and is not installed."""
    own = [sys.modules.get(base.__module__) for base in cls.__mro__ if not ships(base)]
    files = [Path(file) for file in (getattr(module, "__file__", None) for module in own) if file]
    if not files:
        return Code(cls.__qualname__, {}, bases_of(cls), "/")
    folder = str(files[0].parent)
    depth = cls.__module__.count(".") - (files[0].name == "__init__.py")
    package = str(files[0].parents[depth - 1]) if depth > 0 else folder
    below = Path(package).rglob("*") if depth > 0 else files
    contents = {str(file) for file in below if file.is_file() and file.parent.name != "__pycache__"}
    contents |= {str(file) for file in used([cls.__module__], _is_edited_in_place).values()}
    bases = (*bases_of(cls), *_edits(contents))
    others = IMPORTED.of_the_method("")
    uncovered = (*sorted(others.read.keys() - contents), *sorted(others.unseen))
    name = f"{cls.__module__}.{cls.__qualname__}"
    return Code(name, _digests(contents, package), bases, package, uncovered, installed=True)


def _is_edited_in_place(module: str) -> bool:
    """Whether a module lies in a folder of its own, and not where packages are installed."""
    file = file_of(module.partition(".")[0])
    return file is not None and not is_installed(str(file))


def bases_of(cls: type[Any]) -> tuple[str, ...]:
    """The versions of the classes of this package that a class derives from."""
    return tuple(declared_version(base) for base in cls.__mro__ if ships(base))


def _forget(folder: str) -> None:
    """Take modules from memory that a file would find there in the place of those of its own folder as they are now."""
    beside = {file.stem for file in Path(folder).iterdir() if file.suffix == ".py" or file.is_dir()}
    for name, module in list(sys.modules.items()):
        file, top = str(getattr(module, "__file__", None)), name.partition(".")[0]
        if top in (*sys.stdlib_module_names, PACKAGE, "__main__") or name in _mains:
            continue
        if ((top in beside or name in _served) and not is_installed(file)) or file in _read:
            del sys.modules[name]
    _served.clear()


class _FromSource(SourceFileLoader):
    """Compiles a file anew for every import. The state in its specification is the folder of the user's file, empty for
    one that lies elsewhere."""

    def get_code(self, fullname: str) -> CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)


class _Beside:
    """Gives a user's file, and it alone, what lies in its folder: before installed packages, after Python's own.

    So a ``datasets.py`` beside it is what its ``import datasets`` means, and not what that of a library means. What it
    imports from elsewhere and is not installed, it compiles anew, too.
    """

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """The module of a name that is imported by a user's file or what that has imported; None for any other."""
        folder = _importer(sys._getframe(1))
        top = name.partition(".")[0]
        if folder is None or top in sys.stdlib_module_names or top == PACKAGE:
            return None
        spec = PathFinder.find_spec(name, [folder] if folder and path is None else path)
        # A folder without code, such as one of results, is no package where another one is.
        if spec is None or (spec.loader is None and path is None):
            others = (finder for finder in sys.meta_path if not isinstance(finder, _Beside))
            spec = next(filter(None, (finder.find_spec(name, path) for finder in others)), spec)
        if spec is None or not _is_own(spec, folder):
            return None
        if type(spec.loader) is SourceFileLoader:
            spec.loader = _FromSource(spec.loader.name, spec.loader.path)
            spec.loader_state = folder if within(spec.loader.path, folder) else ""
        _served.add(name)
        return spec


def _is_own(spec: ModuleSpec, folder: str) -> bool:
    places = [spec.origin] if spec.origin else list(spec.submodule_search_locations or ())
    return bool(places) and not any(is_installed(place, folder) for place in places)


def _importer(frame: FrameType | None) -> str | None:
    """The folder of the user's file whose code imports, empty for one from elsewhere, None where other code does."""
    while frame is not None:
        spec: Any = frame.f_globals.get("__spec__")
        if isinstance(getattr(spec, "loader", None), _FromSource):
            return spec.loader_state
        passes_on = ("importlib", "_frozen_importlib", "runpy", "<run_path>", __name__)
        if not str(frame.f_globals.get("__name__")).startswith(passes_on):
            return None
        frame = frame.f_back
    return None
