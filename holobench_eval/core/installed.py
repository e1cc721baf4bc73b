"""What is installed: this package's version, the studies that ship with it, other packages; nothing is imported."""

from __future__ import annotations

import re
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


@cache
def shipped_configs() -> dict[str, Path]:
    """The configs that ship, by name such as ``table3``."""
    return {path.stem: path for path in sorted(shipped().glob("*.yaml"))}


def pinned() -> dict[str, str]:
    """The versions of packages that the committed results were made with, by name; none if their file is lost."""
    path = shipped() / "constraints.txt"
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return {found[1].lower(): found[2] for line in lines if (found := re.match(r"([\w.-]+)==([\w.]+)", line))}
