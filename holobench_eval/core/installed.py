"""What is installed: this package's version, the studies that ship with it, other packages; nothing is imported."""

from __future__ import annotations

import re
import shlex
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path

__version__ = "0.1.0"


def installed(package: str) -> str | None:
    """A package's version; None where it is not installed, as when another build of OpenCV takes its place."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def shipped() -> Path:
    """The folder of the studies that ship, and of ``constraints.txt``."""
    return Path(str(files(f"{__package__.partition('.')[0]}.configs")))


def clone() -> Path | None:
    """The clone of the repository that this package runs from, with ``pip install -e``; None for an installed wheel."""
    root = shipped().parent
    return root if (root / "pyproject.toml").is_file() and (root / "constraints.txt").is_file() else None


def installing(package: str = "", extra: str = "") -> str:
    """The command that installs a package, or without its name this one and an extra of it, in the versions that the
    committed results were made with: from the folder of a clone as its documentation has it, from anywhere else with
    whole paths. What is installed already need not be on an index to get its extras."""
    root = clone()
    relative = root is not None and root == Path.cwd()
    constraints = "constraints.txt" if relative else str((root or shipped()) / "constraints.txt")
    own = ("." if relative else str(root or "holobench_eval")) + (f"[{extra}]" if extra else "")
    editable = "-e " if root is not None and not package else ""
    return f"pip install -c {shlex.quote(constraints)} {editable}{shlex.quote(package or own)}"


@cache
def shipped_configs() -> dict[str, Path]:
    """The configs that ship, by name such as ``table3``."""
    return {path.stem: path for path in sorted(shipped().glob("*.yaml"))}


def as_typed(config: Path) -> str:
    """A config as a command has it: ``depth`` or ``depth/frames`` of one that ships, else the path."""
    for name, file in shipped_configs().items():
        if file in (config, config.parent):
            return (Path(name) / config.relative_to(file)).as_posix()
    return str(config)


def pinned() -> dict[str, str]:
    """The versions of packages that the committed results were made with, by name; none if their file is lost."""
    path = shipped() / "constraints.txt"
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return {found[1].lower(): found[2] for line in lines if (found := re.match(r"([\w.-]+)==([\w.]+)", line))}
