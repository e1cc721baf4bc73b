"""Methods that are not this package's run in a process of their own, which holds no bench, no score and no record.

The harness gets what such a method declares, asks it to solve, and answers what it asks of the display.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import partial, partialmethod
from pathlib import Path
from typing import Any, ClassVar

import torch

from ...core import parameters, plugins, sources
from ...core.device import CPU
from ...core.errors import CellError, UserError
from ...core.hashing import ABSENT, canonical, file_digest
from ...core.io import file_name
from ...core.reads import Seen, recorded
from ...core.schema import FieldError
from ...display.traits import BOOLEANS, FLAGS, Traits, traits_of
from ..definition import Isolation, Limits, MethodEntry
from ..versions import AGAIN, method_version
from . import process
from .reads import Reads as Reads
from .reads import changed as changed
from .reads import named_files, reads_of


class Apart:
    """A method that runs elsewhere: what its class declares, and its functions as calls to its process.

    For each method there is a class of it, as ``find`` makes them. refused: what its file imports that is hidden from
    methods, so that it can only run inside.
    """

    file: ClassVar[str]
    folder: ClassVar[Path]
    refused: ClassVar[str]

    def __init__(self, params: Mapping[str, Any], limits: Limits | None = None) -> None:
        self.params = dict(params)
        self.limits = limits or Limits(seconds=process.IMPORT_LIMIT)
        self._running: Callable[..., Any] | None = None

    def _call(self, function: str, *args: Any) -> Any:
        if self._running is not None:
            return self._running(function, self.params, args)
        device = next((argument.device for argument in args if isinstance(argument, process.Handle)), CPU)
        with opened(self, device):
            return self._call(function, *args)


@dataclass(frozen=True)
class Opened:
    """A method that is ready for its calls. seen: what they have opened so far; pid: the number of its process, None
    for a method that runs inside; late: seconds for which it has worked since its last call, or while it got ready."""

    method: Any
    seen: Seen
    pid: int | None = None
    late: float = 0.0

    @property
    def reads(self) -> Reads:
        """What a user's code has read so far; nothing for a method of this package, which declares it."""
        return reads_of(self.method, params_of, self.seen)


@contextmanager
def opened(method: Any, device: torch.device) -> Iterator[Opened]:
    """A method that is ready for its calls, with its process, if it has one, before the clock runs."""
    if not isinstance(method, Apart):
        with nullcontext(Seen()) if sources.ships(type(method)) else recorded() as seen:
            yield Opened(method, seen)
    else:
        running = process.process_of(method.file, method.folder)
        code = running.facts.code
        if code is not None and code.sha256 != method_version(type(method)):
            raise CellError(f"the code of {method.file} {AGAIN}")
        with running.opened(device, method.limits) as (pid, channel, late):
            seen = Seen()
            method._running = partial(process.call, channel, seen)
            try:
                yield Opened(method, seen, pid, late)
            finally:
                method._running = None


def find(name: str, folder: Path) -> type[Any]:
    """What a method declares: its class, or one that stands for it. UserError as ``plugins.find``."""
    installed = plugins.is_shipped("methods", name) or not (".py:" in name or name in plugins.names("methods"))
    return plugins.find("methods", name, folder) if installed else _apart(name, folder)


def traits(name: str, folder: Path) -> Traits:
    """The traits of a method. UserError as ``find``."""
    return traits_of(find(name, folder), name)


def _apart(name: str, folder: Path) -> type[Apart]:
    facts = process.process_of(name, folder).facts
    calls: dict[str, Any] = {function: partialmethod(Apart._call, function) for function in facts.functions}
    flags = {flag: value for flag, value in facts.flags.items() if flag in FLAGS}  # the process may say anything
    identity = {"file": name, "folder": folder, "__doc__": facts.doc, "refused": facts.refused}
    if not {"solve", "predict"} & set(facts.functions):
        raise UserError(f"method '{name}' has neither solve nor predict")
    cls = type(facts.name, (Apart,), {**flags, **calls, **identity})
    traits_of(cls, name)  # UserError for a flag that is neither True nor False
    if facts.code is not None:
        sources.remember(cls, replace(facts.code, study=str(folder.absolute())))
    return cls


def build(name: str, params: Mapping[str, Any], folder: Path) -> Any:
    """A method with its parameters checked and complete, for what it declares. UserError as ``plugins.build``, for a
    parameter that would say what only the class may declare, and where the method's process ends."""
    cls = find(name, folder)
    for flag in BOOLEANS:
        if flag in params:
            message = f"method '{name}': '{flag}' is no parameter; only its class declares it, as a ClassVar"
            raise FieldError((flag,), message, at_key=True)
    if not issubclass(cls, Apart):
        return plugins.build("methods", name, dict(params), folder)
    try:
        complete = cls(params)._call("params")
    except CellError as error:  # no cell is computed yet
        raise UserError(f"method '{name}' does not give its parameters: {error}") from error
    canonical(complete)
    return cls(complete)


