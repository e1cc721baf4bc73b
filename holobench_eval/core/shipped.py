"""The studies that ship with the package, by name."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path


@cache
def shipped_configs() -> dict[str, Path]:
    """Their configs by name, such as ``table3``; empty where the package has been stripped of them."""
    package = __package__.partition(".")[0]
    try:
        folder = Path(str(files(f"{package}.configs").joinpath("table3.yaml"))).parent
    except ModuleNotFoundError:
        return {}
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}
