"""Which version of a package is installed; imports nothing, so that it can be asked where nothing else works."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def installed(package: str) -> str | None:
    """A package's version; None where it is not installed, as when another build of OpenCV takes its place."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None
