"""The files that a method reads, by which its cells are told apart: a file that is replaced gives another cell."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ...core.errors import CellError, UserError
from ...core.io import file_name
from ..definition import MethodEntry
from . import build

MISSING = "missing"


def of(entry: MethodEntry, folder: Path, cls: type[Any], targets: Iterable[str]) -> dict[str, Mapping[str, str]]:
    """What ``digests`` gives for every target of a method of a study. folder: of the config.

    UserError where not one of the files is there, and where the method refuses that targets share a file; a few that
    lack are holes of the table.
    """
    targets = list(targets)
    if not hasattr(cls, "files"):
        return {target: {} for target in targets}
    method = build(entry.name, entry.params, folder)
    try:
        found: dict[str, Mapping[str, str]] = {target: digests(method, target) for target in targets}
    except (CellError, OSError) as error:
        raise UserError(f"method '{entry.name}' does not say which files it reads: {error}") from error
    if hasattr(method, "refuse_shared"):
        try:
            method.refuse_shared(targets)
        except UserError as error:
            raise UserError(f"method '{entry.name}': {error}") from None
    read = [(target, path, sha256) for target, files in found.items() for path, sha256 in files.items()]
    if read and all(sha256 == MISSING for *_, sha256 in read):
        target, path, _ = read[0]
        which = "" if file_name(target) == target else f" for the target '{target}'"
        where = "" if Path(path).is_absolute() else ", from the working directory"
        raise UserError(
            f"method '{entry.name}': none of the files that it reads is there, such as {path}{which}{where}"
        )
    return found


def digests(method: Any, target: str) -> dict[str, str]:
    """sha256 of the files that a method reads for a target, by the paths that its function ``files`` gives; ``missing``
    for one that is not there. Empty for a method without that function."""
    if not hasattr(method, "files"):
        return {}
    return {str(path): _sha256(Path(str(path))) for path in method.files(target)}


def _sha256(path: Path) -> str:
    if not path.is_file():
        return MISSING
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
