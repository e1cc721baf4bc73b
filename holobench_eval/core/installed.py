"""What is installed: this package's version, the studies that ship with it, other packages; nothing is imported."""

from __future__ import annotations

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


@cache
def shipped_configs() -> dict[str, Path]:
    """The configs that ship, by name such as ``table3``."""
    folder = Path(str(files(f"{__package__.partition('.')[0]}.configs")))
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}
