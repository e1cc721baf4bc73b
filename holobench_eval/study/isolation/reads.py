"""What a user's code was seen to read in its calls (`core.reads` says what is not seen), and whether it is still so."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...core.hashing import file_digest, file_state
from ...core.reads import Seen, content, state_of, within
from ...core.sources import Code, code_of, ships

LARGEST = 2**36  # bytes of a file that is hashed
CHANGED = "changed while it was read"  # in place of a digest


@dataclass(frozen=True)
class Reads:
    """What a user's code read in its calls.

    covered: sha256 by path, seen from the study's folder where the file lies there; ``absent`` for a file that was
    asked for in vain; a path of a folder whose names were listed ends with ``/``. uncovered: paths of files that the
    code itself writes after it has read them, and in words what cannot be seen.
    """

    covered: Mapping[str, str] = field(default_factory=dict)
    uncovered: tuple[str, ...] = ()

    def __or__(self, other: Reads) -> Reads:
        """What both have read."""
        return Reads({**self.covered, **other.covered}, tuple(sorted({*self.uncovered, *other.uncovered})))


def reads_of(plugin: Any, params_of: Callable[[Any], Any], opened: Seen) -> Reads:
    """What a user's method or dataset has read beside its code, and what a parameter names.

    Nothing for one of this package, which declares what it reads, or has a digest for each image.
    """
    if ships(type(plugin)):
        return Reads()
    code, params = code_of(type(plugin)), params_of(plugin)
    seen, study = opened.of_the_method(code.folder), Path(code.study).absolute()
    named = [path for paths in _places(params, study).values() for path in paths]
    own = dict(zip(code.paths, code.files.values(), strict=True))
    # C code may have read a file that a parameter names.
    states = {**{path: file_state(path) for path in named if path not in seen.written}, **seen.read}
    covered, uncovered = dict[str, str](), {*code.uncovered, *seen.unseen}
    for path, state in states.items():
        if (Path(path).is_dir() and not path.endswith("/")) or own.get(path) == content(path):
            continue
        if not seen.rewrites(path) and not (isinstance(state, tuple) and state[1] > LARGEST):
            covered[path] = content(path) if state_of(path) == state else CHANGED
        elif state is not None:
            uncovered.add(path)
    seen_from = {path: f"{os.path.relpath(path, study)}{'/' * path.endswith('/')}" for path in covered}
    fixed = {seen_from[path] if within(path, str(study)) else path: sha256 for path, sha256 in covered.items()}
    return Reads(dict(sorted(fixed.items())), tuple(sorted(uncovered)))


def changed(covered: Mapping[str, str], folder: Path) -> str:
    """The first path of ``Reads.covered`` that has another digest now; empty for none. folder: of the study."""
    now = {path: content(f"{folder / path}{'/' * path.endswith('/')}") for path in covered}
    return next((path for path, sha256 in covered.items() if now[path] != sha256), "")


def named_files(params: Any, code: Code) -> dict[str, str]:
    """sha256 of the files that parameters name, by the parameter's text; of both, where the working directory and the
    study's folder have one each."""
    digests = {
        text: [file_digest(path) for path in paths if file_state(path)]
        for text, paths in _places(params, Path(code.study).absolute()).items()
    }
    return {text: " ".join(found) for text, found in digests.items() if found}


def _places(params: Any, study: Path) -> dict[str, list[str]]:
    """What each text among the parameters names that is there, from the working directory or the study's folder."""
    if isinstance(params, Mapping):
        params = list(params.values())
    if isinstance(params, list | tuple):
        return {text: paths for value in params for text, paths in _places(value, study).items()}
    if not isinstance(params, str) or not params or "\0" in params:
        return {}
    paths = (Path(place, Path(params).expanduser()).absolute() for place in (Path.cwd(), study))
    there = dict.fromkeys(os.path.normpath(path) for path in paths if os.access(path, os.F_OK))
    return {params: list(there)} if there else {}
