"""Which version of the code a number comes from: declared for what ships with the package, a hash of users' files.

A declared version does not depend on where code lies or how it is written. ``tests/golden`` computes a small case of
everything that is declared here and fails where its numbers have changed and its version has not.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..core import plugins, sources
from ..core.errors import CellError
from ..core.released import edited

# What a method is given: the pixels of its target, nominal optics, random numbers. A new version is any new text; every
# phase is then solved again.
GIVEN = "1"
GIVEN_GRAY = "2: the colour that alone has light"  # on a display of one wavelength
# Everything between a phase and its capture: simulated bench, camera, registration. With a new text every capture is
# taken again, of phases that stay.
HARNESS = "4: scattered light taken off before registration"
# How photographs of a display that exists are scored, beside HARNESS: one new text for a real display's cells alone.
PHOTOGRAPHS = "means over the target's pixels"
# The alignment of a photograph with its target without fiducials (``holoeval score``).
ALIGNMENT = "captures whose red and blue are exchanged have no score"

EDITED = ", edited "  # in the version of a method that ships with the package, before the digest
AGAIN = "has changed since the study was planned; start the run again"


def method_version(cls: type[Any]) -> str:
    """The version of a method's code: declared if it ships with the package, else the digest of its code.

    A shipped method declares ``version: ClassVar[int]``, 1 if it says nothing. It is raised when the method gives
    other phases, or learns something else: phases are then computed, and artifacts learned, again. What a user's
    class says of its version is a label for people. Where its files differ from those that were released, the digest of
    the differing ones is part of it.
    """
    if not sources.ships(cls):
        return sources.code_of(cls).sha256
    changes = edited((cls.__module__,))
    return f"{sources.declared_version(cls)}{f'{EDITED}{changes}' if changes else ''}"


def dataset_version(name: str, cls: type[Any]) -> str:
    """The version of the code of a dataset that does not ship with the package, or is not as it was released; empty for
    another one, whose pixels the digests of its images tell."""
    return edited((cls.__module__,)) if plugins.is_shipped("datasets", name) else method_version(cls)


def gate(
    method: Any,
    label: str,
    planned: str,
    files: Mapping[str, str] | None = None,
    planned_files: Mapping[str, str] | None = None,
) -> None:
    """The one gate before solve, train, predict and holograms: CellError where a method is not the planned one.

    label: how the error calls it; planned: its ``method_version`` in the plan; files, planned_files: digests of the
    files that it reads, now and in the plan.
    """
    if method_version(type(method)) != planned:
        raise CellError(f"the code of {label} {AGAIN}")
    if files != planned_files:
        raise CellError(f"a file that {label} reads {AGAIN}")
