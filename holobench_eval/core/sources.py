"""The code of a user's file: the file itself, and what it imports or reads from its own folder or below.

Files count whole, comments and docstrings included, since code can read both. What is imported when the file is
imported is seen; what functions import later is found by its name in the code.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import os
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

from .errors import UserError
from .hashing import State, digest, file_digest, file_state
from .reads import PACKAGE, STARTED, is_installed, recorded, within


@dataclass(frozen=True)
class Code:
    """The code of a class that does not ship with this package.

    name: of the class in its file; files: sha256 by path, seen from the folder of its file; bases: versions of the
    classes of this package that it derives from or that its files have imported; folder: of its file; uncovered: what
    else was read for its import; study: folder of the study that names it, empty where there is none; installed:
    whether it is that of a package.
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
        return [os.path.normpath(Path(self.folder, file)) for file in self.files]


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
    _forget(_reach([path], folder), folder)
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

    study: the folder of the study; files that are read for the import and lie there are part of the code. UserError
    for a file that changes meanwhile, and whatever the file raises.
    """
    folder = str(path.absolute().parent)
    before = {file: file_state(file) for file in _reach([path.absolute()], folder)}
    with recorded() as opened:
        module = import_file(path)
    if any(file_state(file) != state for file, state in before.items()):
        raise UserError(f"{path} was changed while it was imported; start again")
    seen = opened.of_the_method(folder)
    read = seen.read
    home = "" if study is None else str(study.absolute())
    fixed = read.keys() - seen.written  # what an import writes would be other code each time
    own = {file for file in fixed if lies_in(file, folder) or (home and lies_in(file, home))}
    loaded = [Path(file) for file in own if file.endswith(".py")]
    files = own | set(map(str, _reach([path.absolute(), *loaded], folder)))
    _read.update(map(str, loaded))
    uncovered = [file for file, state in sorted(read.items()) if state and file not in files]
    uncovered += [STARTED] if seen.starts else []
    return module, Code(name, _digests(files, folder), _used(module), folder, tuple(uncovered), home)


def _used(module: ModuleType) -> tuple[str, ...]:
    """The versions of the methods of this package that a user's module, or one from its folder, has imported."""
    modules = [module, *filter(None, map(sys.modules.get, _served))]
    values = [value for each in modules for value in vars(each).values() if isinstance(value, type)]
    return tuple(sorted({declared_version(cls) for cls in values if ships(cls) and hasattr(cls, "solve")}))


def lies_in(file: str, folder: str) -> bool:
    """Whether a file lies below a folder, by its name or by where its links lead."""
    return within(file, folder) or within(os.path.realpath(file), os.path.realpath(folder))


def _digests(files: Iterable[str], folder: str) -> dict[str, str]:
    return {os.path.relpath(file, folder): file_digest(file) for file in sorted(files)}


def _of_module(cls: type[Any]) -> Code:
    """The code of a class of an installed package, or of a test: all files of the package, since an import that has
    happened is no longer seen."""
    own = [sys.modules.get(base.__module__) for base in cls.__mro__ if not ships(base)]
    files = [Path(file) for file in (getattr(module, "__file__", None) for module in own) if file]
    if not files:
        return Code(cls.__qualname__, {}, bases_of(cls), "/")
    folder = str(files[0].parent)
    depth = cls.__module__.count(".") - (files[0].name == "__init__.py")
    package = str(files[0].parents[depth - 1]) if depth > 0 else folder
    below = Path(package).rglob("*") if depth > 0 else files
    contents = [str(file) for file in below if file.is_file() and file.parent.name != "__pycache__"]
    return Code(cls.__qualname__, _digests(contents, package), bases_of(cls), package, installed=True)


def bases_of(cls: type[Any]) -> tuple[str, ...]:
    """The versions of the classes of this package that a class derives from."""
    return tuple(declared_version(base) for base in cls.__mro__ if ships(base))


