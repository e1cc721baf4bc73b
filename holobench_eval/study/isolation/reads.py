"""What a user's code was seen to read in its calls (`core.reads` says what is not seen), and whether it is still so."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.hashing import ABSENT, file_digest, file_state
from ...core.reads import STARTED, Seen, within
from ...core.sources import Code, code_of, lies_in, ships

LARGEST = 2**36  # bytes of a file that is hashed
CHANGED = "changed while it was read"  # in place of a digest


@dataclass(frozen=True)
class Reads:
    """What a user's code read in its calls.

    covered: sha256 by path, seen from the study's folder where the file lies there; ``absent`` for a file that was
    asked for in vain. uncovered: paths of other files, of those too that the code itself writes after it has read them,
    and in words what cannot be seen.
    """

    covered: Mapping[str, str]
    uncovered: tuple[str, ...]


def reads_of(plugin: Any, params_of: Callable[[Any], Any], opened: Seen) -> Reads:
    """What a user's method or dataset has read, told apart: covered is what lies below the folder of the study or of
    its file, and what a parameter names, itself or by a folder above it; files of its own code count there.

    Nothing for one of this package, which declares what it reads, or has a digest for each image.
    """
    if ships(type(plugin)):
        return Reads({}, ())
    code, params = code_of(type(plugin)), params_of(plugin)
    seen = opened.of_the_method(code.folder)
    study = Path(code.study).absolute()
    folder, named = str(study), [path for paths in _places(params, study).values() for path in paths]
    places, own = [folder, code.folder, *named], dict(zip(code.paths, code.files.values(), strict=True))
    # C code may have read a file that a parameter names.
    states = {**{path: file_state(path) for path in named if path not in seen.written}, **seen.read}
    covered, uncovered = dict[str, str](), {*code.uncovered, *([STARTED] if seen.starts else [])}
    for path, state in states.items():
        if Path(path).is_dir() or (path in own and file_digest(path) == own[path]):
            continue
        is_fixed = path not in seen.written and (state is None or state[1] <= LARGEST)
        if not is_fixed or not any(lies_in(path, place) for place in places):
            uncovered |= {path} if state is not None else set()
            continue
        name = os.path.relpath(path, folder) if within(path, folder) else path
        covered[name] = ABSENT if state is None else file_digest(path) if file_state(path) == state else CHANGED
    return Reads(dict(sorted(covered.items())), tuple(sorted(uncovered)))


def changed(covered: Mapping[str, str], folder: Path) -> str:
    """The first path of ``Reads.covered`` that has another digest now; empty for none. folder: of the study."""
    return next((path for path, sha256 in covered.items() if file_digest(folder / path) != sha256), "")


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
