"""The files that a method reads, by which phases are told apart: a file that is replaced gives another phase.

What a method of this package reads, it declares: ``files(target)``, which should be there, and ``external()``, which it
takes where a machine has them. What a user's code reads, is seen while it runs: see `reads`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ...core import sources
from ...core.errors import CellError, UserError
from ...core.hashing import ABSENT, file_digest
from ...core.io import file_name
from ...display.traits import traits_of
from ..definition import MethodEntry
from . import build, params_of
from .reads import named_files


def of(entry: MethodEntry, folder: Path, cls: type[Any], targets: Iterable[str]) -> dict[str, Mapping[str, str]]:
    """What ``digests`` gives for every target of a method of a study. folder: of the config.

    UserError where not one of the files is there, and where the method refuses that targets share a file; a few that
    lack are holes of the table.
    """
    targets = list(targets)
    if sources.ships(cls) and traits_of(cls).functions.isdisjoint(("files", "external")):
        return {target: {} for target in targets}
    method = build(entry.name, entry.params, folder)
    try:
        found: dict[str, Mapping[str, str]] = {target: files(method, target) for target in targets}
        taken = external(method) | _named(method)
        if hasattr(method, "refuse_shared"):
            method.refuse_shared(targets)
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
    of a user's method, those that parameters name."""
    return {**files(method, target), **external(method), **_named(method)}


def _named(method: Any) -> dict[str, str]:
    cls = type(method)
    return {} if sources.ships(cls) else named_files(params_of(method), sources.code_of(cls))


def files(method: Any, target: str) -> dict[str, str]:
    """sha256 of the files that a method reads for a target, by the paths that its function ``files`` gives; ``absent``
    for one that is not there. Empty for a method without that function."""
    given = method.files(target) if "files" in traits_of(method).functions else ()
    return {str(path): file_digest(str(path)) for path in given}


def external(method: Any) -> dict[str, str]:
    """sha256 of the files that a method takes where a machine has them, by names that are the same everywhere;
    ``absent`` for one that is not there. Its function ``external`` gives their paths, None for no file."""
    given = method.external() if "external" in traits_of(method).functions else {}
    return {name: ABSENT if path is None else file_digest(path) for name, path in given.items()}