def _forget(files: Iterable[Path], folder: str) -> None:
    """Take modules from memory that a file would find there in the place of those of its own folder as they are now."""
    names = {str(Path(os.path.relpath(file, folder)).with_suffix("")).replace(os.sep, ".") for file in files}
    names = {name.removesuffix(".__init__") for name in names} | _served
    for name, module in list(sys.modules.items()):
        file = str(getattr(module, "__file__", None))
        if name.partition(".")[0] in (*sys.stdlib_module_names, PACKAGE, "__main__") or name in _mains:
            continue
        if (name in names and not is_installed(file)) or file in _read:
            del sys.modules[name]
    _served.clear()


class _FromSource(SourceFileLoader):
    """Compiles a file anew for every import. The state in its specification is the folder of the user's file."""

    def get_code(self, fullname: str) -> CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)


class _Beside:
    """Gives a user's file, and it alone, what lies in its folder: before installed packages, after Python's own.

    So a ``datasets.py`` beside it is what its ``import datasets`` means, and not what that of a library means.
    """

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """The module of a name that is imported by a user's file or what that has imported; None for any other."""
        folder = _importer(sys._getframe(1))
        top = name.partition(".")[0]
        if folder is None or top in sys.stdlib_module_names or top == PACKAGE:
            return None
        spec = PathFinder.find_spec(name, [folder] if path is None else path)
        if spec is None or not _is_own(spec, folder):
            return None
        if spec.loader is None and path is None and PathFinder.find_spec(name) is not None:
            return None  # a folder without code, such as one of results, is no package where another one is
        if type(spec.loader) is SourceFileLoader:
            spec.loader, spec.loader_state = _FromSource(spec.loader.name, spec.loader.path), folder
        _served.add(name)
        return spec


def _is_below(file: str, folder: str) -> bool:
    return within(file, folder) and not is_installed(file, folder)


def _is_own(spec: ModuleSpec, folder: str) -> bool:
    places = [spec.origin] if spec.origin else list(spec.submodule_search_locations or ())
    return bool(places) and all(_is_below(place, folder) for place in places)


def _importer(frame: FrameType | None) -> str | None:
    """The folder of the user's file whose code imports, None where other code does."""
    machinery = ("importlib", "_frozen_importlib", __name__)
    while frame is not None and str(frame.f_globals.get("__name__")).startswith(machinery):
        frame = frame.f_back
    spec: Any = frame and frame.f_globals.get("__spec__")
    return spec.loader_state if isinstance(getattr(spec, "loader", None), _FromSource) else None


def _reach(files: Iterable[Path], folder: str) -> set[Path]:
    """Python files that these import, at once or later, and those that they name in a text.

    folder: where they lie, and absolute names start.
    """
    waiting, reached = list(files), set[Path]()
    while waiting:
        file = waiting.pop()
        if file not in reached and (state := file_state(file)) is not None and _is_below(str(file), folder):
            reached.add(file)
            waiting += [*_named(file, folder, state), *(parent / "__init__.py" for parent in file.parents)]
    return reached


@lru_cache(maxsize=2**10)
def _named(file: Path, folder: str, _state: State) -> list[Path]:
    """Where the Python files lie that one may import, by its text."""
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError, OSError):
        return []
    named: list[tuple[Path, str]] = []  # where a dotted name starts
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            named += [(Path(folder), alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = file.parents[node.level - 1] if 0 < node.level <= len(file.parents) else Path(folder)
            module = node.module or ""
            named += [(start, f"{module}.{alias.name}".lstrip(".")) for alias in node.names]
        elif (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and re.fullmatch(r"[\w./-]{1,200}", node.value)
        ):
            text = node.value.removesuffix(".py").lstrip("./").replace("/", ".")
            named += [(Path(folder), text), (file.parent, text)]
    found = []
    for start, name in named:
        parts = [part for part in name.split(".") if part]
        for place in (start.joinpath(*parts[: i + 1]) for i in range(len(parts))):
            found += [place.with_name(f"{place.name}.py"), place / "__init__.py"]
    return found