def words(name: str, folder: Path) -> parameters.Words:
    """What a method says of itself. UserError as ``find``, and where its process ends or tells something else."""
    cls = find(name, folder)
    if not issubclass(cls, Apart):
        return parameters.words(cls)
    try:
        told: parameters.Words = cls({})._call("words")
    except CellError as error:
        raise UserError(f"method '{name}' does not tell what it is: {error}") from error
    return told


def params_of(method: Any) -> dict[str, Any]:
    """Every parameter of a method as plain JSON values, defaults included."""
    return dict(method.params) if isinstance(method, Apart) else plugins.params_of(method)


def solver(name: str, params: Mapping[str, Any], folder: Path, isolation: Isolation, limits: Limits) -> Any:
    """A method to be called, in a process of its own within limits, or not."""
    if runs_inside(name, folder, isolation):
        return plugins.build("methods", name, dict(params), folder)
    return _apart(name, folder)(params, limits)


def measured(names: Iterable[str], folder: Path) -> dict[str, Any]:
    """For the provenance, of methods that do not ship with the package: the seconds that their import took, outside the
    clock of their cells, and whether each has namespaces of its own (``namespace.enter``). Empty without such."""
    users = [name for name in dict.fromkeys(names) if not plugins.is_shipped("methods", name)]
    facts = {name: process.process_of(name, folder).facts for name in users}
    if not facts:
        return {}
    seconds = {name: round(told.seconds, 2) for name, told in facts.items()}
    return {"imports_s": seconds, "methods_enclosed": all(told.enclosed for told in facts.values())}


def runs_inside(name: str, folder: Path, isolation: Isolation) -> bool:
    """Whether a method's functions run in the process of the harness; those that look into a bench always do."""
    if isolation == "files":
        return plugins.is_shipped("methods", name)
    declared = traits(name, folder)
    return isolation == "none" or declared.privileged or declared.simulates


def files_read(entry: MethodEntry, folder: Path, targets: Collection[str]) -> dict[str, dict[str, str]]:
    """What ``digests`` gives for every target of a method of a study. folder: of the config.

    UserError where not one of the files is there, and where the method refuses that targets share a file; a few that
    lack are holes of the table.
    """
    method = build(entry.name, entry.params, folder)
    try:
        found = {target: _files(method, target) for target in targets}
        taken = external(method) | _named(method)
        if hasattr(method, "refuse_shared"):
            method.refuse_shared([*targets])
    except (CellError, OSError) as error:
        raise UserError(f"method '{entry.name}' does not say which files it reads: {error}") from error
    except UserError as error:
        raise UserError(f"method '{entry.name}': {error}") from None
    read = [(target, path, sha256) for target, digests in found.items() for path, sha256 in digests.items()]
    if read and all(sha256 == ABSENT for *_, sha256 in read):
        target, path, _ = read[0]
        path += "" if file_name(target) == target else f" for the target '{target}'"
        where = "" if Path(path).is_absolute() else ", from the working directory"
        raise UserError(f"method '{entry.name}': none of the files that it reads is there, such as {path}{where}")
    return {target: {**digests, **taken} for target, digests in found.items()}


def digests(method: Any, target: str) -> dict[str, str]:
    """All files that a method's phase of a target is known to depend on, beside its code: ``files``, ``external`` and,
    of a user's method, those that parameters name. What a method of this package reads, it declares by these functions:
    a file that is replaced gives another phase."""
    return {**_files(method, target), **external(method), **_named(method)}


def _named(method: Any) -> dict[str, str]:
    cls = type(method)
    return {} if sources.ships(cls) else named_files(params_of(method), sources.code_of(cls))


def _files(method: Any, target: str) -> dict[str, str]:
    """sha256 of the files that a method reads for a target, by the paths that its function ``files`` gives; ``absent``
    for one that is not there. Empty for a method without that function."""
    given = method.files(target) if "files" in traits_of(method).functions else ()
    return {str(path): file_digest(str(path)) for path in given}


def external(method: Any) -> dict[str, str]:
    """sha256 of the files that a method takes where a machine has them, by names that are the same everywhere;
    ``absent`` for one that is not there. Its function ``external`` gives their paths, None for no file."""
    given = method.external() if "external" in traits_of(method).functions else {}
    return {name: ABSENT if path is None else file_digest(path) for name, path in given.items()}
